"""Frames in, a track out: every frame's tip row with an error bar, or the reason why there is none.

The tip is followed while it is free and the top end while it is in view, both against fixed templates; while both are
seen their distance, the length of the rigid rod, is measured, and the top end then tells where the buried tip is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray, Measured, Track
from .ends import View, build_template, find_edge, find_tip_point, fit_edge, measure_shaft
from .frames import Frames
from .outline import Outline, Outliner, choose_spread
from .registration import MARGIN, Template, register
from .scene import Scene, survey_scene

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


@dataclass(frozen=True)
class Tracking:
    """Everything that one video said. Lengths in px, angles in rad.

    x : (n,) column of the tip; top_row : (n,) row of the top end, NaN where out of view; length, diameter : of the rod;
    surface : row of the dust's surface under the projectile; edge_difference : rms between the registration and the
    independent erf edge.
    """

    track: Track
    x: FloatArray
    top_row: FloatArray
    length: Measured | None
    diameter: Measured | None
    tip_radius: float | None
    surface: Measured | None
    tilt: float | None
    camera_rotation: Measured | None
    edge_difference: float | None
    scene: Scene


def track_projectile(
    frames: Frames,
    *,
    frame_rate: float | None = None,
    surface_row: float | None = None,
    progress: Progress | None = None,
) -> Track:
    """Track of the tip; see ``follow_projectile`` for everything else that the video says."""
    return follow_projectile(frames, frame_rate=frame_rate, surface_row=surface_row, progress=progress).track


def follow_projectile(
    frames: Frames,
    *,
    frame_rate: float | None = None,
    surface_row: float | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """Follow the projectile through a video.

    frame_rate (Hz) overrides what the header says, not the camera's own stamps; surface_row (px) is where the tip
    meets the dust if it is known better than from the picture. Raises MeasurementError for a video in which nothing
    can be tracked.
    """
    scene = survey_scene(frames, progress)
    count = len(scene.brightness)
    surface = scene.surface_row(0.5 * sum(scene.corridor))
    outlines = _outline_all(frames, scene, progress)
    _check_direction(frames, outlines)
    usable = _usable_pixels(scene)
    warnings = list(frames.warnings)
    full = scene.background >= 0.99 * scene.ceiling
    if np.mean(full[usable]) > 0.02:
        warnings.append(
            "the background is saturated: edges look shifted and error bars are too small; use less light"
        )

    top = _follow_end(frames, scene, usable, outlines, "top", progress)
    tip = _follow_end(frames, scene, usable, outlines, "tip", progress)
    if tip is None:
        raise MeasurementError(
            frames.path,
            "video",
            "the tip is never seen free of the dust and the picture's edge; frame it wider",
        )
    round_end = find_tip_point(tip.template)
    if round_end is None:
        rows = np.flatnonzero((tip.template.opacity > 0.5).sum(axis=1) > 0.3 * outlines[1])
        warnings.append("the tip is not round: its lowest half-dark row is taken")
        tip_offset, tip_radius = float(rows[-1]) + 0.5 + tip.template.top, None
    else:
        tip_offset, tip_radius = round_end[0] + round_end[2], round_end[2]
    first_sigma = tip.sigma
    tip = replace(tip, sigma=_raise_to_scatter(tip.y, tip.sigma, "the tip", warnings))
    tip_y, tip_x = tip.y + tip_offset, tip.x
    tip_sigma = tip.sigma.copy()
    row, sigma, x = tip_y.copy(), tip_sigma.copy(), tip_x.copy()
    reason = list(tip.reason)
    top_row = np.full(count, np.nan)
    length = edge_rms = tilt = diameter = None
    if top is not None:
        top = replace(top, sigma=_raise_to_scatter(top.y, top.sigma, "the top end", warnings))
        shaft = measure_shaft(top.template)
        if shaft is not None:
            tilt, diameter = shaft[0], Measured(shaft[1], shaft[2])
        edge = find_edge(top.template)
        end = find_tip_point(top.template, lower=False) if edge is None else None
        offset = edge[0] if edge is not None else (end[0] - end[2] if end is not None else 0.0)
        top_row = top.y + offset
        both = np.isfinite(top.y) & np.isfinite(tip_y) & (tip_sigma < 0.3)
        if both.sum() >= 1:
            gap = tip_y[both] - top.y[both]
            variance = tip_sigma[both] ** 2 + top.sigma[both] ** 2
            gap, variance = _clip_gap(gap, variance)
            reach = float(np.sum(gap / variance) / np.sum(1 / variance))
            doubt = float(np.sqrt(1 / np.sum(1 / variance)))
            scatter = float(np.std(gap)) if len(gap) > 2 else 0.0
            length = Measured(reach - offset, doubt)
            if scatter > max(0.03, 3 * float(np.sqrt(np.median(variance)))):
                warnings.append(
                    f"length of the rod scatters by {scatter:.3f} px: does it turn or leave the plane?"
                )
            side = float(np.median((tip_x - top.x)[both]))
            entering = _follow_entering(frames, scene, usable, tip, top, reach - tip_offset, side)
            tip_y = np.where(np.isfinite(entering.y), entering.y + tip_offset, tip_y)
            tip_x = np.where(np.isfinite(entering.y), entering.x, tip_x)
            ratio = float(np.nanmedian(tip.sigma / first_sigma))
            own = _raise_to_scatter(entering.y, entering.sigma * ratio, "the half-buried tip", warnings)
            tip_sigma = np.where(np.isfinite(entering.y), own, tip_sigma)
            lowest = top.template.top + top.template.opacity.shape[0] - MARGIN
            shared = reach - tip_offset + tip.template.top + MARGIN < lowest
            row, sigma, x, reason = _join(
                top, tip_y, tip_x, tip_sigma, tip.reason, reach, side, doubt, shared
            )
        else:
            warnings.append(
                "tip and top end are never seen together: frames with a buried tip have no position"
            )
            reason = [
                r or ("" if np.isfinite(v) else "tip in the dust") for r, v in zip(reason, row, strict=True)
            ]
        if edge is not None:
            edge_rms = _compare_with_edge(
                frames, scene, usable, top, edge, row, sigma, reason, warnings, progress
            )
    else:
        warnings.append("the top end is never in view: only frames with a free tip have a position")
    reason = [("repeats the frame before" if d else r) for r, d in zip(reason, scene.duplicate, strict=True)]
    if scene.duplicate.any():
        warnings.append(
            f"{int(scene.duplicate.sum())} frames repeat the one before (first: {int(np.argmax(scene.duplicate))})"
        )
    valid = np.isfinite(row) & np.array([r == "" for r in reason])
    if valid.sum() < 8:
        common = max(set(r for r in reason if r), key=reason.count, default="unknown")
        raise MeasurementError(
            frames.path, "video", f"only {int(valid.sum())} frames can be tracked ({common})"
        )
    where = surface_row if surface_row is not None else surface.value if surface is not None else None
    level = (
        None if scene.surface is None or scene.surface_sigma > 0.5 else float(np.arctan(-scene.surface[1]))
    )
    row, rotation = _straighten(row, x, valid, tip_radius or 0.0, where, level, warnings)
    rejected = int(np.sum(~valid))
    if rejected:
        kinds = {r: reason.count(r) for r in reason if r}
        warnings.append("frames without a position: " + ", ".join(f"{n} {kind}" for kind, n in kinds.items()))
    time = time_frames(frames, count, frame_rate)
    track = Track(
        frame=frames.numbers[:count].astype(np.int64),
        time=time,
        tip_row=np.where(valid, row, np.nan),
        sigma=np.where(valid, sigma, np.nan),
        valid=valid,
        reason=tuple(reason),
        warnings=tuple(dict.fromkeys(warnings)),
    )
    if surface is not None:
        surface = scene.surface_row(float(np.nanmedian(x)))
    return Tracking(track, x, top_row, length, diameter, tip_radius, surface, tilt, rotation, edge_rms, scene)


def time_frames(frames: Frames, count: int, frame_rate: float | None) -> FloatArray:
    """Time of each frame (s): the camera's stamps where there are any, else frame number / rate, both at mid exposure."""
    if frames.stamps is not None:
        return frames.stamps[:count] + 0.5 * frames.exposure
    rate = frame_rate if frame_rate is not None else frames.header_rate
    if rate is None or not rate > 0:
        raise MeasurementError(frames.path, "--fps", "the file does not say its frame rate; give --fps")
    return frames.numbers[:count] / rate + 0.5 * frames.exposure


