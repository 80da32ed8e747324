"""The camera's noise, measured from the video itself."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ...records import FloatArray


@dataclass(frozen=True)
class Noise:
    """Variance of a pixel = read² + gain · level, in grey levels; both include quantisation."""

    read_variance: float
    gain: float

    def variance(self, level: FloatArray) -> FloatArray:
        return np.maximum(self.read_variance + self.gain * np.maximum(level, 0.0), 1.0 / 12.0)


def measure_noise(sparse: FloatArray, ceiling: float = np.inf) -> Noise:
    """Mean-variance line from the differences of neighbouring frames; medians, so that what moves does not count.

    sparse : (frames, rows, columns), grey levels of some pixels at brightness 1. Pixels within 2 % of the ``ceiling``
    do not count: clipping takes their noise away.
    """
    n = len(sparse)
    difference = np.diff(sparse, axis=0).reshape(n - 1, -1)
    level = 0.5 * (sparse[1:] + sparse[:-1]).reshape(n - 1, -1)
    still = ~np.all(difference == 0, axis=1)  # repeated frames say nothing
    difference, level = difference[still], level[still]
    if len(difference) < 4:
        return Noise(1.0 / 12.0, 0.0)
    open_to_noise = np.median(level, axis=0) < 0.98 * ceiling
    if open_to_noise.sum() >= 60:
        difference, level = difference[:, open_to_noise], level[:, open_to_noise]
    # per pixel: clipped mean square, since medians of whole numbers are coarse
    centre = np.median(difference, axis=0)
    spread = np.maximum(1.4826 * np.median(np.abs(difference - centre), axis=0), 0.75)
    inside = np.abs(difference - centre) < 4.0 * spread
    square = np.sum(np.where(inside, (difference - centre) ** 2, 0.0), axis=0) / np.maximum(
        inside.sum(axis=0), 1
    )
    variance = 0.5 * square
    mean = np.median(level, axis=0)
    edges = np.quantile(mean, np.linspace(0, 1, 13))
    points = []
    for a, b in itertools.pairwise(edges):
        inside_bin = (mean >= a) & (mean <= b)
        if inside_bin.sum() >= 20 and b > a:
            points.append((np.mean(mean[inside_bin]), np.median(variance[inside_bin])))
    if len(points) < 3 or np.ptp([p[0] for p in points]) < 5:
        return Noise(max(float(np.median(variance)), 1.0 / 12.0), 0.0)
    x, y = np.array(points).T
    gain, read = np.polyfit(x, y, 1, w=1.0 / np.maximum(y, 1.0 / 12.0))
    if gain < 0 or read < 0:
        gain, read = (
            (0.0, float(np.median(y))) if gain < 0 else (float(np.sum(x * y) / np.sum(x * x)), 1.0 / 12.0)
        )
    return Noise(float(max(read, 1.0 / 12.0)), float(gain))
