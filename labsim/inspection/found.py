"""What an inspection says of one drop or scan."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..errors import LabsimError
from ..inference.free_fall import SMALL_SHARE
from ..records import Measured

ODD = 3.0  # standard deviations


@dataclass
class Found:
    """One drop or scan: a line for people, numbers for --json, and what looks odd.

    trouble : why it cannot be read at all. gravity, speed : over what they should be.
    """

    name: str
    line: str
    numbers: dict[str, Any] = field(default_factory=dict)
    odd: list[str] = field(default_factory=list)
    trouble: LabsimError | None = None
    gravity: Measured | None = None
    speed: Measured | None = None


def is_odd(ratio: Measured) -> bool:
    """Whether a ratio that should be one is not."""
    return abs(ratio.value - 1) > max(ODD * ratio.sigma, SMALL_SHARE)
