"""One end of the projectile through the whole video: its template, and its registration frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...records import FloatArray
from ..frames import Frames
from ..picture.clipping import ABOVE_PLATEAU, measure_excess
from ..picture.scene import NEAR_CEILING, Scene
from .ends import View, build_template
from .outline import Outline, choose_spread
from .registration import Fit, register
from .template import MARGIN, Template

TEMPLATE_FRAMES = 40
RESTORATIONS = 6
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class EndTrack:
    """One end over all frames, (n,) each: position of the template's origin, error bar, NaN where not seen."""

    y: FloatArray
    x: FloatArray
    sigma: FloatArray
    reason: list[str]
    template: Template
    fits: tuple[Fit | None, ...] = ()


@dataclass(frozen=True)
class EndStart:
    """Where one end roughly is in every frame ((n,) px), the lowest row at which it counts, and its template."""

    y: FloatArray
    x: FloatArray
    floor: float
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
    start = start_end(frames, scene, usable, outlines, which)
    return None if start is None else _register_all(frames, scene, usable, start, which, progress)


def start_end(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    outlines: tuple[list[Outline | None], float, float],
    which: str,
) -> EndStart | None:
    """The template of one end, from frames in which it stands free; None where there are too few."""
    found, width, tip_width = outlines
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
    free &= ~(scene.duplicate | scene.overexposed)
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
    return None if template is None else EndStart(y, x, floor, template)


def restore_light(
    frames: Frames, scene: Scene, usable: np.ndarray, outlines: tuple[list[Outline | None], float, float]
) -> Scene:
    """The scene with the light that a saturated background would have had; unchanged where no edge says it.

    The first template is made of clipped edges, which a spline cannot follow; each next one is made with the light that
    the one before told, and tells it better.
    """
    clipped = scene.background >= NEAR_CEILING * scene.ceiling
    restored, full = scene, scene.ceiling
    for _ in range(RESTORATIONS):
        known = 0.25 if restored is scene else restored.plateau + ABOVE_PLATEAU
        starts = [start_end(frames, restored, usable, outlines, which) for which in ("tip", "top")]
        told = [measure_excess(start.template.opacity, known) for start in starts if start is not None]
        known_excess = [each for each in told if each is not None]
        if not known_excess:
            break
        excess = float(np.mean(known_excess))
        full -= excess * (full - scene.projectile_level)
        full = float(np.clip(full, 1.005 * scene.ceiling, 3.0 * scene.ceiling))
        restored = replace(scene, background=np.where(clipped, full, scene.background), limit=scene.ceiling)
        if abs(excess) < 2e-3:
            break
    return restored


def _register_all(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    start: EndStart,
    which: str,
    progress: Progress | None,
) -> EndTrack:
    y, x, template = start.y, start.x, start.template
    count = len(y)
    rows, columns, sigma = (np.full(count, np.nan) for _ in range(3))
    reason = [""] * count
    fits: list[Fit | None] = [None] * count
    chi = np.full(count, np.nan)
    lost = np.full(count, np.nan)
    shift_y = shift_x = 0.0
    light = float(np.median(scene.background))
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
        fit = register(
            picture,
            scene.background,
            usable,
            template,
            scene.noise,
            y[i] + shift_y,
            x[i] + shift_x,
            level=scene.projectile_level * scene.brightness[i],
            brightness=float(scene.brightness[i]),
            ceiling=scene.find_limit(i),
        )
        if fit is None:
            reason[i] = f"{which} end cannot be registered"
            continue
        rows[i], columns[i], sigma[i] = fit.y, fit.x, fit.sigma
        chi[i], lost[i] = fit.chi_square, fit.lost
        last = fits[i] = fit
        if abs(fit.y - y[i]) < 2 and abs(fit.x - x[i]) < 3:
            shift_y += 0.2 * (fit.y - y[i] - shift_y)
            shift_x += 0.2 * (fit.x - x[i] - shift_x)
        if not np.isfinite(fit.sigma) or fit.sigma > 0.5:
            reason[i] = f"{which} end hardly visible"
        elif scene.contrast * 0.5 > abs(fit.brightness * light - fit.level) * 2:
            reason[i] = f"contrast of the {which} end is gone"
    typical = float(np.nanmedian(chi))
    usual_loss = float(np.nanmedian(lost))
    for i in range(count):
        if not reason[i] and (lost[i] > usual_loss + 0.2 or chi[i] > max(2.0 * typical, typical + 1.0)):
            reason[i] = f"{which} end disturbed (spray, glare?)"
    bad = np.array([bool(r) for r in reason])
    rows[bad], columns[bad], sigma[bad] = np.nan, np.nan, np.nan
    kept = tuple(None if lost else fit for fit, lost in zip(fits, bad, strict=True))
    return EndTrack(rows, columns, sigma * max(1.0, np.sqrt(typical)), reason, template, kept)


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
            ceiling=scene.find_limit(i),
        )
        if fit is None or not fit.sigma < 8 * usual or fit.lost > 0.2:
            continue
        if abs(fit.y - top.y[i] - reach) < 4 * np.hypot(fit.sigma, top.sigma[i]) + 0.02:
            entering.y[i], entering.x[i], entering.sigma[i] = fit.y, fit.x, fit.sigma
    return entering
