"""What free fall says of the scales of all drops together: one g, or one that changes from drop to drop.

g ∝ pixel size · frame rate². Where it is off alike in all drops, one cause may explain it. Where drops disagree, each camera has
a scale of its own, and no cause that is the same for all drops can be right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..records import STANDARD_GRAVITY, Measured
from .observations.observe import Observed

STRAY = 4.0  # standard deviations from the middle of all drops: that drop's own fault
SMALL_SHARE = 0.01  # relative: what is smaller is not worth a word


def pool(ratios: Sequence[Measured]) -> Measured | None:
    """Weighted mean of the drops that agree with their median, its error raised where they scatter more than they say."""
    if not ratios:
        return None
    middle = float(np.median([each.value for each in ratios]))
    agree = [each for each in ratios if agrees(each, middle)]
    if 2 * len(agree) <= len(ratios):
        agree = list(ratios)
    weights = [1 / max(each.sigma, 1e-6) ** 2 for each in agree]
    mean = sum(w * each.value for w, each in zip(weights, agree, strict=True)) / sum(weights)
    chi = sum(w * (each.value - mean) ** 2 for w, each in zip(weights, agree, strict=True))
    return Measured(mean, math.sqrt(max(1.0, chi / max(len(agree) - 1, 1)) / sum(weights)))


def agrees(ratio: Measured, middle: float) -> bool:
    """Whether a ratio near one is what it is for the other drops."""
    return abs(ratio.value - middle) <= max(STRAY * ratio.sigma, SMALL_SHARE)


def doubt_scales(drops: Sequence[Observed]) -> list[str]:
    """One line where free fall shows different g in different drops, naming those off the middle of all."""
    shown = [
        (drop.name, Measured(g.value / STANDARD_GRAVITY, g.sigma / STANDARD_GRAVITY))
        for drop in drops
        if drop.curve is not None and (g := drop.curve.apparent_gravity) is not None
    ]
    common = pool([ratio for _, ratio in shown])
    if common is None:
        return []
    strays = [(name, ratio) for name, ratio in shown if not agrees(ratio, common.value)]
    if not strays:
        return []
    if 2 * len(strays) >= len(shown):  # nobody knows who is right
        strays = shown
    values = ", ".join(f"{_say(ratio)} in {name}" for name, ratio in strays)
    rest = f", {_say(common)} in the others" if len(strays) < len(shown) else ""
    return [
        f"free fall shows g = {values}{rest}: the scale differs from camera to camera, which no cause that is the same for all "
        f"drops can explain; check pixel_size_um and frame_rate_Hz of {', '.join(name for name, _ in strays)}"
    ]


def _say(ratio: Measured) -> str:
    return f"{ratio.value * STANDARD_GRAVITY:.2f} ± {ratio.sigma * STANDARD_GRAVITY:.2f} m/s²"
