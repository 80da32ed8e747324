"""A saturated background: how bright it would have been, and the part of a blurred edge that the ceiling cut off.

Across a blurred edge the light is an error function of the distance. Its darker part is recorded, and says how far the
rest would have risen.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.special import ndtr

from ...records import FloatArray

CONTOUR = 0.6  # opacity that every usable edge reaches, however bright the background
# opacity; what is nearer to the plateau of clipped pixels is a mean over clipped and whole ones
ABOVE_PLATEAU = 0.06
ACROSS = 7.0  # px on either side of the contour
LEAST_PIXELS = 60


def measure_excess(opacity: FloatArray, known_above: float) -> float | None:
    """Opacity that the background would have without a ceiling; None where the edges do not say it.

    opacity : (rows, columns) with the background as it is taken to be as 0 and the projectile as 1. Negative where the
    true background is brighter. Below ``known_above`` nothing was recorded.
    """
    found = _fit_edge(opacity, known_above, free_base=True)
    if found is None:
        return None
    return found[2]


def extend_edge(opacity: FloatArray, plateau: float) -> FloatArray:
    """The opacity with its clipped part, which stands at ``plateau``, replaced by the error function of the rest."""
    found = _fit_edge(opacity, plateau + ABOVE_PLATEAU, free_base=False)
    if found is None:
        return opacity
    offset, blur, _, full = found
    drawn = full * ndtr((measure_distance(opacity)[0] - offset) / blur)
    return np.where(opacity < plateau + ABOVE_PLATEAU, drawn, opacity)


def _fit_edge(
    opacity: FloatArray, known_above: float, free_base: bool
) -> tuple[float, float, float, float] | None:
    """Offset from the contour, blur (px), opacity of the background and of the projectile of one edge profile."""
    distance, count = measure_distance(opacity)
    if count < 12:
        return None
    near = (np.abs(distance) < ACROSS) & (opacity > known_above)
    if near.sum() < LEAST_PIXELS:
        return None
    d, m = distance[near], opacity[near]

    def residual(q: FloatArray) -> FloatArray:
        base = q[3] if free_base else 0.0
        return base + (q[2] - base) * ndtr((d - q[0]) / q[1]) - m

    start = [0.3, 1.0, 1.0, -0.2][: 4 if free_base else 3]
    low = [-3.0, 0.3, 0.7, -2.0][: len(start)]
    high = [3.0, 6.0, 1.3, 0.2][: len(start)]
    found = least_squares(residual, start, bounds=(low, high), loss="soft_l1", f_scale=0.02)
    if not found.success or 1.4826 * np.median(np.abs(found.fun)) > 0.1:
        return None
    q = found.x
    return float(q[0]), float(q[1]), float(q[3]) if free_base else 0.0, float(q[2])


def measure_distance(opacity: FloatArray, contour: float = CONTOUR) -> tuple[FloatArray, int]:
    """Signed distance (px, positive inside) of every pixel from a contour, and the number of its points."""
    slope = np.stack(list(np.gradient(opacity)), axis=-1)
    points, normals = [], []
    for axis in (0, 1):
        first = opacity[:-1] if axis == 0 else opacity[:, :-1]
        second = opacity[1:] if axis == 0 else opacity[:, 1:]
        i, j = np.nonzero((first - contour) * (second - contour) < 0)
        share = (contour - first[i, j]) / (second[i, j] - first[i, j])
        di, dj = (1, 0) if axis == 0 else (0, 1)
        points.append(np.column_stack([i + share * di, j + share * dj]))
        normals.append((1 - share)[:, None] * slope[i, j] + share[:, None] * slope[i + di, j + dj])
    spots, normal = np.concatenate(points), np.concatenate(normals)
    if len(spots) == 0:
        return np.full(opacity.shape, np.inf), 0
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    grid = np.moveaxis(np.mgrid[: opacity.shape[0], : opacity.shape[1]], 0, -1).reshape(-1, 2).astype(float)
    away, nearest = cKDTree(spots).query(grid)
    along = np.sum((grid - spots[nearest]) * normal[nearest], axis=1)
    # beyond the ends of the contour the nearest point lies aside: there the distance itself, with its sign
    signed = np.where(np.abs(along) > 0.7 * away, along, np.sign(along) * away)
    return signed.reshape(opacity.shape), len(spots)
