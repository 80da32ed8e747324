"""Pixel size and frame rate against gravity and drop heights, from all drops together."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..inference.free_fall import agrees, pool
from ..records import STANDARD_GRAVITY, Measured
from .found import Found, is_odd

TOO_FAST = "at contact, but"
FALLS_WITH = "free flight falls"


def judge_scales(drops: Sequence[Found]) -> list[str]:
    """g ∝ pixel · rate², speed ∝ pixel · rate. What is said here of all drops is taken out of what looks odd of each.

    A drop far from the others has a fault of its own and keeps its own line, and so does one alone among videos.
    """
    lines = []
    gravities = [drop.gravity for drop in drops if drop.gravity is not None]
    speeds = [drop.speed for drop in drops if drop.speed is not None]
    gravity = pool(gravities) if len(gravities) > 1 or len(drops) == 1 else None
    speed = pool(speeds) if len(speeds) > 1 or len(drops) == 1 else None
    if gravity is not None and is_odd(gravity):
        g, sigma = gravity.value * STANDARD_GRAVITY, gravity.sigma * STANDARD_GRAVITY
        lines.append(
            f"free fall{_count(drops, gravities, '', ' of ')} shows g = {g:.2f} ± {sigma:.2f} m/s² instead of "
            f"{STANDARD_GRAVITY}; "
            f"a pixel size of {100 / gravity.value:.1f} % or a frame rate of {100 / math.sqrt(gravity.value):.1f} % of what is "
            "stated would put it right (g grows as pixel · rate²): check pixel_size_um and frame_rate_Hz"
        )
        _forget(
            [drop for drop in drops if drop.gravity is not None and agrees(drop.gravity, gravity.value)],
            FALLS_WITH,
        )
    if speed is not None and is_odd(speed):
        lines.append(
            f"{_count(drops, speeds, 'the drops')} are {abs(speed.value - 1):.1%} "
            f"{'faster' if speed.value > 1 else 'slower'} at contact than their heights "
            f"say (± {speed.sigma:.1%}): check pixel_size_um, frame_rate_Hz and from where height_mm is counted"
        )
        _forget(
            [drop for drop in drops if drop.speed is not None and agrees(drop.speed, speed.value)], TOO_FAST
        )
    if len(lines) == 2 and gravity is not None and speed is not None:
        pixel, rate = speed.value**2 / gravity.value, gravity.value / speed.value
        lines.append(
            f"both together ask for a pixel size of {100 / pixel:.1f} % and a frame rate of {100 / rate:.1f} % of what is stated"
        )
    return lines


def _count(drops: Sequence[Found], shown: Sequence[Measured], all_of_them: str, before: str = "") -> str:
    """Of how many drops, where not of all."""
    return all_of_them if len(shown) == len(drops) else f"{before}{len(shown)} of {len(drops)} drops"


def _forget(drops: Sequence[Found], words: str) -> None:
    for drop in drops:
        drop.odd = [text for text in drop.odd if words not in text]
