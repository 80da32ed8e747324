"""Error bars in compressed video, where neighbouring pixels share what the codec did to them.

The Fisher information takes every pixel for an independent witness. A codec works in blocks: it moves a block as a whole,
or drops its detail, so pixels of one block err together. The scatter of the blocks' own votes says how uncertain their sum
is (cluster-robust variance: Liang & Zeger 1986), whatever the correlation inside a block is.
"""

from __future__ import annotations

import numpy as np

from ..frames import Frames
from ..projectile.following import EndTrack
from ..projectile.registration import Fit, cut_region
from ..projectile.template import MARGIN, Template
from .scene import Scene

BLOCKS = {"mjpg": 8}  # px; codecs that store differences between frames move blocks of 16
OTHER_BLOCK = 16
MOST_FRAMES = 60
LEAST_FRAMES = 5
# What is left where blocks, scatter about the neighbours and the rod's length have had their say: shifts that last and
# that both ends share. Errors over error bars of 16 synthetic H.264 recordings: 1.23, 1.12, 1.08 and 1.45 rms at crf 18,
# 23, 28 and 35. One factor between them stands for all, too large for the weak ones and too small for the strongest.
HIDDEN = 1.35


def widen_for_hidden(codec: str) -> float:
    """Factor for errors that no scatter shows, which codecs that store differences between frames make."""
    return 1.0 if codec in BLOCKS else HIDDEN


def measure_widening(frames: Frames, scene: Scene, usable: np.ndarray, end: EndTrack) -> float:
    """By how much the error bars of one end must grow for what pixels of one block share; 1 where they share nothing."""
    size = BLOCKS.get(frames.codec, OTHER_BLOCK)
    fitted = [i for i, fit in enumerate(end.fits) if fit is not None]
    chosen = set(fitted[:: max(1, len(fitted) // MOST_FRAMES)])
    ratios = []
    for i, picture in enumerate(frames):
        if i in chosen:
            fit = end.fits[i]
            assert fit is not None
            ratio = compare_blocks(picture, scene, usable, end.template, fit, size)
            if ratio is not None:
                ratios.append(ratio)
    if len(ratios) < LEAST_FRAMES:
        return 1.0
    # the error bars already hold the mean misfit per pixel
    misfit = max(1.0, float(np.nanmedian([f.chi_square for f in end.fits if f is not None])))
    return max(1.0, float(np.sqrt(np.mean(ratios) / misfit)))


def compare_blocks(
    picture: np.ndarray, scene: Scene, usable: np.ndarray, template: Template, fit: Fit, size: int
) -> float | None:
    """Variance of the row from the scatter of blocks of ``size`` px, over the variance that the pixels promise alone."""
    oy, ox = round(fit.y), round(fit.x)
    h, w = template.shape
    first_row, first_column = oy + template.top + MARGIN, ox + template.left + MARGIN
    region = cut_region(picture, scene.background, usable, first_row, first_column, h, w)
    if region is None:
        return None
    image, ground, mask, rows, columns = region
    m, my, mx = (part[rows, columns] for part in template.shifted(fit.y - oy, fit.x - ox))
    down = np.linspace(-1.0, 1.0, h)[rows][:, None] + np.zeros_like(m)
    across = np.linspace(-1.0, 1.0, w)[columns][None, :] + np.zeros_like(m)
    light = fit.brightness * ground * (1 - m) + fit.level * m + fit.plane[0] * down + fit.plane[1] * across
    variance = scene.noise.variance(light)
    lever = fit.level - fit.brightness * ground
    slopes = np.stack([lever * my, lever * mx, ground * (1 - m), m, down, across])
    vote = np.tensordot(fit.influence, slopes, 1) * mask / variance
    residual = np.clip((image - light) / np.sqrt(variance), -3.0, 3.0) * np.sqrt(variance)
    block = (first_row + np.arange(rows.start, rows.stop))[:, None] // size * 10_000 + (
        first_column + np.arange(columns.start, columns.stop)
    )[None, :] // size
    label = np.unique(block, return_inverse=True)[1].reshape(block.shape)
    own = np.bincount(label.ravel(), (vote * residual).ravel())
    promised = np.bincount(label.ravel(), (vote**2 * variance).ravel())
    total = float(promised.sum())
    effective = total**2 / float(np.sum(promised**2))  # number of blocks that share the information
    if effective < 1.5:
        return None
    return float(np.sum(own**2)) / (1.0 - 1.0 / effective) / total
