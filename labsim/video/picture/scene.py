"""What a video shows besides the projectile: the background, its brightness in time, the noise, the surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ...errors import MeasurementError
from ...records import FloatArray, Measured
from ..frames import Frames
from .background import average_background, fill_holes, find_trusted
from .noise import Noise, measure_noise
from .surface import find_corridor, find_surface

NEAR_CEILING = 0.99  # of the ceiling: a mean that high holds clipped pixels
LEAST_CONTRAST = 4.0  # times the noise; below, every method fails (Cheezum et al. 2001)
BRIGHTEST = 0.02  # of the pixels: a frame in which so many stand at the ceiling is overexposed
SPARSE = 4096  # pixels that stand for the picture where brightness and noise are followed in time
NOISE_FRAMES = 600


@dataclass(frozen=True)
class Scene:
    """The picture without the projectile. Arrays of shape (rows, columns) unless said otherwise.

    background : grey level at brightness 1; projectile_level : grey level of the projectile;
    trusted : pixels that are neither dead nor saturated; swept : pixels that the projectile passed over;
    corridor : first and last column of the projectile's path;
    brightness : (n,) of each frame; duplicate : (n,) whether a frame repeats the one before, bit by bit;
    surface : row of the dust's surface along a column x: rows = surface[0] + surface[1] · x, None where none is seen;
    overexposed : (n,) whether a frame is so much brighter than most that its background stands at the ceiling;
    limit : the ceiling where the background is the light without it, else infinite.
    """

    background: FloatArray
    projectile_level: float
    trusted: np.ndarray
    swept: np.ndarray
    corridor: tuple[int, int]
    brightness: FloatArray
    duplicate: np.ndarray
    noise: Noise
    contrast: float
    surface: tuple[float, float] | None
    surface_sigma: float
    ceiling: float
    overexposed: np.ndarray
    limit: float = np.inf

    @property
    def plateau(self) -> float:
        """Opacity at which clipped pixels stand."""
        full = float(np.max(self.background))
        return (full - self.ceiling) / (full - self.projectile_level)

    @property
    def edge_noise(self) -> tuple[float, float]:
        """Variance of a pixel on the brighter and on the darker side of the projectile's edge."""
        levels = np.array([self.projectile_level + self.contrast, self.projectile_level])
        bright, dark = self.noise.variance(levels)
        return float(bright), float(dark)

    def find_limit(self, frame: int) -> float:
        """Grey level at which the pixels of one frame saturate, infinite where none of its background does."""
        return self.ceiling if self.overexposed[frame] else self.limit

    def surface_row(self, column: float) -> Measured | None:
        if self.surface is None:
            return None
        return Measured(self.surface[0] + self.surface[1] * column, self.surface_sigma)


