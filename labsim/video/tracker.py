"""Frames in, a track out: every frame's tip row with an error bar, or the reason why there is none.

The tip is followed while it is free and the top end while it is in view, both against fixed templates; while both are
seen their distance, the length of the rigid rod, is measured, and the top end then tells where the buried tip is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray, Measured, Track
from .frames import Frames
from .motion.gaps import find_gaps
from .motion.joining import raise_to_scatter
from .picture.direction import check_direction, straighten
from .picture.lossy import widen_for_hidden
from .picture.scene import NEAR_CEILING, Scene, survey_scene
from .picture.steadiness import LEAST_CORRECTED, Movement, describe_movement, follow_surface
from .projectile.bead import follow_bead, is_bead
from .projectile.following import Progress
from .projectile.outline import Outline, Outliner
from .projectile.rod import LOSSY_TAILS, Positions, follow_rod
from .track_file import LEFT_OUT, find_left_out

MOST_SMEAR = 1.5  # steps per frame; beyond, with a radius for what the fit takes for smear
LEAST_LEAN = 3.0  # degrees; the tracker finds 0.1, and 3 turn 5 % of the force aside


@dataclass(frozen=True)
class Tracking:
    """Everything that one video said. Lengths in px, angles in rad.

    x : (n,) column of the tip; top_row : (n,) row of the top end, NaN where out of view; length, diameter : of the rod;
    surface : row of the dust's surface under the projectile; edge_difference : rms between the registration and the
    independent erf edge; lossy : whether the video is compressed with loss.
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
    lossy: bool = False

    def moved(self, left: int, top: int) -> Tracking:
        """The same in the whole picture, of which only the part from column ``left`` and row ``top`` was looked at.

        ``scene`` stays in the pixels of that part.
        """
        return replace(
            self,
            track=replace(self.track, tip_row=self.track.tip_row + top),
            x=self.x + left,
            top_row=self.top_row + top,
            surface=None if self.surface is None else replace(self.surface, value=self.surface.value + top),
        )


def track_projectile(
    frames: Frames,
    *,
    frame_rate: float | None = None,
    surface_row: float | None = None,
    region: tuple[int, int, int, int] | None = None,
    left_out: Sequence[int] = (),
    progress: Progress | None = None,
) -> Track:
    """Track of the tip; see ``follow_projectile`` for everything else that the video says."""
    return follow_projectile(
        frames,
        frame_rate=frame_rate,
        surface_row=surface_row,
        region=region,
        left_out=left_out,
        progress=progress,
    ).track