def _usable_pixels(scene: Scene) -> np.ndarray:
    """Pixels that tell projectile from background: trusted, and lit; not the dust, with a margin for its lumps."""
    h, w = scene.background.shape
    y, x = np.mgrid[0:h, 0:w]
    usable = scene.trusted & (np.abs(scene.background - scene.projectile_level) > 0.35 * scene.contrast)
    if scene.surface is not None:
        usable &= y < scene.surface[0] + scene.surface[1] * x - 5.0
    return usable


def _outline_all(
    frames: Frames, scene: Scene, progress: Progress | None
) -> tuple[list[Outline | None], float, float]:
    """Outlines of all frames, the shaft's width and the tip's (px)."""
    outliner = Outliner(scene)
    found: list[Outline | None] = []
    for i, picture in enumerate(frames):
        found.append(outliner.find(picture, scene.brightness[i]))
        if progress is not None:
            progress(i + 1, len(scene.brightness), "finding the projectile")
    seen = [o for o in found if o is not None]
    if len(seen) < 8:
        raise MeasurementError(frames.path, "video", f"a projectile is seen in only {len(seen)} frames")
    with_tip = [o.tip_width for o in seen if o.tip is not None]
    width = float(np.median([o.width for o in seen]))
    return found, width, float(np.median(with_tip)) if with_tip else width


