"""Frames that are missing, or there twice, though numbers or stamps do not say so: seen by the motion itself."""

from __future__ import annotations

import numpy as np

from ...records import FloatArray
from ..track_file import measure_scatter
from .choosing import Choice, choose_motion
from .outliers import OUTLIER, guess_spikes
from .variable_projection import fit_motion

BESIDE = 3  # steps on either side that say how far the projectile goes in one frame
LEAST_STEP = 17.0  # error bars per frame: below, a missing frame cannot be told from noise
MOST_WEIGHED = 4
MOST_MISSING = 8
MOST_PLACES = 80  # places tried
RUN = 3  # outliers side by side that make one ask for the clock, at least
BY_CHANCE = 0.01  # runs of outliers in a track that are spikes side by side, at most
AROUND = 8  # frames on either side that say whether the projectile moves at a repeated row
CLEAR = 6.0  # error bars per frame: it moves
LEAST_MOTION = 0.5  # px per frame: it moves, where rows are rounded


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


def find_repeats(number: np.ndarray, row: FloatArray, sigma: FloatArray) -> np.ndarray:
    """Rows that repeat the one before to the last digit while the projectile moves, (n,) bool: noise never repeats.

    number, row, sigma : (n,) of the frames with a position. The error bar is the larger of the stated and of the rows' own
    scatter (whole pixels, say).
    """
    repeated = np.zeros(row.size, bool)
    if row.size < 2 * AROUND + 1:
        return repeated
    scatter = measure_scatter(number.astype(float), row)
    noise = max(float(np.median(sigma)), scatter if np.isfinite(scatter) else 0.0)
    step = np.abs(np.diff(row))
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(step, AROUND, mode="edge"), 2 * AROUND + 1)
    around = np.quantile(windows, 0.3, axis=1)  # a few repeats do not hide the motion
    repeated[1:] = (step == 0) & (np.diff(number) == 1) & (around > max(CLEAR * noise, LEAST_MOTION))
    return repeated


def propose_moves(
    time: FloatArray, row: FloatArray, sigma: FloatArray, repeated: np.ndarray
) -> list[FloatArray]:
    """By how much (s, (n,)) the times may have to be moved: first not at all; the motion has to choose.

    time, row, sigma, repeated : (n,) of the frames with a position. Then the gaps that the projectile's own steps show,
    and the same with every repeated picture put in, not put in place of the next one.
    """
    spacing = float(np.median(np.diff(time)))
    # a step to a spike is none of the projectile's
    rows = np.where(repeated | guess_spikes(row, sigma), np.nan, row)
    missing, doubled = np.zeros(row.size), np.zeros(row.size)
    for index, count in find_gaps((time - time[0]) / spacing, rows, sigma, repeated):
        (missing if count > 0 else doubled)[index:] += count
    found: list[FloatArray] = [np.zeros(row.size)]
    for moved in (missing + doubled, missing - np.cumsum(repeated)):
        if not any(np.array_equal(moved * spacing, other) for other in found):
            found.append(moved * spacing)
    return found


def describe_moves(number: np.ndarray, moved: FloatArray, repeated: np.ndarray) -> list[str]:
    """What is said of frames that the clock hides, and of doubled pictures; number, moved (frames), repeated : (n,)."""
    said = []
    step = np.diff(moved, prepend=0.0)
    for place in np.flatnonzero(step > 0):
        lost = round(step[place])
        said.append(
            f"{lost} frame{'s are' if lost > 1 else ' is'} missing before frame {number[place]}, though the frame "
            "numbers go on (rows before and after disagree with one clock), or the camera jumped: later times were moved"
        )
    if repeated.any():
        back = -round(step[step < 0].sum())
        then = f"put in, and later times were moved back by {back}" if back else "put in place of others"
        numbers = [int(each) for each in number[repeated]]
        said.append(
            f"frame{'s' * (len(numbers) > 1)} {list_numbers(numbers)} repeat{'s' * (len(numbers) == 1)} the row before to the "
            f"last digit while the projectile moves: doubled pictures, left out; they were {then}"
        )
    return said


def list_numbers(numbers: list[int], most: int = 8) -> str:
    """3, 7-12, 40 … for people."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    shown = ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in runs[:most])
    return shown + (" …" if len(runs) > most else "")


def find_lost_frames(
    time: FloatArray, depth: FloatArray, error: FloatArray, start: tuple[float, float], choice: Choice
) -> tuple[int, int, Choice] | None:
    """(index of the first frame after a gap that the clock hides, frames lost there, the motion with the clock put right).

    time (s), depth, error (m): (n,) as they were fitted from ``start`` to ``choice``. Asked where more outliers lie side
    by side than chance brings, or the rows scatter more than they say: then every place about them is tried with one frame
    more, with two, up to MOST_MISSING. Of the MOST_WEIGHED counts that a simple motion likes best motions that rest choose
    one; it is taken if it gains what an outlier costs and what so many trials bring by chance. None otherwise.
    """
    best = choice.best
    out = np.flatnonzero(~best.used)
    # where many rows are spikes, some lie side by side by chance: so many do not
    share = max(out.size, 1) / len(time)
    many = max(RUN, int(np.ceil(np.log(BY_CHANCE / len(time)) / np.log(share))))
    ends = out[many - 1 :]
    run = out[: ends.size][ends - out[: ends.size] == many - 1]
    scatter = best.motion.chi_square > best.motion.freedom + 3.0 * np.sqrt(2.0 * max(best.motion.freedom, 1))
    if not run.size and not scatter:
        return None
    spacing = float(np.median(np.diff(time)))
    within = np.flatnonzero((time > start[0] - 10 * spacing) & (time < start[1]))
    first, last = (run[0], run[-1] + many) if run.size else (within[0], within[-1])
    places = np.arange(max(first - 3, 3), min(last + 4, len(time) - 3))
    if len(places) > MOST_PLACES:
        places = np.unique(np.linspace(places[0], places[-1], MOST_PLACES).astype(int))
    keep = ~guess_spikes(depth, error)
    # of so many frames: χ², place, times and first guess of the best simple motion
    rough: dict[int, tuple[float, int, FloatArray, tuple[float, float]]] = {}
    for lost in range(1, MOST_MISSING + 1):
        late = lost * spacing
        for place in places:
            moved = time + late * (np.arange(len(time)) >= place)
            begin = start[0] + late * (start[0] >= time[place]), start[1] + late * (start[1] >= time[place])
            motion = fit_motion(moved[keep], depth[keep], error[keep], 4, "rest", begin)
            if motion is not None and motion.chi_square < rough.get(lost, (np.inf,))[0]:
                rough[lost] = motion.chi_square, int(place), moved, begin
    # a simple motion miscounts: the nearest counts are weighed with motions that rest, the best of them with all
    weighed: list[tuple[float, int]] = []
    for lost in sorted(rough, key=lambda lost: rough[lost][0])[:MOST_WEIGHED]:
        _, _, moved, begin = rough[lost]
        resting = choose_motion(moved, depth, error, begin, ("rest",))
        if resting is not None:
            weighed.append((resting.best.judge(1.0), lost))
    if not weighed:
        return None
    lost = min(weighed)[1]
    _, place, moved, begin = rough[lost]
    better = choose_motion(moved, depth, error, begin)
    assert better is not None
    chance = OUTLIER**2 + 2.0 * np.log(len(places) * lost)
    # what is gained counts by the scatter that is left: rows of whole pixels scatter alike with any clock
    noise = max(1.0, better.best.motion.chi_square / max(better.best.motion.freedom, 1))
    if better.best.judge(noise) > best.judge(noise) - chance:
        return None
    return place, lost, better