def follow_projectile(
    frames: Frames,
    *,
    frame_rate: float | None = None,
    surface_row: float | None = None,
    region: tuple[int, int, int, int] | None = None,
    left_out: Sequence[int] = (),
    progress: Progress | None = None,
) -> Tracking:
    """Follow the projectile through a video.

    frame_rate (Hz) overrides what the header says, not the camera's own stamps; surface_row (px) is where the tip
    meets the dust if it is known better than from the picture. region (left, top, right, bottom in px) is the only part
    of the picture that is looked at; rows and columns stay those of the whole picture. left_out : the camera's numbers of
    frames whose positions are not used. Raises MeasurementError for a video in which nothing can be tracked.
    """
    if region is not None:
        left, top = region[:2]
        seen = follow_projectile(
            frames.cut(region),
            frame_rate=frame_rate,
            surface_row=None if surface_row is None else surface_row - top,
            left_out=left_out,
            progress=progress,
        )
        return seen.moved(left, top)
    scene = survey_scene(frames, progress)
    count = len(scene.brightness)
    surface = scene.surface_row(0.5 * sum(scene.corridor))
    outlines = _outline_all(frames, scene, progress)
    usable = _usable_pixels(scene)
    warnings = list(frames.warnings)
    full = scene.background >= NEAR_CEILING * scene.ceiling
    clipped = bool(np.mean(full[usable]) > 0.02)
    if clipped:
        warnings.append(
            "the background is saturated: how bright it would be is guessed from the edges, which may shift the rows "
            "by some hundredths of a pixel together; use less light"
        )

    if scene.overexposed.any():
        warnings.append(
            f"{int(scene.overexposed.sum())} frames are overexposed (first: {int(np.argmax(scene.overexposed))}): their "
            "background says only how bright it is at least; use less light, or light that does not flicker"
        )
    movement = follow_surface(frames, scene, _find_free_flight(outlines[0]), surface_row)
    if movement is not None:
        warnings.append(describe_movement(movement))
        if movement.size < LEAST_CORRECTED:
            movement = None

    bead_like = is_bead(outlines[0])
    found = _follow_bare_bead(frames, scene, usable, outlines[0], movement, warnings) if bead_like else None
    if found is None:
        try:
            check_direction(frames, outlines)
        except MeasurementError:
            # a hand that carries a ball up before it lets go is larger than the ball
            if not bead_like:
                found = _follow_bare_bead(frames, scene, usable, outlines[0], movement, warnings)
            if found is None:
                raise
    if found is None:
        found = follow_rod(frames, scene, usable, outlines, movement, warnings, progress, clipped=clipped)
    row, sigma, x = found.row, found.sigma, found.x
    reason = [
        ("repeats the frame before" if d else r) for r, d in zip(found.reason, scene.duplicate, strict=True)
    ]
    if scene.duplicate.any():
        warnings.append(
            f"{int(scene.duplicate.sum())} frames repeat the one before (first: {int(np.argmax(scene.duplicate))})"
        )
    number = frames.numbers[:count].astype(np.int64)
    without = find_left_out(frames.path, number, left_out)
    reason = [LEFT_OUT if out else r for out, r in zip(without, reason, strict=True)]
    valid = np.isfinite(row) & np.array([r == "" for r in reason])
    if valid.sum() < 8:
        common = max(set(r for r in reason if r), key=reason.count, default="unknown")
        raise MeasurementError(
            frames.path,
            "video",
            f"only {int(valid.sum())} of {count} frames can be tracked, at least 8 are needed (most often: {common})",
        )
    where = surface_row if surface_row is not None else surface.value if surface is not None else None
    level = (
        None if scene.surface is None or scene.surface_sigma > 0.5 else float(np.arctan(-scene.surface[1]))
    )
    row, rotation = straighten(row, x, valid, found.tip_radius or 0.0, where, level, warnings)
    if found.tilt is not None and rotation is not None:
        lean = np.degrees(found.tilt - rotation.value)
        if abs(lean) > LEAST_LEAN:
            warnings.append(
                f"the rod leans by {lean:+.1f}° against its fall: rows are those of its round end; the simulation knows only "
                "upright rods"
            )
    rejected = int(np.sum(~valid))
    if rejected:
        kinds = {r: reason.count(r) for r in reason if r}
        warnings.append("frames without a position: " + ", ".join(f"{n} {kind}" for kind, n in kinds.items()))
    if frames.stamps is None and np.all(np.diff(number) == 1):
        number = _mend_clock(number, np.where(valid, row, np.nan), sigma, scene.duplicate, warnings)
    track = Track(
        frame=number,
        time=time_frames(frames, number, frame_rate),
        tip_row=np.where(valid, row, np.nan),
        sigma=np.where(valid, sigma, np.nan),
        valid=valid,
        reason=tuple(reason),
        warnings=tuple(dict.fromkeys(warnings)),
    )
    surface = scene.surface_row(float(np.nanmedian(x)))
    if surface is not None and movement is not None:
        surface = Measured(surface.value - movement.mean, surface.sigma)
    return Tracking(
        track,
        x,
        found.top_row,
        found.length,
        found.diameter,
        found.tip_radius,
        surface,
        found.tilt,
        rotation,
        found.edge_difference,
        scene,
        frames.lossy,
    )


