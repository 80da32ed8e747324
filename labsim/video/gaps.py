"""Frames that are missing, or there twice, in a file that has neither numbers nor stamps: seen by the motion itself."""

from __future__ import annotations

import numpy as np

from ..records import FloatArray

BESIDE = 3  # steps on either side that say how far the projectile goes in one frame
LEAST_STEP = 17.0  # error bars per frame: below, a missing frame cannot be told from noise
MOST_MISSING = 8


def find_gaps(
    number: np.ndarray, row: FloatArray, sigma: FloatArray, repeated: np.ndarray
) -> list[tuple[int, int]]:
    """Where the clock jumped: [(index of the first picture after it, frames missing there), ...].

    number, row, sigma, repeated : (n,) as in the file, row NaN where unknown. A picture in which the projectile has come
    k + 1 times as far as in the frames around it, k whole to within a quarter, follows k missing frames; -1 says that
    a repeated picture was put in rather than put in place of the next one. What stands still tells nothing; nor does a
    change of speed by more than 40 % within the frames around (an impact on something hard).
    """
    at = np.flatnonzero(np.isfinite(row))
    if len(at) < 2 * BESIDE + 2:
        return []
    frames = np.diff(number[at])
    step = np.diff(row[at]) / frames
    noise = np.hypot(sigma[at][1:], sigma[at][:-1])
    found = []
    for k in range(BESIDE, len(step) - BESIDE):
        before, after = np.median(step[k - BESIDE : k]), np.median(step[k + 1 : k + 1 + BESIDE])
        usual = 0.5 * (before + after)
        if min(before, after) < 0.6 * max(before, after) or usual < LEAST_STEP * noise[k]:
            continue
        missing = step[k] * frames[k] / usual - frames[k]
        whole = round(missing)
        if whole == 0 or whole > MOST_MISSING or abs(missing - whole) > 0.25:
            continue
        between = repeated[at[k] + 1 : at[k + 1] + 1]
        if whole < 0 and -whole > int(np.sum(between)):
            continue
        found.append((int(at[k + 1]), whole))
    return found
