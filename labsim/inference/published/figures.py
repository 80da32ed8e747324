"""Published figures of a campaign: which drops and numbers p_m is calibrated on, as planar runs must show them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import InferenceError
from ...records import STANDARD_GRAVITY, Campaign, Drop, Measured
from ..supported import refuse_others
from .planar import expected_raw_depth

FIGURE_KINDS = ("depth", "stopping_time")


@dataclass(frozen=True)
class Figure:
    """One published number as the planar run must show it: ``value`` in SI, ``sigma`` of its logarithm."""

    drop: str
    kind: str  # "depth" or "stopping_time"
    value: float
    sigma: float


def choose_drops(campaign: Campaign, use: Sequence[str]) -> list[Drop]:
    """The drops to calibrate on: those named in [planar], or all. Raises InferenceError where figures are missing."""
    refuse_others(campaign)
    for name in use:
        if name not in FIGURE_KINDS:
            raise InferenceError(
                "", "--use", f'"{name}" is not a figure; use one or more of {", ".join(FIGURE_KINDS)}'
            )
    if not use:
        raise InferenceError("", "--use", f"names no figure; use one or more of {', '.join(FIGURE_KINDS)}")
    where = campaign.folder / "campaign.toml"
    if campaign.geometry != "planar":
        raise InferenceError(
            where,
            "model.geometry",
            'published figures are calibrated with planar runs; write geometry = "planar"',
        )
    wanted = campaign.planar.calibration_drops or tuple(drop.name for drop in campaign.drops)
    drops = [drop for drop in campaign.drops if drop.name in wanted and drop.published is not None]
    for name in use:
        if not any(published_figure(drop, name) for drop in drops):
            raise InferenceError(
                where, "--use", f"no calibration drop has a published {name}; choose another figure"
            )
    return drops


def collect_figures(drops: Sequence[Drop], use: Sequence[str], depth_reading: str) -> tuple[Figure, ...]:
    """The published figures to calibrate on, as planar runs must show them."""
    figures = []
    for drop in drops:
        for kind in use:
            if (found := published_figure(drop, kind)) is not None:
                value = expected_raw_depth(found.value, depth_reading) if kind == "depth" else found.value
                figures.append(Figure(drop.name, kind, value, found.sigma / found.value))
    return tuple(figures)


def published_figure(drop: Drop, kind: str) -> Measured | None:
    """The depth or the stopping time that is published of a drop."""
    if drop.published is None:
        return None
    return drop.published.penetration_depth if kind == "depth" else drop.published.stopping_time


def impact_speed(drop: Drop, campaign: Campaign) -> float:
    """The published speed at contact, or that of the free fall from the stated height (m/s)."""
    if drop.published is not None and drop.published.impact_speed is not None:
        return drop.published.impact_speed.value
    assert drop.height is not None
    return math.sqrt(2.0 * (campaign.gravity or STANDARD_GRAVITY) * drop.height.value)
