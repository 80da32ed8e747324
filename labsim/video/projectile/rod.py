"""A rod: its tip while it is free, its top end while it is in view, and the rigid length between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import MeasurementError
from ...records import FloatArray, Measured
from ..frames import Frames
from ..motion.joining import (
    clip_gap,
    compare_lengths,
    compare_with_edge,
    describe_length,
    join_ends,
    raise_to_scatter,
)
from ..picture.clipping import ABOVE_PLATEAU
from ..picture.fields import compare_fields
from ..picture.lossy import measure_widening, widen_for_hidden
from ..picture.response import describe_response, find_gamma
from ..picture.scene import Scene
from ..picture.steadiness import Movement
from .ends import find_edge, find_tip_point, measure_shaft
from .following import EndTrack, Progress, follow_end, follow_entering, restore_light
from .outline import Outline
from .template import MARGIN

LOSSY_TAILS = 8.0  # codecs treat frames of several kinds by turns: the worse kind is no accident


@dataclass(frozen=True)
class Positions:
    """Where the projectile is in every frame, (n,) each (px, NaN where unknown), and what was learnt about its shape.

    row, x : of the tip; top_row : of the top end; reason : why there is no row; edge_difference : rms between the
    registration and the erf edge.
    """

    row: FloatArray
    sigma: FloatArray
    x: FloatArray
    top_row: FloatArray
    reason: list[str]
    length: Measured | None
    diameter: Measured | None
    tip_radius: float | None
    tilt: float | None
    edge_difference: float | None


def follow_rod(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    outlines: tuple[list[Outline | None], float, float],
    movement: Movement | None,
    warnings: list[str],
    progress: Progress | None,
    *,
    clipped: bool = False,
) -> Positions:
    """Follow both ends and join them; ``clipped``: the background is saturated; rows are measured against a ``movement``
    of the dust.

    Raises MeasurementError where the tip is never seen free.
    """
    count = len(scene.brightness)
    cut = [i for i, o in enumerate(outlines[0]) if o is not None and o.cut]
    if len(cut) > 2:
        warnings.append(
            f"the picture's edge cuts the projectile in {len(cut)} frames (first: {cut[0]}): only a part of its round end is "
            "fitted; frame it wider"
        )
    if clipped:
        scene = restore_light(frames, scene, usable, outlines)
    top = follow_end(frames, scene, usable, outlines, "top", progress)
    tip = follow_end(frames, scene, usable, outlines, "tip", progress)
    if tip is None:
        raise MeasurementError(
            frames.path,
            "video",
            "the tip is never seen free of the dust and the picture's edge; begin earlier or frame it wider",
        )
    if not (frames.lossy or clipped):
        said = describe_response([_find_gamma(scene, usable, end) for end in (tip, top) if end is not None])
        warnings += [] if said is None else [said]
    first_sigma, tails = tip.sigma, 4.0  # what the pixels alone promise
    if frames.lossy:
        tails = LOSSY_TAILS
        tip = replace(tip, sigma=tip.sigma * measure_widening(frames, scene, usable, tip))
        if top is not None:
            top = replace(top, sigma=top.sigma * measure_widening(frames, scene, usable, top))
    # in a compressed video the scatter of each end is told in one line at the end
    aside: list[str] = [] if frames.lossy else warnings
    known_above = scene.plateau + ABOVE_PLATEAU if np.isfinite(scene.limit) else -np.inf
    round_end = find_tip_point(tip.template, known_above=known_above)
    if round_end is None:
        rows = np.flatnonzero((tip.template.opacity > 0.5).sum(axis=1) > 0.3 * outlines[1])
        warnings.append("the tip is not round: its lowest half-dark row is taken")
        tip_offset, tip_radius = float(rows[-1]) + 0.5 + tip.template.top, None
    else:
        tip_offset, tip_radius = round_end[0] + round_end[2], round_end[2]
    moved, unsteady = (
        (0.0, 0.0) if movement is None else (movement.choose(tip.y + tip_offset), movement.sigma)
    )

    def raise_error(end: EndTrack, sigma: FloatArray, what: str) -> FloatArray:
        known = np.hypot(sigma, unsteady)
        return sigma * raise_to_scatter(end.y - moved, known, what, aside, tails) / known

    tip = replace(tip, sigma=raise_error(tip, tip.sigma, "the tip"))
    tip_y, tip_x = tip.y + tip_offset, tip.x
    tip_sigma = tip.sigma.copy()
    row, sigma, x = tip_y.copy(), tip_sigma.copy(), tip_x.copy()
    reason = list(tip.reason)
    top_row = np.full(count, np.nan)
    length = edge_rms = tilt = diameter = None
    if top is not None:
        top = replace(top, sigma=raise_error(top, top.sigma, "the top end"))
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
            if frames.lossy:
                longer = compare_lengths(gap, tip_sigma[both] ** 2 + top.sigma[both] ** 2)
                tip, top = replace(tip, sigma=longer * tip.sigma), replace(top, sigma=longer * top.sigma)
                tip_sigma = tip.sigma.copy()
                sigma = tip_sigma.copy()
            variance = tip_sigma[both] ** 2 + top.sigma[both] ** 2
            gap, variance = clip_gap(gap, variance)
            reach = float(np.sum(gap / variance) / np.sum(1 / variance))
            doubt = float(np.sqrt(1 / np.sum(1 / variance)))
            changes = describe_length(tip_y[both], tip_y[both] - top.y[both], variance)
            if changes is not None:
                warnings.append(changes)
                # what changes the length goes on where the tip is hidden
                doubt = float(np.hypot(doubt, np.std(gap)))
                longer = compare_lengths(gap, variance)
                tip_sigma, top = longer * tip_sigma, replace(top, sigma=longer * top.sigma)
                tip = replace(tip, sigma=longer * tip.sigma)
            length = Measured(reach - offset, doubt)
            side = float(np.median((tip_x - top.x)[both]))
            entering = follow_entering(frames, scene, usable, tip, top, reach - tip_offset, side)
            tip_y = np.where(np.isfinite(entering.y), entering.y + tip_offset, tip_y)
            tip_x = np.where(np.isfinite(entering.y), entering.x, tip_x)
            ratio = float(np.nanmedian(tip.sigma / first_sigma))
            own = raise_error(entering, entering.sigma * ratio, "the half-buried tip")
            tip_sigma = np.where(np.isfinite(entering.y), own, tip_sigma)
            lowest = top.template.top + top.template.opacity.shape[0] - MARGIN
            shared = reach - tip_offset + tip.template.top + MARGIN < lowest
            row, sigma, x, reason = join_ends(
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
            fields = compare_fields(frames, scene, usable, top, edge, scene.edge_noise)
            warnings += [] if fields is None else [fields]
            edge_rms = compare_with_edge(
                frames, scene, usable, top, edge, row, sigma, reason, warnings, progress
            )
    else:
        warnings.append("the top end is never in view: only frames with a free tip have a position")
    if frames.lossy:
        hidden = widen_for_hidden(frames.codec)
        sigma = sigma * hidden
        raised = hidden * float(np.nanmedian(tip.sigma / first_sigma))
        cause = "what neighbouring pixels and frames share"
        warnings.append(
            f"compressed with loss ({frames.codec.upper()}): error bars were raised {raised:.1f} times, for {cause}"
            if raised >= 1.05
            else f"compressed with loss ({frames.codec.upper()}): no error bar had to be raised for {cause}"
        )
    return Positions(
        row - moved,
        np.hypot(sigma, unsteady),
        x,
        top_row,
        reason,
        length,
        diameter,
        tip_radius,
        tilt,
        edge_rms,
    )


def _find_gamma(scene: Scene, usable: np.ndarray, end: EndTrack) -> tuple[float, float, float] | None:
    path = scene.swept & usable
    light = float(np.median(scene.background[path if path.any() else usable]))
    return find_gamma(end.template, scene.projectile_level, light)
