"""What is left of the spacing in a result: the same drop at several spacings, extrapolated to none.

Depth and stopping time come out linear in the spacing (docs/numerics.md), so the limit is the value of the straight line
at zero. With three spacings or more its sigma adds three parts in quadrature: what the fit itself leaves, half of what
the extrapolation moves beyond the finest run, and the difference to a line through the two finest alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import SimulationError
from .drop import simulate
from .run import DropRun
from .setting import DropSetting, check_setting

RATIO = math.sqrt(2.0)  # of one spacing to the next: a third run costs as much as eight of the first
COMPACTED = 0.20  # filling factor above which dust counts as compacted


@dataclass(frozen=True)
class Extrapolated:
    """A number at spacing zero with the standard uncertainty of having got there; values as computed, coarsest first.

    order: the power of the spacing that three or more values show; None where they do not show one.
    """

    value: float
    sigma: float
    values: tuple[float, ...]
    order: float | None


@dataclass(frozen=True)
class ConvergedRun:
    """Runs of one drop, coarsest first, and what they tend to. Lengths in m, times in s, volumes in m³ (planar m²)."""

    runs: tuple[DropRun, ...]
    penetration_depth: Extrapolated
    stopping_time: Extrapolated
    compacted_volume: Extrapolated

    @property
    def finest(self) -> DropRun:
        return self.runs[-1]


def refine(setting: DropSetting, count: int) -> list[DropSetting]:
    """The setting at ``count`` spacings, each √2 finer than the one before: coarsest first, which is ``setting`` itself."""
    if count < 2:
        raise SimulationError("simulation", "spacings", f"is {count}; extrapolation needs at least 2")
    return [setting.replace(spacing=setting.spacing / RATIO**k) for k in range(count)]


def extrapolate(spacings: Sequence[float], values: Sequence[float]) -> Extrapolated:
    """Value at spacing zero of quantities that are linear in the spacing, with an honest sigma."""
    h, y = np.asarray(spacings, dtype=float), np.asarray(values, dtype=float)
    if h.size < 2 or h.size != y.size or np.any(np.diff(h) >= 0):
        raise SimulationError("simulation", "spacings", "need two or more falling spacings, a value for each")
    slope, limit = np.polyfit(h, y, 1)
    last_slope = (y[-2] - y[-1]) / (h[-2] - h[-1])
    finest_pair = y[-1] - last_slope * h[-1]
    left = float(np.sqrt(np.sum((y - limit - slope * h) ** 2) / max(h.size - 2, 1)))
    sigma = math.sqrt(left**2 + (0.5 * (limit - y[-1])) ** 2 + (limit - finest_pair) ** 2)
    return Extrapolated(float(limit), sigma, tuple(float(v) for v in y), _observed_order(h, y))


def _observed_order(h: np.ndarray, y: np.ndarray) -> float | None:
    """Power of the spacing that the last three values show, if they fall or rise steadily and h falls by one ratio."""
    if h.size < 3:
        return None
    coarse, fine = y[-3] - y[-2], y[-2] - y[-1]
    if coarse * fine <= 0 or not math.isclose(h[-3] / h[-2], h[-2] / h[-1], rel_tol=0.02):
        return None
    return math.log(coarse / fine) / math.log(h[-2] / h[-1])


def simulate_spacings(
    setting: DropSetting, count: int = 3, progress: Callable[[float], None] | None = None
) -> ConvergedRun:
    """Run a drop at the ``count`` spacings of ``refine`` and extrapolate. Raises SimulationError where one cannot be run."""
    settings = refine(setting, count)
    for each in settings:
        check_setting(each)
    spacings = [each.spacing for each in settings]
    runs = tuple(simulate(each, progress) for each in settings)
    return ConvergedRun(
        runs,
        extrapolate(spacings, [run.penetration_depth for run in runs]),
        extrapolate(spacings, [run.stopping_time for run in runs]),
        extrapolate(spacings, [run.compacted_volume(COMPACTED) for run in runs]),
    )
