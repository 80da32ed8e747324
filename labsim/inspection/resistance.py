"""One drop against the others: the work that the dust takes per volume displaced.

A strength that depends on strain alone has no length of its own, so that in one dust the work over the displaced volume,

    s = (m v²/2 + m g D) / V(D, R)

is one function of D/R for tips of one shape, whatever the mass, the speed and the size (dimensional analysis; V is that of the
buried part of the tip and its rod). It is a smooth, slowly rising one: a straight line in the logarithms. Rates, friction, gas,
a crust bend it by up to 30 %; a mass, a radius or a track that belongs to another drop shifts one drop by more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..own_keys import ROUND
from ..records import STANDARD_GRAVITY, Campaign, FloatArray, Motion
from .found import Found, is_odd

LEAST_DROPS = 6
FAR = 0.35  # of ln s; the largest in campaigns with a fault of the dust or the scales is 0.29
STRAY = 5.0  # robust standard deviations of the other drops


def judge_resistance(campaign: Campaign, drops: Sequence[Found]) -> None:
    """Add to what is odd of each drop whose resistance is not that of the others.

    Drops whose free fall or speed already contradicts their scales are left out: their work is wrong with them.
    """
    seen, depths, works = [], [], []
    for drop, found in zip(campaign.drops, drops, strict=True):
        depth, speed = found.numbers.get("penetration_depth_m"), found.numbers.get("impact_speed_m_s")
        if drop.projectile.tip not in ROUND or drop.motion != Motion():
            continue
        if depth is None or speed is None or found.trouble is not None or not depth > 0:
            continue
        if any(ratio is not None and is_odd(ratio) for ratio in (found.gravity, found.speed)):
            continue
        radius, mass = drop.projectile.tip_radius, drop.projectile.mass
        work = mass * (0.5 * speed**2 + STANDARD_GRAVITY * depth)
        seen.append(found)
        depths.append(math.log(depth / radius))
        works.append(math.log(work / displaced_volume(depth, radius)))
    if len(seen) < LEAST_DROPS:
        return
    left = _leave_line(np.array(depths), np.array(works))
    scatter = 1.4826 * float(np.median(np.abs(left)))
    for found, off in zip(seen, left, strict=True):
        if abs(off) > max(FAR, STRAY * scatter):
            found.odd.append(
                f"the dust takes {math.exp(off):.2g} times the work per volume that it takes in the other drops (they agree to "
                f"{scatter:.0%}): check mass_mg, tip_radius_mm, pixel_size_um and whether the record is that of this drop"
            )


def displaced_volume(depth: float, radius: float) -> float:
    """m³ of a round tip and the rod behind it below the surface; depth, radius : m."""
    cap = min(depth, radius)
    return math.pi * (radius * cap**2 - cap**3 / 3 + radius**2 * max(depth - radius, 0.0))


def _leave_line(x: FloatArray, y: FloatArray) -> FloatArray:
    """y less the straight line of the median slope (Theil & Sen), (n,): a third of the drops may be wrong."""
    one, two = np.triu_indices(x.size, 1)
    apart = np.abs(x[two] - x[one]) > 0.05
    slope = float(np.median((y[two] - y[one])[apart] / (x[two] - x[one])[apart])) if apart.any() else 0.0
    rest = y - slope * x
    return np.asarray(rest - np.median(rest))
