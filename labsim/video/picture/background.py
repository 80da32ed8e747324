"""The picture behind the projectile: its mean, what fills the places that were never free, pixels that respond."""

from __future__ import annotations

import cv2
import numpy as np

from ...records import FloatArray
from ..frames import Frames
from .surface import find_corridor


def average_background(
    frames: Frames,
    brightness: FloatArray,
    low: FloatArray,
    high: FloatArray,
    swept: np.ndarray,
    dark: bool,
    left_out: np.ndarray,
) -> tuple[FloatArray, np.ndarray]:
    """Mean of each pixel over the frames in which the projectile and its blurred edge are well away from it.

    left_out : (n,) frames that do not count.
    """
    every = max(1, len(brightness) // 300)
    halfway = 0.5 * (low + high)
    total = np.zeros(frames.shape, np.float64)
    count = np.zeros(frames.shape, np.int32)
    kernel = np.ones((9, 9), np.uint8)
    for i, picture in enumerate(frames):
        if i % every or left_out[i]:
            continue
        level = picture.astype(np.float32) / np.float32(brightness[i])
        blurred = cv2.blur(picture, (3, 3)).astype(np.float32) / np.float32(brightness[i])
        covered = ((blurred < halfway) if dark else (blurred > halfway)) & swept
        clear = cv2.dilate(covered.astype(np.uint8), kernel) == 0
        total += np.where(clear, level, 0.0)
        count += clear
    seen = count > 0
    return np.where(seen, total / np.maximum(count, 1), halfway), seen


def fill_holes(
    background: FloatArray, lit: np.ndarray, swept: np.ndarray, surface: tuple[float, float] | None
) -> FloatArray:
    """Where the projectile always stood in the way, the smooth surface through the lit background takes its place."""
    h, w = background.shape
    y, x = np.mgrid[0:h, 0:w]
    above = np.ones((h, w), bool) if surface is None else y < surface[0] + surface[1] * x - 4.0
    first, last = find_corridor(swept)
    corridor = np.zeros((h, w), bool)
    corridor[:, max(0, first - 4) : last + 5] = True
    good = lit & above
    holes = above & corridor & ~cv2.erode(good.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
    if not holes.any() or (good & ~holes).sum() < 50:
        return background
    fit = good & ~holes
    picks = np.flatnonzero(fit)[:: max(1, int(fit.sum() // 20000))]
    u, v = (x / w * 2 - 1), (y / h * 2 - 1)
    terms = [(i, j) for i in range(5) for j in range(5 - i)]
    matrix = np.column_stack([u.flat[picks] ** i * v.flat[picks] ** j for i, j in terms])
    target = background.flat[picks]
    weights = np.linalg.lstsq(matrix, target, rcond=None)[0]
    spread = target - matrix @ weights
    calm = np.abs(spread) < 3 * 1.4826 * np.median(np.abs(spread)) + 1e-6
    weights = np.linalg.lstsq(matrix[calm], target[calm], rcond=None)[0]
    smooth = np.zeros((h, w))
    for (i, j), weight in zip(terms, weights, strict=True):
        smooth += weight * u**i * v**j
    return np.where(holes, smooth, background)


def find_trusted(background: FloatArray) -> np.ndarray:
    """Pixels that respond: not stuck far from their neighbours' background, not dead under a passing projectile."""
    near = cv2.medianBlur(background.astype(np.float32), 5)
    departure = np.abs(background - near)
    spread = 1.4826 * float(np.median(departure)) + 1e-6
    return departure < max(12.0 * spread, 0.15 * float(np.ptp(near)))