def _check_direction(frames: Frames, outlines: tuple[list[Outline | None], float, float]) -> None:
    """The projectile must fall towards growing rows."""
    steps = []
    for name in ("tip", "top"):
        spots = [
            (i, getattr(o, name), getattr(o, f"column_{name}"))
            for i, o in enumerate(outlines[0])
            if o is not None and getattr(o, name) is not None
        ]
        if len(spots) >= 5:
            i, y, x = np.array(spots).T
            if np.ptp(y) > 3 or np.ptp(x) > 3:
                early = i <= i[0] + 0.5 * np.ptp(i)
                steps.append(
                    (
                        np.polyfit(i[early], y[early], 1)[0],
                        np.polyfit(i[early], x[early], 1)[0],
                        np.ptp(y),
                        np.ptp(x),
                    )
                )
    if not steps:
        return
    dy, dx, range_y, range_x = max(steps, key=lambda s: s[2] + s[3])
    if range_x > 1.5 * range_y:
        turn = 270 if dx > 0 else 90
        raise MeasurementError(
            frames.path,
            "video",
            f"the projectile moves sideways; give --rotate {turn} if the camera stood on its side",
        )
    if dy < 0:
        raise MeasurementError(
            frames.path,
            "video",
            "the projectile moves upwards; give --rotate 180 if the picture is upside down",
        )


