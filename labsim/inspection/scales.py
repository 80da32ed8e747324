"""Pixel size and frame rate against gravity and drop heights, from all drops together."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..records import STANDARD_GRAVITY, Measured
from .found import SMALL_SHARE, Found, is_odd

TOO_FAST = "at contact, but"
FALLS_WITH = "free flight falls"
STRAY = 5.0  # standard deviations from the middle of all drops: that drop's own fault


def judge_scales(drops: Sequence[Found]) -> list[str]:
    """g ∝ pixel · rate², speed ∝ pixel · rate. What is said here of all drops is taken out of what looks odd of each.

    A drop far from the others has a fault of its own and keeps its own line.
    """
    lines = []
    gravity = pool([drop.gravity for drop in drops if drop.gravity is not None])
    speed = pool([drop.speed for drop in drops if drop.speed is not None])
    if gravity is not None and is_odd(gravity):
        g, sigma = gravity.value * STANDARD_GRAVITY, gravity.sigma * STANDARD_GRAVITY
        lines.append(
            f"free fall shows g = {g:.2f} ± {sigma:.2f} m/s² instead of {STANDARD_GRAVITY}; a pixel size of "
            f"{100 / gravity.value:.1f} % or a frame rate of {100 / math.sqrt(gravity.value):.1f} % of what is stated would "
            "put it right (g grows as pixel · rate²): check pixel_size_um and frame_rate_Hz"
        )
        _forget([drop for drop in drops if _agrees(drop.gravity, gravity.value)], FALLS_WITH)
    if speed is not None and is_odd(speed):
        lines.append(
            f"the drops are {abs(speed.value - 1):.1%} {'faster' if speed.value > 1 else 'slower'} at contact than their heights "
            f"say (± {speed.sigma:.1%}): check pixel_size_um, frame_rate_Hz and from where height_mm is counted"
        )
        _forget([drop for drop in drops if _agrees(drop.speed, speed.value)], TOO_FAST)
    if len(lines) == 2 and gravity is not None and speed is not None:
        pixel, rate = speed.value**2 / gravity.value, gravity.value / speed.value
        lines.append(
            f"both together ask for a pixel size of {100 / pixel:.1f} % and a frame rate of {100 / rate:.1f} % of what is stated"
        )
    return lines


def pool(ratios: Sequence[Measured]) -> Measured | None:
    """Weighted mean of the drops that agree with their median, its error raised where they scatter more than they say."""
    if not ratios:
        return None
    middle = float(np.median([each.value for each in ratios]))
    agree = [each for each in ratios if _agrees(each, middle)]
    if 2 * len(agree) <= len(ratios):
        agree = list(ratios)
    weights = [1 / max(each.sigma, 1e-6) ** 2 for each in agree]
    mean = sum(w * each.value for w, each in zip(weights, agree, strict=True)) / sum(weights)
    chi = sum(w * (each.value - mean) ** 2 for w, each in zip(weights, agree, strict=True))
    return Measured(mean, math.sqrt(max(1.0, chi / max(len(agree) - 1, 1)) / sum(weights)))


def _agrees(ratio: Measured | None, middle: float) -> bool:
    return ratio is not None and abs(ratio.value - middle) <= STRAY * math.hypot(ratio.sigma, SMALL_SHARE)


def _forget(drops: Sequence[Found], words: str) -> None:
    for drop in drops:
        drop.odd = [text for text in drop.odd if words not in text]
