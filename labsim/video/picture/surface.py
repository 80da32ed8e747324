"""The surface of the dust beside the projectile's path."""

from __future__ import annotations

import cv2
import numpy as np

from ...records import FloatArray

ROUGHEST_SURFACE = 3.0  # px rms about a straight line; beyond, it is a carpet or a picture, not raked dust
LEAST_SIGMA = 0.02  # px: a surface as flat as that has an edge of its own


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
    across, y = np.array(xs, dtype=float), np.array(ys, dtype=float)
    keep = np.ones(across.shape, dtype=bool)
    for _ in range(4):
        slope, offset = np.polyfit(across[keep], y[keep], 1)
        misfit = y - slope * across - offset
        keep = np.abs(misfit - np.median(misfit)) < 3.5 * max(1.4826 * np.median(np.abs(misfit)), 0.05)
    if float(np.std(misfit[keep])) > ROUGHEST_SURFACE:
        return None, 0.0
    sigma = _doubt_line(across[keep], misfit[keep], (left, right))
    return (float(offset), float(slope)), max(sigma, LEAST_SIGMA)


def _doubt_line(x: FloatArray, misfit: FloatArray, path: tuple[int, int]) -> float:
    """Standard error of the surface's row under the projectile, from the misfits (n,) of a straight line beside its ``path``.

    A lump of the surface is as long as 1 + 2 Σ ρ columns (ρ: correlation of two columns by their distance, up to where it
    is gone); there are as many independent heights as lumps, and the line has taken two of them. The dust in the path has
    lumps of its own.
    """
    left = np.zeros(int(x.max() - x.min()) + 1)
    seen = np.zeros_like(left)
    place = (x - x.min()).astype(int)
    left[place], seen[place] = misfit - misfit.mean(), 1.0
    variance = float(np.mean(left[place] ** 2))
    long = 1.0
    for lag in range(1, len(left) // 2):
        pairs = float(np.sum(seen[lag:] * seen[:-lag]))
        shared = float(np.sum(left[lag:] * left[:-lag])) / max(pairs, 1.0)
        if pairs < 8 or shared <= 0.0:
            break
        long += 2.0 * shared / variance
    lumps = max(len(x) / long, 3.0)
    away = 0.5 * (path[0] + path[1]) - x.mean()
    lever = 1.0 + away**2 / np.mean((x - x.mean()) ** 2)
    own = min(long / (path[1] - path[0] + 1), 1.0)
    return float(np.sqrt(variance * (lever / (lumps - 2.0) + own)))