def _follow_bare_bead(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    outlines: list[Outline | None],
    movement: Movement | None,
    warnings: list[str],
) -> Positions | None:
    """Positions of a bare bead, whose lowest point stands for the tip; None where it is better served by a template."""
    bead = follow_bead(frames, scene, usable, outlines)
    if bead is None:
        return None
    moved, doubt = (0.0, 0.0) if movement is None else (movement.choose(bead.y + bead.radius), movement.sigma)
    sigma = raise_to_scatter(
        bead.y - moved, bead.sigma, "the bead", warnings, LOSSY_TAILS if frames.lossy else 4.0
    )
    if frames.lossy:
        sigma = sigma * widen_for_hidden(frames.codec)
    longest, fastest = float(np.nanmax(bead.smear)), float(np.nanmax(np.abs(np.gradient(bead.y))))
    if longest > MOST_SMEAR * fastest + bead.radius:
        return None  # it would have been exposed for longer than a frame: a short rod
    if longest > 0.1 * bead.radius:
        warnings.append(
            f"the bead is smeared by up to {longest:.1f} px: it is followed as a smeared disc, rows are at mid exposure"
        )
    return Positions(
        row=bead.y + bead.radius - moved,
        sigma=np.hypot(sigma, doubt),
        x=bead.x,
        top_row=bead.y - bead.radius,
        reason=bead.reason,
        length=None,
        diameter=Measured(2 * bead.radius, 2 * bead.radius_sigma),
        tip_radius=bead.radius,
        tilt=None,
        edge_difference=None,
    )


def _mend_clock(
    number: np.ndarray, row: FloatArray, sigma: FloatArray, repeated: np.ndarray, warnings: list[str]
) -> np.ndarray:
    """Frame numbers with the gaps that the motion shows, each of them said."""
    mended = number.copy()
    for index, missing in find_gaps(number, row, sigma, repeated):
        mended[index:] += missing
        what = "a picture was put in twice"
        if missing > 0:
            what = "1 frame is missing" if missing == 1 else f"{missing} frames are missing"
        warnings.append(
            f"{what} before picture {index} (the projectile's own step says so): later times were moved by {missing:+d}"
        )
    return mended


def time_frames(frames: Frames, number: np.ndarray, frame_rate: float | None) -> FloatArray:
    """Time of each frame (s): the camera's stamps where there are any, else frame number / rate, both at mid exposure."""
    if frames.stamps is not None:
        return frames.stamps[: len(number)] + 0.5 * frames.exposure
    rate = frame_rate if frame_rate is not None else frames.header_rate
    if rate is None or not rate > 0:
        raise MeasurementError(frames.path, "--fps", "the file does not say its frame rate; give --fps")
    return number / rate + 0.5 * frames.exposure


def _usable_pixels(scene: Scene) -> np.ndarray:
    """Pixels that tell projectile from background: trusted, and lit; not the dust, with a margin for its lumps."""
    h, w = scene.background.shape
    y, x = np.mgrid[0:h, 0:w]
    usable = scene.trusted & (np.abs(scene.background - scene.projectile_level) > 0.35 * scene.contrast)
    if scene.surface is not None:
        usable &= y < scene.surface[0] + scene.surface[1] * x - 5.0
    return usable


def _find_free_flight(outlines: list[Outline | None]) -> np.ndarray:
    """Which frames (n,) come before the tip is first hidden."""
    free = np.array([o is not None and o.tip is not None for o in outlines])
    hidden = np.array([o is not None and o.tip is None and o.top is not None for o in outlines])
    return free & (np.cumsum(hidden) == 0)


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
        raise MeasurementError(
            frames.path,
            "video",
            f"a projectile is seen in {len(seen)} of {len(found)} frames; at least 8 are needed, with light behind it",
        )
    with_tip = [o.tip_width for o in seen if o.tip is not None]
    width = float(np.median([o.width for o in seen]))
    return found, width, float(np.median(with_tip)) if with_tip else width
