"""Sub-pixel registration of an end of the projectile against a fixed template.

The template is the opacity m (0 background, 1 projectile) of the region around one end, as cubic B-spline
coefficients. A picture is modelled as I = a B (1 - m(p - shift)) + b m(p - shift): B the background, a its brightness, b the
projectile's level. Shift (dy, dx), a and b are solved together by Gauss-Newton steps (Lucas & Kanade 1981), weighted
by the noise of each pixel, with Huber weights against spray. A plane is added for light that drifts
across (glare). The error bar is the element of the inverse of the whole Fisher matrix, so what x, a, b and the plane take
away from y is in it. A saturated pixel counts as one that is at least as bright as the ceiling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...records import FloatArray
from ..picture.noise import Noise
from .likelihood import accumulate, solve_step
from .template import MARGIN, Template, spline_weights

HUBER = 3.0  # standard deviations
ENOUGH = 1e-4  # px, the step at which the iteration ends


@dataclass(frozen=True)
class Fit:
    """Result of one registration: position of the template's origin (px), error bars, and how well it fitted."""

    y: float
    x: float
    sigma: float
    brightness: float
    level: float
    chi_square: float  # per pixel, of the robust residual
    lost: float  # share of the information that the Huber weights took away
    plane: tuple[float, float]  # grey levels of stray light at the region's lower and right edge
    influence: FloatArray  # (6,) row of the inverse Fisher matrix: shift of y by a unit of score


def register(
    picture: np.ndarray,
    background: FloatArray,
    usable: np.ndarray,
    template: Template,
    noise: Noise,
    y: float,
    x: float,
    level: float,
    brightness: float,
    *,
    ceiling: float = np.inf,
    robust: bool = True,
    steps: int = 12,
) -> Fit | None:
    """Find the template in a picture, starting from (y, x). None where too little of it can be seen.

    picture, background, usable: (rows, columns) alike; ``usable`` False masks pixels (dust, dead);
    ``ceiling``: grey level at which they saturate, background being the light without that limit.
    """
    h, w = template.shape
    theta = np.array([0.0, 0.0, brightness, level, 0.0, 0.0])
    oy, ox = round(y), round(x)
    dy, dx = y - oy, x - ox
    region = None
    fisher = np.eye(6)
    chi_square = lost = np.nan
    for _ in range(steps):
        if abs(dy) > 0.6 or abs(dx) > 0.6:
            oy, ox = oy + round(dy), ox + round(dx)
            dy, dx = dy - round(dy), dx - round(dx)
            region = None
        if region is None:
            region = cut_region(
                picture, background, usable, oy + template.top + MARGIN, ox + template.left + MARGIN, h, w
            )
            if region is None:
                return None
            image, ground, mask, rows, columns = region
        fisher, right, sums = accumulate(
            template.coefficients,
            spline_weights(float(dy)),
            spline_weights(float(dx)),
            (rows.start, columns.start),
            (h, w),
            image,
            ground,
            mask,
            theta,
            (noise.read_variance, noise.gain),
            HUBER if robust else 1e9,
            ceiling,
        )
        step = solve_step(fisher, right)
        if not np.all(np.isfinite(step)):
            return None
        jump = max(abs(step[0]), abs(step[1]))
        if jump > 2.0:
            step[:2] *= 2.0 / jump
        dy, dx = dy + step[0], dx + step[1]
        theta[2:] += step[2:]
        chi_square = sums[0] / max(sums[3] - 6, 1)
        lost = 1.0 - sums[1] / max(sums[2], 1e-30)
        if jump < ENOUGH:
            break
    else:
        if jump > 0.02:
            return None
    if not np.isfinite(dy) or abs(oy + dy - y) > 12 or abs(ox + dx - x) > 12:
        return None
    inverse = _invert(fisher)
    return Fit(
        float(oy + dy),
        float(ox + dx),
        float(np.sqrt(max(inverse[0, 0], 0.0))),
        theta[2],
        theta[3],
        chi_square,
        lost,
        (float(theta[4]), float(theta[5])),
        inverse[0],
    )


def _invert(fisher: FloatArray) -> FloatArray:
    """Inverse of the Fisher matrix; what nothing is known of (a parameter without a pixel) gets no covariance."""
    scale = np.sqrt(np.diag(fisher)) + 1e-12
    both = np.outer(scale, scale)
    try:
        inverse = np.linalg.inv(fisher / both)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(fisher / both) / both
    if np.abs(inverse).max() > 1e12:
        inverse = np.linalg.pinv(fisher / both)
    return inverse / both


def cut_region(picture, background, usable, top, left, h, w):
    """The part of the region inside the picture, with the slices of the template that belong to it."""
    rows = slice(max(0, -top), min(h, picture.shape[0] - top))
    columns = slice(max(0, -left), min(w, picture.shape[1] - left))
    if rows.stop - rows.start < 6 or columns.stop - columns.start < 6:
        return None
    here = (slice(top + rows.start, top + rows.stop), slice(left + columns.start, left + columns.stop))
    mask = usable[here].astype(np.float64)
    if mask.sum() < 40:
        return None
    return (
        picture[here].astype(np.float64),
        np.ascontiguousarray(background[here], np.float64),
        mask,
        rows,
        columns,
    )
