"""Whether the dust stands still in the picture: a camera that shakes or a stand that sinks moves its surface along.

The surface beside the path is cut into blocks of columns. Each block is compared with its own mean picture, moved up or down
by d: I = a B(y - d) + c, with a and c free so that light that changes is no motion. What moves as a whole moves all blocks alike;
spray, a crater's rim and compression do not.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ...records import FloatArray
from ..frames import Frames
from .scene import Scene

HALF = 9  # px above and below the surface that are compared
REACH = 6  # px, the largest shift that is looked for
LEAST_COLUMNS = 8
MOST_COLUMNS = 100  # beyond, every second or third is taken: their information is more than enough
TOGETHER = 4.0  # times what the blocks do apart; flying dust and H.264 reach 3
LEAST_SEEN = 0.03  # px rms
LEAST_CORRECTED = (
    0.1  # px rms; noise in whole rows and focus that drifts make 0.03 to 0.06, which the rod does not share
)
MOST_CHANGED = (
    2.0  # times the misfit before contact: dust that only moves looks as before, flying dust does not
)
MOST_PASSES = 6
CHUNK = 500  # frames that are taken as floating numbers at a time


@dataclass(frozen=True)
class Movement:
    """How much lower the dust lies in each frame than before contact, (n,) px, and its error bar.

    before : (n,) whether the tip still stands clear of the dust; surface : row of the dust's surface before contact.
    """

    shift: FloatArray
    sigma: FloatArray
    before: np.ndarray
    surface: float

    @property
    def size(self) -> float:
        return float(np.std(self.shift))

    @property
    def mean(self) -> float:
        """Of all frames: how much lower the surface of the mean picture lies than before contact."""
        return float(np.mean(self.shift))

    def choose(self, row: FloatArray) -> FloatArray:
        """What is to be taken off the rows, (n,): all of it where the camera moves, none before contact where the dust does.

        A projectile in free flight shakes in the picture only if the camera does. row : (n,) of the tip, NaN where unknown.
        """
        seen = np.where(self.before, row, np.nan)
        if _scatter(seen - self.shift) <= _scatter(seen):
            return self.shift
        known = np.flatnonzero(np.isfinite(seen))
        last = known[-1]
        speed = float(np.median(np.diff(row[known[-6:]]) / np.diff(known[-6:])))
        contact = last + (self.surface - row[last]) / max(speed, 1e-6)
        return np.where(np.arange(len(row)) < contact, 0.0, self.shift)


def follow_surface(
    frames: Frames, scene: Scene, before: np.ndarray, surface: float | None
) -> Movement | None:
    """Movement of the dust's surface; None where it stands still, or does not move as a whole, or cannot be seen.

    before : (n,) whether the tip still stands clear of the dust; surface : row that is stated, None where the picture says it.
    """
    blocks = _cut_blocks(scene)
    if len(blocks) < 2 or before.sum() < 4:
        return None
    rows, columns = _place_pixels(scene, blocks)
    stack = np.stack([picture[rows, columns] for picture in frames])  # (n, 2 HALF + 1, columns)
    mean = stack.mean(axis=0, dtype=float)
    variance = scene.noise.variance(mean)
    edges = np.cumsum([0, *(len(b) for b in blocks)])
    parts = [slice(a, b) for a, b in itertools.pairwise(edges)]
    rough = [_judge_once(stack[:, :, p], mean[:, p], variance[:, p]) for p in parts]
    if not _move_together(np.array([r[0] for r in rough]), rough[0][1]):
        return None
    aligned = [_align(stack[:, :, p], variance[:, p]) for p in parts]
    shifts = np.array([f[0] - np.median(f[0][before]) for f in aligned])
    error = float(np.median([f[1] for f in aligned]))
    left = np.median([f[2] for f in aligned], axis=0)
    moved = np.abs(np.median(shifts, axis=0)) > LEAST_CORRECTED
    changed = np.median(left[moved]) > MOST_CHANGED * np.median(left[before]) if moved.any() else False
    if changed or not _move_together(shifts, error):
        return None
    together = np.median(shifts, axis=0)
    together -= np.mean(together[before])
    apart = 1.4826 * np.median(np.abs(shifts - np.median(shifts, axis=0)), axis=0)
    # a median of blocks is 1.25 times less certain than their mean
    sigma = 1.25 * np.maximum(error, apart) / np.sqrt(len(shifts))
    if surface is None:
        found = scene.surface_row(0.5 * sum(scene.corridor))
        assert found is not None  # the blocks lie on it
        surface = found.value - float(np.mean(together))
    return Movement(together, sigma, before, surface)


def describe_movement(movement: Movement) -> str:
    """The warning."""
    size = float(np.ptp(movement.shift))
    if movement.size < LEAST_CORRECTED:
        return (
            f"the dust's surface seems to move by {size:.2f} px during the record: too little to tell a camera or stand that "
            "moves from light, focus or noise that changes; rows are as seen, and may err by as much"
        )
    return (
        f"the dust's surface moves by {size:.2f} px during the record (camera or stand): rows are measured against it, with its "
        "error bar; fix both"
    )


def _cut_blocks(scene: Scene) -> list[np.ndarray]:
    """Columns of the blocks, at least a quarter of the path's width away from it."""
    if scene.surface is None:
        return []
    first, last = scene.corridor
    margin = max(6, (last - first) // 4)
    blocks = []
    for side in (np.arange(0, first - margin), np.arange(last + margin + 1, scene.background.shape[1])):
        side = side[:: max(1, 2 * len(side) // MOST_COLUMNS)]
        pieces = min(3, len(side) // LEAST_COLUMNS)
        if pieces:
            blocks += np.array_split(side, pieces)
    return blocks


def _place_pixels(scene: Scene, blocks: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    assert scene.surface is not None
    columns = np.concatenate(blocks)
    middle = np.round(scene.surface[0] + scene.surface[1] * columns).astype(int)
    rows = middle[None, :] + np.arange(-HALF, HALF + 1)[:, None]
    return np.clip(rows, 0, scene.background.shape[0] - 1), np.broadcast_to(columns, rows.shape)


def _judge_once(stack: np.ndarray, mean: FloatArray, variance: FloatArray) -> tuple[FloatArray, float]:
    """Shift of one block in every frame to first order, and its standard error."""
    parts = np.stack([-np.gradient(mean, axis=0), mean, np.ones_like(mean)]).reshape(3, -1)
    inverse = np.linalg.pinv((parts / variance.ravel()) @ parts.T)
    influence = (inverse @ (parts / variance.ravel()))[0].astype(np.float32)
    shift = [
        stack[k : k + CHUNK].reshape(-1, influence.size).astype(np.float32) @ influence
        for k in range(0, len(stack), CHUNK)
    ]
    return np.concatenate(shift).astype(float), float(np.sqrt(max(inverse[0, 0], 0.0)))


def _align(stack: np.ndarray, variance: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Shift of one block in every frame against the mean of its frames, each moved back by its own shift; its error; and
    the mean square of what is left in every frame, in units of the noise."""
    rows = np.arange(stack.shape[1], dtype=float)
    inside = slice(REACH // 2, stack.shape[1] - REACH // 2)
    weight = 1.0 / variance[inside].ravel()
    shift, left = np.zeros(len(stack)), np.ones(len(stack))
    inverse = np.eye(3)
    for _ in range(MOST_PASSES):
        known = shift.copy()
        total = np.zeros(stack.shape[1:])
        for picture, d in zip(stack, shift, strict=True):
            total += CubicSpline(rows, picture)(np.clip(rows + d, 0, rows[-1]))
        model = CubicSpline(rows, total / len(stack))
        for first in range(0, len(stack), CHUNK):
            part = slice(first, first + CHUNK)
            image = stack[part, inside].reshape(-1, weight.size).astype(float)
            for _ in range(12):
                place = np.clip(rows[inside] - shift[part, None], 0, rows[-1])
                value, slope = (model(place, n).reshape(len(image), -1) for n in (0, 1))
                design = np.stack([-slope, value, np.ones_like(value)], axis=1)  # (n, 3, pixels)
                inverse = np.linalg.pinv((design * weight) @ design.transpose(0, 2, 1))
                score = design @ (weight * (image - value))[:, :, None]
                solved = inverse @ score
                gained = np.sum(solved * score, axis=(1, 2))
                left[part] = (np.sum(weight * (image - value) ** 2, axis=1) - gained) / weight.size
                step = np.clip(solved[:, 0, 0], -1.0, 1.0)
                shift[part] = np.clip(shift[part] + step, -REACH, REACH)
                if np.abs(step).max() < 1e-3:
                    break
        shift -= np.mean(shift)
        if np.abs(shift - known).max() < 0.01:
            break
    return shift, float(np.sqrt(max(np.median(inverse[:, 0, 0]), 0.0))), left


def _move_together(shifts: FloatArray, error: float) -> bool:
    """Whether the blocks (b, n) move together, by more than their noise and more than they move apart."""
    centred = shifts - np.median(shifts, axis=1, keepdims=True)
    together = np.median(centred, axis=0)
    apart = float(np.sqrt(np.mean((centred - together) ** 2) / len(shifts)))
    size = float(np.sqrt(np.mean(together**2)))
    return size > max(LEAST_SEEN, TOGETHER * apart, 2.0 * error / np.sqrt(len(shifts)))


def _scatter(row: FloatArray) -> float:
    """Median size of the third differences: blind to position, speed and acceleration."""
    third = np.diff(row, 3)
    return float(np.nanmedian(np.abs(third))) if np.isfinite(third).sum() > 4 else 0.0
