"""Pictures made of two fields: a camera that reads odd and even rows half a frame apart, or rows that were doubled."""

from __future__ import annotations

import numpy as np

from ..frames import Frames
from ..projectile.ends import fit_edge
from ..projectile.following import EndTrack
from .scene import Scene

FASTEST = 8  # frames that are looked at
LEAST_APART = 0.2  # of the step per frame; fields lie 0.5 apart, sound recordings stay within 0.02
CERTAIN = 5.0  # standard errors


def compare_fields(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    top: EndTrack,
    edge: tuple[float, float, float, float, float],
    noise: tuple[float, float],
) -> str | None:
    """A warning where odd and even rows show the top edge of the projectile at different places while it moves, else None.

    edge : of ``find_edge``; noise : variance of a bright and of a dark pixel.
    """
    step = np.gradient(top.y)
    known = np.flatnonzero(np.isfinite(step) & np.array([fit is not None for fit in top.fits]))
    chosen = set(known[np.argsort(-np.abs(step[known]))][:FASTEST].tolist())
    if len(chosen) < FASTEST:
        return None
    parity = (np.arange(frames.shape[0]) % 2 == 1)[:, None]
    apart, sigma, doubled = [], [], 0
    for i, picture in enumerate(frames):
        if i not in chosen:
            continue
        even = len(picture) // 2 * 2
        doubled += bool(np.array_equal(picture[0:even:2], picture[1:even:2]))
        fit = top.fits[i]
        assert fit is not None
        found = [
            fit_edge(
                picture,
                scene.background,
                usable & rows,
                edge,
                noise,
                fit.y,
                fit.x,
                fit.level,
                fit.brightness,
                ceiling=scene.find_limit(i),
            )
            for rows in (parity, ~parity)
        ]
        if found[0] is not None and found[1] is not None:
            apart.append((found[0][0] - found[1][0]) / step[i])
            sigma.append(np.hypot(found[0][1], found[1][1]) / abs(step[i]))
    if doubled > FASTEST // 2:
        return "every row is in the picture twice: a camera's fields were doubled, and half of the rows tell nothing"
    if len(apart) < FASTEST // 2:
        return None
    share = float(np.median(apart))
    if abs(share) < max(LEAST_APART, CERTAIN * float(np.median(sigma)) / np.sqrt(len(sigma))):
        return None
    return (
        f"odd and even rows show the projectile {abs(share):.2f} frames apart: the video is interlaced, and rows are wrong "
        f"by up to {0.5 * float(np.max(np.abs(step[sorted(chosen)]))):.2f} px; make a picture of each field"
    )
