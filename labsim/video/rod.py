"""A rod: its tip while it is free, its top end while it is in view, and the rigid length between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray, Measured
from .clipping import ABOVE_PLATEAU
from .ends import find_edge, find_tip_point, measure_shaft
from .following import Progress, follow_end, follow_entering, restore_light
from .frames import Frames
from .joining import clip_gap, compare_lengths, compare_with_edge, join_ends, raise_to_scatter
from .lossy import measure_widening, widen_for_hidden
from .outline import Outline
from .scene import Scene
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
    warnings: list[str],
    progress: Progress | None,
    *,
    clipped: bool = False,
) -> Positions:
    """Follow both ends and join them; ``clipped``: the background is saturated.

    Raises MeasurementError where the tip is never seen free.
    """
    count = len(scene.brightness)
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
    tip = replace(tip, sigma=raise_to_scatter(tip.y, tip.sigma, "the tip", aside, tails))
    tip_y, tip_x = tip.y + tip_offset, tip.x
    tip_sigma = tip.sigma.copy()
    row, sigma, x = tip_y.copy(), tip_sigma.copy(), tip_x.copy()
    reason = list(tip.reason)
    top_row = np.full(count, np.nan)
    length = edge_rms = tilt = diameter = None
    if top is not None:
        top = replace(top, sigma=raise_to_scatter(top.y, top.sigma, "the top end", aside, tails))
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
            scatter = float(np.std(gap)) if len(gap) > 2 else 0.0
            length = Measured(reach - offset, doubt)
            if scatter > max(0.03, 3 * float(np.sqrt(np.median(variance)))):
                warnings.append(
                    f"length of the rod scatters by {scatter:.3f} px: does it turn or leave the plane?"
                )
            side = float(np.median((tip_x - top.x)[both]))
            entering = follow_entering(frames, scene, usable, tip, top, reach - tip_offset, side)
            tip_y = np.where(np.isfinite(entering.y), entering.y + tip_offset, tip_y)
            tip_x = np.where(np.isfinite(entering.y), entering.x, tip_x)
            ratio = float(np.nanmedian(tip.sigma / first_sigma))
            own = raise_to_scatter(entering.y, entering.sigma * ratio, "the half-buried tip", aside, tails)
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
    return Positions(row, sigma, x, top_row, reason, length, diameter, tip_radius, tilt, edge_rms)
