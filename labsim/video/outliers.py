"""Frames of a track that do not belong to its motion, found before any motion is fitted."""

from __future__ import annotations

import numpy as np

from ..records import FloatArray


def drop_isolated(time: FloatArray, row: FloatArray, sigma: FloatArray) -> np.ndarray:
    """Frames that agree with their neighbours; the worst is dropped first, one at a time, at most a fifth of them."""
    keep = np.ones(len(row), bool)
    while np.sum(keep) > 12 and np.sum(~keep) <= 0.2 * len(row):
        index = np.flatnonzero(keep)
        deviation = _deviate_robustly(time[index], row[index])
        noise = np.maximum(sigma[index], 1.4826 * np.median(np.abs(deviation)))
        score = np.abs(deviation) / noise
        worst = int(np.argmax(score))
        if score[worst] < 8.0:
            break
        keep[index[worst]] = False
    return keep


def _deviate_robustly(time: FloatArray, row: FloatArray) -> FloatArray:
    """Each row minus the median of straight lines through seven pairs of its neighbours, which one spike cannot move."""
    n = len(row)
    guesses = np.full((7, n), np.nan)
    for k, (first, second) in enumerate(((-1, 1), (-2, 2), (-2, -1), (1, 2), (-3, -2), (2, 3), (-3, 3))):
        i = np.arange(max(0, -first), min(n, n - second))
        i = i[(i + first >= 0) & (i + second < n)]
        t1, t2, r1, r2 = time[i + first], time[i + second], row[i + first], row[i + second]
        guesses[k, i] = r1 + (r2 - r1) * (time[i] - t1) / (t2 - t1)
    return row - np.nanmedian(guesses, axis=0)
