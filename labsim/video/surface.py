"""The surface of the dust beside the projectile's path."""

from __future__ import annotations

import cv2
import numpy as np

from ..records import FloatArray

ROUGHEST_SURFACE = 3.0  # px rms about a straight line; beyond, it is a carpet or a picture, not raked dust


def find_corridor(swept: np.ndarray) -> tuple[int, int]:
    """Columns over which the projectile passes: those swept over a great height, unlike those with spray."""
    tall = swept.sum(axis=0)
    columns = np.flatnonzero(tall > 0.7 * tall.max())
    return int(columns[0]), int(columns[-1])


def find_surface(
    background: FloatArray, lit: np.ndarray, swept: np.ndarray
) -> tuple[tuple[float, float] | None, float]:
    """Line through the half-way crossings from lit picture to dust beside the path; None where there is no dust."""
    bottom = lit[-3:].mean()
    if bottom > 0.3:
        return None, 0.0
    left, right = find_corridor(swept)
    radius = max(5, (right - left) // 4)
    xs, ys = [], []
    height = background.shape[0]
    smooth = cv2.blur(background.astype(np.float32), (3, 1))
    for x in range(background.shape[1]):
        if left - radius // 2 < x < right + radius // 2:
            continue
        column = lit[:, x]
        if not column.any() or column[-1]:
            continue
        edge = int(np.flatnonzero(column)[-1])
        if edge < 12 or edge > height - 6:
            continue
        above = float(np.median(background[max(edge - 14, 0) : edge - 4, x]))
        below = float(np.median(background[edge + 5 : edge + 15, x])) if edge + 8 < height else np.nan
        if not np.isfinite(below):
            continue
        profile = (smooth[edge - 4 : edge + 6, x] - below) / (above - below)
        fall = np.flatnonzero((profile[:-1] >= 0.5) & (profile[1:] < 0.5))
        if fall.size == 0:
            continue
        k = int(fall[0])
        xs.append(x)
        ys.append(edge - 4 + k + (profile[k] - 0.5) / (profile[k] - profile[k + 1]))
    if len(xs) < 12:
        return None, 0.0
    x, y = np.array(xs, float), np.array(ys)
    keep = np.ones(len(x), bool)
    for _ in range(4):
        slope, offset = np.polyfit(x[keep], y[keep], 1)
        misfit = y - slope * x - offset
        keep = np.abs(misfit - np.median(misfit)) < 3.5 * max(1.4826 * np.median(np.abs(misfit)), 0.05)
    roughness = float(np.std(misfit[keep]))
    if roughness > ROUGHEST_SURFACE:
        return None, 0.0
    # neighbouring columns share the lumps of the surface: about one independent value per ten columns
    sigma = max(roughness / np.sqrt(max(keep.sum() / 10.0, 1.0)), 0.02)
    return (float(offset), float(slope)), sigma
