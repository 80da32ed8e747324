"""What a likelihood needs of a stored run: to read that alone takes a fifth to a third of the time of the whole.

Each part has fields of DropRun, by the same names; ``RunStore.get_parts`` reads what it is asked for. A new run is a
whole DropRun, which serves as any part.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..records import FloatArray
from ..sph import DropRun, DropSetting


@dataclass(frozen=True)
class Motion:
    """What the projectile did."""

    setting: DropSetting
    time: FloatArray
    depth: FloatArray
    velocity: FloatArray
    penetration_depth: float
    stopping_time: float
    stopped: bool

    def depth_at(self, time: FloatArray) -> FloatArray:
        """Depth (m) at times (s) from contact, as DropRun.depth_at."""
        return DropRun.depth_at(self, time)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Dust:
    r: FloatArray
    z: FloatArray
    volume: FloatArray
    filling_factor: FloatArray


@dataclass(frozen=True)
class Compaction:
    """What became of the dust."""

    setting: DropSetting
    penetration_depth: float
    stopped: bool
    particles: Dust


@dataclass(frozen=True)
class Push:
    """What resisted a tip that was led."""

    setting: DropSetting
    depth: FloatArray
    shaft_work: FloatArray
    energies: dict[str, float]
    stopped: bool


Part = type[DropRun] | type[Motion] | type[Compaction] | type[Push]
AnyPart = DropRun | Motion | Compaction | Push