def _follow_end(
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


def _follow_entering(
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


def _clip_gap(gap: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out distances between the ends that lie far from the others."""
    spread = max(1.4826 * float(np.median(np.abs(gap - np.median(gap)))), 0.005)
    keep = np.abs(gap - np.median(gap)) < 4 * spread
    return gap[keep], variance[keep]


def _join(
    top: EndTrack,
    tip_y: FloatArray,
    tip_x: FloatArray,
    tip_sigma: FloatArray,
    tip_reason: list[str],
    reach: float,
    side: float,
    doubt: float,
    shared: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """One track from both ends: weighted mean where both are seen, the one that is seen elsewhere."""
    from_top = top.y + reach
    top_sigma = np.hypot(top.sigma, doubt)
    w_tip = np.where(np.isfinite(tip_y), 1 / tip_sigma**2, 0.0)
    w_top = np.where(np.isfinite(from_top), 1 / top_sigma**2, 0.0)
    if shared:  # both see the same pixels: the better one alone, a mean would count their noise twice
        w_tip, w_top = np.where(w_tip >= w_top, w_tip, 0.0), np.where(w_top > w_tip, w_top, 0.0)
    total = w_tip + w_top
    with np.errstate(invalid="ignore", divide="ignore"):
        row = (np.where(w_tip > 0, tip_y, 0.0) * w_tip + np.where(w_top > 0, from_top, 0.0) * w_top) / total
        sigma = 1 / np.sqrt(total)
    x = np.where(np.isfinite(tip_x), tip_x, top.x + side)
    reason = []
    for i in range(len(row)):
        if total[i] > 0:
            reason.append("")
        elif top.reason[i] == tip_reason[i] or not tip_reason[i]:
            reason.append(top.reason[i])
        else:
            reason.append(f"{top.reason[i]}, {tip_reason[i]}" if top.reason[i] else tip_reason[i])
    return row, np.where(total > 0, sigma, np.nan), x, reason


def _compare_with_edge(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    top: EndTrack,
    edge: tuple[float, float, float, float, float],
    row: FloatArray,
    sigma: FloatArray,
    reason: list[str],
    warnings: list[str],
    progress: Progress | None,
) -> float | None:
    """Second estimate by the erf edge; frames that disagree by far are rejected. Returns the rms difference."""
    count = len(row)
    difference, error = np.full(count, np.nan), np.full(count, np.nan)
    bright = float(scene.noise.variance(np.array(scene.projectile_level + scene.contrast)))
    dark = float(scene.noise.variance(np.array(scene.projectile_level)))
    for i, picture in enumerate(frames):
        if np.isfinite(top.y[i]):
            second = fit_edge(
                picture,
                scene.background,
                usable,
                edge,
                (bright, dark),
                float(top.y[i]),
                float(top.x[i]),
                scene.projectile_level * float(scene.brightness[i]),
                float(scene.brightness[i]),
            )
            if second is not None:
                difference[i], error[i] = second[0] - top.y[i], np.hypot(second[1], top.sigma[i])
    known = np.isfinite(difference)
    if known.sum() < 4:
        return None
    difference -= np.nanmedian(difference)
    spread = max(1.4826 * float(np.nanmedian(np.abs(difference))), float(np.nanmedian(error)))
    wrong = known & (np.abs(difference) > np.maximum(0.08, 6 * spread))
    for i in np.flatnonzero(wrong):
        reason[i] = "registration and edge disagree"
    rms = float(np.sqrt(np.mean(difference[known & ~wrong] ** 2)))
    if spread > 3 * float(np.nanmedian(error)) and spread > 0.02:
        warnings.append(
            f"registration and erf edge differ by {spread:.3f} px, more than their error bars allow"
        )
    return rms


def _straighten(
    row: FloatArray,
    x: FloatArray,
    valid: np.ndarray,
    radius: float,
    surface: float | None,
    level: float | None,
    warnings: list[str],
) -> tuple[FloatArray, Measured | None]:
    """Rows along the line of the fall: a camera that is rotated by θ shortens rows by cos θ."""
    good = valid & np.isfinite(x)
    if good.sum() < 8 or np.ptp(row[good]) < 10:
        return row, None
    y0 = surface if surface is not None else float(np.mean(row[good]))
    keep = good.copy()
    for _ in range(3):
        slope, offset = np.polyfit(row[keep], x[keep], 1)
        misfit = x - slope * row - offset
        keep = good & (np.abs(misfit) < 4 * max(1.4826 * float(np.median(np.abs(misfit[keep]))), 0.02))
    spread = float(np.std(misfit[keep])) / (np.std(row[keep]) * np.sqrt(max(keep.sum() - 2, 1)))
    angle = float(np.arctan(slope))
    if level is not None and abs(angle) > np.radians(0.3) and abs(level - angle) > abs(angle) / 2:
        if abs(slope) > 5 * spread:
            warnings.append(f"the projectile falls {np.degrees(angle):+.2f}° aslant of the surface's normal")
        return row, Measured(level, spread)
    if abs(angle) > np.radians(0.5) and abs(slope) > 5 * spread:
        warnings.append(f"the fall is {np.degrees(angle):+.2f}° off the columns: rows are measured along it")
    # the tip's circle moves along the fall; its lowest point lies one radius below its centre in either direction
    return y0 + (row - radius - y0) * np.hypot(1.0, slope) + radius, Measured(angle, spread)


def _raise_to_scatter(row: FloatArray, sigma: FloatArray, what: str, warnings: list[str]) -> FloatArray:
    """Raise the error bars of one end where it scatters about its neighbours by more than the error bars say."""
    index = np.flatnonzero(np.isfinite(row))
    if len(index) < 20:
        return sigma
    near = np.stack([index[k : len(index) - 3 + k] for k in range(4)])
    near = near[:, near[3] - near[0] == 3]
    # third difference of four neighbours: blind to position, speed and acceleration
    weights = np.array([1.0, -3.0, 3.0, -1.0])
    ratios = (weights @ row[near]) / np.sqrt(weights**2 @ sigma[near] ** 2)
    if ratios.size < 12:
        return sigma
    inside = np.abs(ratios) < 4 * 1.4826 * np.median(np.abs(ratios))
    factor = float(np.sqrt(np.mean(ratios[inside] ** 2)))
    if factor > 1.0 + 1.5 / np.sqrt(ratios.size):  # beyond what chance does with so few
        if factor > 1.6:
            warnings.append(
                f"{what} scatters {factor:.1f} times more than the noise explains: its error bars were raised"
            )
        return sigma * factor
    return sigma
