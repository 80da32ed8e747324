"""Whether the rows of a drop put the dust's surface where drop.toml states it.

Depth is counted from the stated row, and a few pixels change p_m as much as its error bar without making the fit worse. The
rows alone tell the place of contact to about a pixel (video.contact_row): the force on a round tip starts from zero, so that
contact has no edge. Only a row that is off by several pixels is found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..own_keys import ROUND
from ..records import STANDARD_GRAVITY, DecelerationCurve, Drop, Track
from ..video.motion.contact_row import find_surface_row
from .observations.observe import Observed, ObservedDrop

DOUBTED = 4.0  # standard deviations
SCALE_SHARE = 0.01  # by which apparent gravity may be off before the pixel size is taken from it
LEAST_FREE = 10  # frames before contact: with three, a contact five standard deviations off was found
SCALE_LIMIT = 0.2  # beyond it nothing is said: the radius in pixels is not known


def doubt_surface_row(drop: Drop, track: Track, curve: DecelerationCurve) -> str | None:
    """One line where the rows contradict ``surface_row_px`` by more than DOUBTED standard deviations of both together.

    Where free fall is not 9.81 m/s² on the stated scale, the pixel size that would make it so is used: a wrong scale is another
    fault, and would move the contact. Nothing is said where it is off by more than SCALE_LIMIT.
    """
    camera = drop.camera
    if drop.projectile.tip not in ROUND:
        return None
    assert camera is not None and curve.clock is not None
    if (curve.clock[track.valid] < curve.contact_time.value).sum() < LEAST_FREE:
        return None
    scaled = camera
    if curve.apparent_gravity is not None:
        ratio = curve.apparent_gravity.value / STANDARD_GRAVITY
        if abs(ratio - 1) > SCALE_LIMIT:
            return None
        if abs(ratio - 1) > max(SCALE_SHARE, 3 * curve.apparent_gravity.sigma / STANDARD_GRAVITY):
            scaled = replace(camera, pixel_size=camera.pixel_size / ratio)
    same = curve if scaled is camera else None
    found = find_surface_row(track, scaled, drop.projectile.tip_radius, same)
    if found is None:
        return None
    sigma = math.hypot(found.sigma, camera.surface_row_sigma)
    off = found.value - camera.surface_row
    if abs(off) <= DOUBTED * sigma:
        return None
    return (
        f"the rows put the surface at row {found.value:.1f} ± {found.sigma:.1f} px, {abs(off) / sigma:.0f} standard deviations "
        f"{'below' if off > 0 else 'above'} the stated {camera.surface_row:g}: check surface_row_px"
    )


def doubt_surface_rows(drops: Sequence[Observed]) -> list[str]:
    """The same for every drop."""
    doubts = {
        seen.name: doubt_surface_row(seen.drop, seen.track, seen.curve)
        for seen in drops
        if isinstance(seen, ObservedDrop)
    }
    return [f"drop {name}: {doubt}" for name, doubt in doubts.items() if doubt is not None]
