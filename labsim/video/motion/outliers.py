"""Frames that do not belong to a fall: what the fitted motion cannot explain, judged anew after every fit.

No frame is judged by its neighbours alone: a projectile that stops within a few frames looks like an outlier to any straight
line or parabola through them. The running median only gives the first guess: it leaves rows that grow as they are, however
hard they bend.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from ...records import FloatArray
from .segments import Ending, Motion
from .variable_projection import fit_motion

OUTLIER = 5.0  # standard deviations; a frame left out costs a fit OUTLIER² of χ²
RANGE = 5  # frames of the running median
GROSS = 8.0  # standard deviations off the running median for the first guess
ROUNDS = 12


def follow_median(row: FloatArray) -> FloatArray:
    """Running median over RANGE frames: up to two spikes in five frames go, rows that only grow stay, but at both ends."""
    return np.asarray(median_filter(row, RANGE, mode="reflect"))


def guess_spikes(row: FloatArray, sigma: FloatArray) -> np.ndarray:
    """Frames far off the running median, farther than their neighbours: where the first fit begins without, (n,) bool."""
    off = np.abs(row - follow_median(row)) / sigma
    off[:2] = off[-2:] = 0.0
    beside = np.maximum(np.append(off[1:], 0.0), np.insert(off[:-1], 0, 0.0))
    return (off > GROSS) & (off >= beside)


def judge_frames(
    motion: Motion, time: FloatArray, depth: FloatArray, error: FloatArray, used: np.ndarray
) -> np.ndarray:
    """Frames that the motion explains to OUTLIER standard deviations, (n,) bool.

    A frame in the fit is judged by what the fit would say of it without it (its deleted residual), one outside by its
    prediction; both hold the uncertainty of the motion there. Of those that go, only the worst within two frames goes at a
    time: a spike bends the fit beside it.
    """
    slope = motion.differentiate(time)
    known = np.einsum("ni,ij,nj->n", slope, motion.covariance, slope) / error**2
    misfit = np.clip(
        (depth - motion.evaluate(time)[0]) / error, -1e9, 1e9
    )  # a fit that ran off has no bounds
    spread = max(1.0, 1.4826 * float(np.median(np.abs(misfit[used]))))
    free = np.where(used, np.clip(1.0 - known, 0.05, 1.0), 1.0 + known)
    score = misfit**2 / (free * spread**2)
    worst = _find_worst_near(np.where(used, score, 0.0))
    return np.where(used, (score < OUTLIER**2) | (score < worst), score < OUTLIER**2)


def _find_worst_near(score: FloatArray) -> FloatArray:
    """Largest score within two frames on either side, (n,)."""
    padded = np.pad(score, 2)
    return np.max([padded[k : k + len(score)] for k in range(5)], axis=0)


def fit_without_outliers(
    time: FloatArray,
    depth: FloatArray,
    error: FloatArray,
    degree: int,
    ending: Ending,
    start: Sequence[float],
    used: np.ndarray,
) -> tuple[Motion, np.ndarray] | None:
    """One model fitted, its outliers dropped and taken back until they stand still: (motion, frames that it was fitted to).

    Where they do not within ROUNDS, as of a model that loses its frames one by one, the last fit stands with the frames it had.
    """
    seen: list[np.ndarray] = []
    motion: Motion | None = None
    for _ in range(ROUNDS):
        fitted = used
        motion = fit_motion(time[used], depth[used], error[used], degree, ending, start)
        if motion is None:
            return None
        renewed = judge_frames(motion, time, depth, error, used)
        if np.array_equal(renewed, used) or any(np.array_equal(renewed, old) for old in seen):
            break
        if np.sum(renewed) < max(8, 0.5 * len(time)):
            return None
        seen.append(used)
        used, start = renewed, tuple(motion.ends)
    assert motion is not None
    return motion, fitted