def survey_scene(frames: Frames, progress: Callable[[int, int, str], None] | None = None) -> Scene:
    """Two passes over the video: what moves, then the background behind it. Raises MeasurementError."""
    path = frames.path
    low = high = first = previous = None
    sparse: list[np.ndarray] = []
    brightness, duplicate, highest, peak = [], [], [], 0
    step = max(1, int(np.sqrt(frames.shape[0] * frames.shape[1] / SPARSE)))
    for i, picture in enumerate(frames):
        small = picture[::step, ::step].astype(np.float32)
        if first is None:
            first = small
            lit = first > 0.5 * (np.percentile(first, 5) + np.percentile(first, 95))
            if not np.any(lit):
                lit = np.ones_like(first, bool)
        level = float(np.median(small[lit] / np.maximum(first[lit], 1.0)))
        duplicate.append(previous is not None and np.array_equal(picture, previous))
        previous = picture
        top = int(picture.max())
        peak = max(peak, top)
        highest.append(top if np.mean(small >= NEAR_CEILING * top) > BRIGHTEST else 0)
        brightness.append(level if level > 0 else 1.0)
        if len(sparse) < NOISE_FRAMES:
            sparse.append(small / brightness[-1])
        blurred = cv2.blur(picture, (3, 3)).astype(np.float32) / np.float32(brightness[-1])
        low = blurred if low is None else np.minimum(low, blurred)
        high = blurred if high is None else np.maximum(high, blurred)
        if progress is not None:
            progress(i + 1, frames.count, "looking for what moves")
    if low is None or high is None or len(brightness) < 12:
        raise MeasurementError(
            path, "video", f"only {len(brightness)} frames can be read; a drop needs at least 12"
        )
    brightness_array = np.array(brightness)
    ceiling = find_ceiling(frames.bits, peak)
    noise = measure_noise(np.array(sparse), ceiling)
    overexposed = np.array(highest) >= NEAR_CEILING * ceiling
    if np.mean(overexposed) > 0.5:
        overexposed[:] = False  # not these frames, but the light is too bright
    span = high - low
    floor = float(np.median(span))
    threshold = max(_otsu(span), floor + 3.0)
    moved = (
        cv2.morphologyEx((span > threshold).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    )
    typical = float(np.median(0.5 * (low + high)))
    pixel_noise = float(np.sqrt(noise.variance(np.array(typical))))
    if moved.sum() < 40:
        raise MeasurementError(path, "video", "nothing moves through the picture; is the projectile in view?")
    contrast = float(np.median(span[moved])) - floor
    if contrast < LEAST_CONTRAST * pixel_noise:
        raise MeasurementError(
            path,
            "video",
            f"contrast {contrast:.1f} is below 4 times the noise {pixel_noise:.1f}: nothing can be tracked; use more light",
        )
    count, _, stats, _ = cv2.connectedComponentsWithStats(moved.astype(np.uint8), connectivity=8)
    if count > 2:  # the projectile's path: one or two large pieces; specks of spray are small
        areas = stats[1:, cv2.CC_STAT_AREA]
        labels = cv2.connectedComponents(moved.astype(np.uint8), connectivity=8)[1]
        moved = np.isin(labels, 1 + np.flatnonzero(areas >= 0.1 * areas.max()))
    swept = cv2.dilate(moved.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    around = (cv2.dilate(swept.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0) & ~swept
    middle = 0.5 * (low + high)
    beside = middle[around] if np.any(around) else middle
    dark = abs(np.median(beside) - np.median(high[moved])) < abs(np.median(beside) - np.median(low[moved]))
    projectile_level = float(np.percentile(low[moved], 25) if dark else np.percentile(high[moved], 75))
    # the extremes over many frames lie a few standard deviations out
    projectile_level += (1 if dark else -1) * 0.6 * pixel_noise
    background, seen = average_background(frames, brightness_array, low, high, swept, dark, overexposed)
    scene_level = np.where(seen, background, np.nan)
    lit_level = float(np.nanmedian(scene_level[swept])) if np.any(seen & swept) else float(np.median(beside))
    halfway = 0.5 * (lit_level + projectile_level)
    is_lit = (background > halfway) if dark else (background < halfway)
    surface, surface_sigma = find_surface(background, is_lit & seen, swept)
    if surface is None:  # dust brighter than half the light
        surface, surface_sigma = find_surface(
            background, _tell_from_dust(background, lit_level) & seen, swept
        )
    background = fill_holes(background, is_lit & seen, swept, surface)
    trusted = find_trusted(background)
    return Scene(
        background=background,
        projectile_level=projectile_level,
        trusted=trusted,
        swept=swept,
        corridor=find_corridor(swept),
        brightness=brightness_array,
        duplicate=np.array(duplicate),
        noise=noise,
        contrast=abs(lit_level - projectile_level),
        surface=surface,
        surface_sigma=surface_sigma,
        ceiling=ceiling,
        overexposed=overexposed,
    )


def _tell_from_dust(background: FloatArray, lit_level: float) -> np.ndarray:
    """Pixels that are nearer to the light than to what fills the lowest rows of the picture."""
    dust = float(np.median(background[-3:]))
    return np.abs(background - lit_level) < np.abs(background - dust)


def find_ceiling(bits: int, peak: int) -> float:
    """Grey level at which pixels saturate, from the largest level in the video.

    Cameras of 10, 12 or 14 bit save words of 16, with the low bits used or the high ones.
    """
    for real in range(9, bits):
        full = (1 << real) - 1
        if peak in (full, full << (bits - real)):
            return float(peak)
    return float((1 << bits) - 1)


def _otsu(values: FloatArray) -> float:
    top = float(np.percentile(values, 99.9))
    scaled = np.clip(values / max(top, 1e-6) * 255.0, 0, 255).astype(np.uint8)
    return cv2.threshold(scaled, 0, 255, cv2.THRESH_OTSU)[0] / 255.0 * top
