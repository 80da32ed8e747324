"""What the rows of one track contradict: frames that are missing, left out, or after a jump.

Rows follow one motion: free fall, a deceleration, rest or a small rebound. They cannot jump (a projectile has no infinite
speed). The curve's fit says which frames it stands on, and finds doubled pictures, frames that were lost and second impacts by
itself (``video/motion/curve.py``); here the rows are looked at on its clock, so that none of them is found again as another
fault.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ..records import DecelerationCurve, FloatArray, Track
from ..video.motion.gaps import find_repeats, list_numbers
from ..video.track_file import measure_scatter

CONSECUTIVE = 3  # frames in a row that are worth a word
MANY_LEFT_OUT = 0.05  # of the fitted frames; honest tracks have one spike in a hundred frames
SIDE = 8  # frames on either side of a jump that is tested
CLEAR = 6.0  # standard deviations of a jump: hundreds of places are tried, 4 is the most in an honest track
LEAST_JUMP = 0.5  # px
STRAY = 6.0  # standard deviations from the neighbours
MEDIAN = 7  # frames of the running median: spikes of three frames and less are none of the motion


def judge_frames(track: Track, curve: DecelerationCurve) -> list[str]:
    """What is odd in the frames of a track, one line each."""
    assert curve.used is not None and curve.residual is not None
    clock = track.time if curve.clock is None else curve.clock
    good = np.flatnonzero(track.valid & np.isfinite(track.tip_row))
    said = _judge_gaps(track.frame[good], clock[good], curve) + _judge_left_out(track, curve)
    good = good[~find_repeats(track.frame[good], track.tip_row[good], track.sigma[good])]
    frame, time, row = track.frame[good], clock[good], track.tip_row[good]
    noise = float(np.median(track.sigma[good]))
    if np.isfinite(scatter := measure_scatter(time, row)):
        noise = max(noise, scatter)  # whole pixels, say
    keep = ~_find_spikes(row, curve.residual[good], noise) & (time <= time[curve.used[good]].max())
    return said + _judge_jumps(frame[keep], time[keep], row[keep], noise, curve)


def count_missing(track: Track) -> int:
    """Frames between the first and the last that have no position."""
    seen = track.frame[track.valid & np.isfinite(track.tip_row)]
    return int(seen[-1] - seen[0] + 1 - seen.size) if seen.size else track.frame.size


def _find_stop(curve: DecelerationCurve) -> float:
    stop = curve.contact_time.value + curve.stopping_time.value
    return stop if np.isfinite(stop) else np.inf


def _judge_gaps(frame: np.ndarray, time: FloatArray, curve: DecelerationCurve) -> list[str]:
    """Runs of frames without a position, up to the stop."""
    said = []
    contact = curve.contact_time.value
    for k in np.flatnonzero(np.diff(frame) > CONSECUTIVE):
        if time[k] >= _find_stop(curve):
            continue
        span = f"{int(np.diff(frame)[k] - 1)} frames ({frame[k] + 1}-{frame[k + 1] - 1})"
        if time[k] < contact < time[k + 1]:
            said.append(
                f"{span} are missing about contact: contact and the first deceleration are bridged by the fit"
            )
        elif time[k] >= contact:
            said.append(
                f"{span} are missing while the projectile is stopped: depth and stopping time lean on the fit"
            )
        else:
            said.append(f"{span} are missing in free fall")
    return said


def _judge_left_out(track: Track, curve: DecelerationCurve) -> list[str]:
    """Frames with a position that the fit does not stand on."""
    if curve.used is None or curve.residual is None:
        return []
    left_out = track.valid & ~curve.used & np.isfinite(curve.residual)
    numbers = [int(number) for number in track.frame[left_out]]
    at = np.flatnonzero(left_out[track.valid])
    consecutive = max((run.size for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)), default=0)
    fitted = int(curve.used.sum())
    if consecutive < CONSECUTIVE and len(numbers) <= MANY_LEFT_OUT * fitted:
        return []
    many = f", {consecutive} of them in a row" if consecutive >= CONSECUTIVE else ""
    return [
        f"{len(numbers)} of {len(numbers) + fitted} frames are left out of the fit as outliers{many} "
        f"(frames {list_numbers(numbers)}): look at these frames"
    ]


def _find_spikes(row: FloatArray, residual: FloatArray, noise: float) -> np.ndarray:
    """Rows far from the running median of the fit's residuals, (n,) bool; the two sides of a jump are none.

    Beyond the fit the projectile rests, and the rows themselves stand for their residuals.
    """
    left = np.where(np.isfinite(residual), residual, row)
    spikes = np.zeros(row.size, bool)
    for part in (np.isfinite(residual), ~np.isfinite(residual)):
        if part.any():
            spikes[part] = (
                np.abs(left[part] - median_filter(left[part], MEDIAN, mode="nearest")) > STRAY * noise
            )
    return spikes


def _judge_jumps(
    frame: np.ndarray,
    clock: FloatArray,
    row: FloatArray,
    noise: float,
    curve: DecelerationCurve,
) -> list[str]:
    """Steps of the row that no smooth motion makes, the clearest of each place."""
    if row.size < 2 * SIDE + 4:
        return []
    tick = float(np.median(np.diff(clock) / np.diff(frame)))
    jumps, clear = _measure_jumps(
        clock / tick, row, noise, curve.contact_time.value / tick, _find_stop(curve) / tick
    )
    said: list[str] = []
    while clear.max() > CLEAR and len(said) < 3:
        k = int(np.argmax(clear))
        near = slice(max(k - SIDE, 0), k + SIDE)
        step = float(np.median(np.diff(row)[near] / np.diff(frame)[near]))
        count = abs(jumps[k]) / step if step > 0 else 0.0
        why = "the camera or the projectile jumped"
        if abs(count - round(count)) < 0.25 and 1 <= round(count) < 100:
            lost = "lost" if jumps[k] > 0 else "doubled"
            why = f"as if {round(count)} frame{'s were' if round(count) > 1 else ' was'} {lost}, or {why}"
        said.append(
            f"the row jumps by {jumps[k]:+.1f} px between frames {frame[k]} and {frame[k + 1]}: {why}"
        )
        clear[max(k - 2 * SIDE, 0) : k + 2 * SIDE + 1] = 0.0
    return said


def _measure_jumps(
    frame: FloatArray, row: FloatArray, noise: float, contact: float, stop: float
) -> tuple[FloatArray, FloatArray]:
    """Height of a step after each row, (n - 1,) px, and how many standard deviations that is; 0 where nothing is tried.

    SIDE rows on either side are fitted by one cubic, by a parabola and a cubic where contact lies between them, with a step.
    """
    jumps, clear = np.zeros(row.size - 1), np.zeros(row.size - 1)
    for k in range(3, row.size - 4):
        near = slice(max(k - SIDE + 1, 0), k + SIDE + 1)
        x = (frame[near] - frame[k] - 0.5) / SIDE
        columns = [np.ones_like(x), x, x**2, np.where(x > 0, 1.0, 0.0)]
        at = (contact - frame[k] - 0.5) / SIDE
        late = np.maximum(x - max(at, -2.0), 0.0)
        if at < x[-1]:
            columns += [late**2, late**3] if at > x[0] else [x**3]
        at = (stop - frame[k] - 0.5) / SIDE
        if x[0] < at < x[-1]:
            columns.append(np.maximum(x - at, 0.0) ** 2)
        design = np.stack(columns, axis=1)
        if x.size < design.shape[1] + 4:
            continue
        inverse = np.linalg.pinv(design)
        best = inverse @ row[near]
        left = row[near] - design @ best
        scatter = max(noise, float(np.sqrt(np.sum(left**2) / (x.size - design.shape[1]))))
        jumps[k] = best[3]
        if abs(best[3]) > LEAST_JUMP:
            clear[k] = abs(best[3]) / (scatter * float(np.linalg.norm(inverse[3])))
    return jumps, clear
