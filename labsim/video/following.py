"""One end of the projectile through the whole video: its template, and its registration frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..records import FloatArray
from .ends import View, build_template
from .frames import Frames
from .outline import Outline, choose_spread
from .registration import MARGIN, Template, register
from .scene import Scene

TEMPLATE_FRAMES = 40
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class EndTrack:
    """One end over all frames, (n,) each: position of the template's origin, error bar, NaN where not seen."""

    y: FloatArray
    x: FloatArray
    sigma: FloatArray
    reason: list[str]
    template: Template


def follow_end(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    outlines: tuple[list[Outline | None], float, float],
    which: str,
    progress: Progress | None,
) -> EndTrack | None:
    """Build the template of one end and register it in every frame; None where the end is never seen well."""
    found, width, tip_width = outlines
    count = len(found)
    y = np.array([np.nan if o is None or getattr(o, which) is None else getattr(o, which) for o in found])
    x = np.array([np.nan if o is None else getattr(o, f"column_{which}") for o in found])
    if which == "top":
        depth = int(np.clip(1.5 * width, 20, 60))
        top, bottom, half = -14, depth, 0.5 * width + 12
    else:
        depth = int(np.clip(0.95 * tip_width + 4, 14, 90))
        top, bottom, half = -depth, 13, 0.5 * max(tip_width, width) + 12
    left = -int(np.ceil(half))
    shape = (bottom - top + 2 * MARGIN, 2 * int(np.ceil(half)) + 1 + 2 * MARGIN)
    top, left = top - MARGIN, left - MARGIN
    floor = frames.shape[0] - 1.0
    if scene.surface is not None:
        floor = min(floor, scene.surface[0] + scene.surface[1] * float(np.nanmedian(x)) - 6.0)
    free = np.isfinite(y) & (y + top > -MARGIN - 4)
    free &= (y + min(bottom, 9) < floor) if which == "tip" else (y + 12 < floor)
    free &= ~scene.duplicate
    candidates = np.flatnonzero(free)
    if len(candidates) < 2:
        return None
    chosen = set(choose_spread(y, candidates, TEMPLATE_FRAMES).tolist())
    views = [
        View(picture, float(scene.brightness[i]), float(y[i]), float(x[i]))
        for i, picture in enumerate(frames)
        if i in chosen
    ]
    template = build_template(views, scene, usable, top, left, shape)
    if template is None:
        return None
    return _register_all(frames, scene, usable, template, y, x, which, floor, progress, count)


def _register_all(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    template: Template,
    y: FloatArray,
    x: FloatArray,
    which: str,
    floor: float,
    progress: Progress | None,
    count: int,
) -> EndTrack:
    rows, columns, sigma = (np.full(count, np.nan) for _ in range(3))
    reason = [""] * count
    chi = np.full(count, np.nan)
    lost = np.full(count, np.nan)
    shift_y = shift_x = 0.0
    last = None
    for i, picture in enumerate(frames):
        if progress is not None:
            progress(i + 1, count, f"registering the {which} end")
        if scene.duplicate[i] and last is not None:
            reason[i] = "repeats the frame before"
            continue
        if not np.isfinite(y[i]):
            reason[i] = "top end out of view" if which == "top" else "tip in the dust or out of view"
            continue
        start = (y[i] + shift_y, x[i] + shift_x)
        fit = register(
            picture,
            scene.background,
            usable,
            template,
            scene.noise,
            *start,
            level=scene.projectile_level * scene.brightness[i],
            brightness=float(scene.brightness[i]),
        )
        if fit is None:
            reason[i] = f"{which} end cannot be registered"
            continue
        rows[i], columns[i], sigma[i] = fit.y, fit.x, fit.sigma
        chi[i], lost[i] = fit.chi_square, fit.lost
        last = fit
        if abs(fit.y - y[i]) < 2 and abs(fit.x - x[i]) < 3:
            shift_y += 0.2 * (fit.y - y[i] - shift_y)
            shift_x += 0.2 * (fit.x - x[i] - shift_x)
        if not np.isfinite(fit.sigma) or fit.sigma > 0.5:
            reason[i] = f"{which} end hardly visible"
        elif scene.contrast * 0.5 > abs(fit.brightness * np.median(scene.background) - fit.level) * 2:
            reason[i] = f"contrast of the {which} end is gone"
    typical = float(np.nanmedian(chi))
    usual_loss = float(np.nanmedian(lost))
    for i in range(count):
        if not reason[i] and (lost[i] > usual_loss + 0.2 or chi[i] > max(2.0 * typical, typical + 1.0)):
            reason[i] = f"{which} end disturbed (spray, glare?)"
    bad = np.array([bool(r) for r in reason])
    rows[bad], columns[bad], sigma[bad] = np.nan, np.nan, np.nan
    return EndTrack(rows, columns, sigma * max(1.0, np.sqrt(typical)), reason, template)


def follow_entering(
    frames: Frames, scene: Scene, usable: np.ndarray, tip: EndTrack, top: EndTrack, reach: float, side: float
) -> EndTrack:
    """The part of the round end that still stands above the dust, in frames whose tip is buried; started from the top.

    Kept only where it agrees with the top end: dust that is pushed up beside the projectile must not pull it.
    """
    wanted = np.isnan(tip.y) & np.isfinite(top.y) & ~scene.duplicate
    empty = np.full(len(tip.y), np.nan)
    entering = EndTrack(empty.copy(), empty.copy(), empty.copy(), [""] * len(tip.y), tip.template)
    if not wanted.any():
        return entering
    usual = float(np.nanmedian(tip.sigma))
    for i, picture in enumerate(frames):
        if not wanted[i]:
            continue
        fit = register(
            picture,
            scene.background,
            usable,
            tip.template,
            scene.noise,
            float(top.y[i] + reach),
            float(top.x[i] + side),
            level=scene.projectile_level * float(scene.brightness[i]),
            brightness=float(scene.brightness[i]),
        )
        if fit is None or not fit.sigma < 8 * usual or fit.lost > 0.2:
            continue
        if abs(fit.y - top.y[i] - reach) < 4 * np.hypot(fit.sigma, top.sigma[i]) + 0.02:
            entering.y[i], entering.x[i], entering.sigma[i] = fit.y, fit.x, fit.sigma
    return entering
