"""What ``calibrate`` and ``diagnose`` share where a campaign holds published figures: options, and the calibration itself."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ..errors import InferenceError
from ..inference.published.calibrate import SummaryCalibration, calibrate_summary
from ..inference.published.planar import READINGS
from ..records import Campaign
from ..runs.store import RunStore

Use = Annotated[
    str | None,
    typer.Option(
        help="Published figures to calibrate on, with commas: depth, stopping_time. Default: depth; the others "
        "are a test."
    ),
]
PlanarCorrection = Annotated[
    str | None,
    typer.Option(help=f"Planar factor for published depths: {', '.join(READINGS)}. Default: the campaign's."),
]
BulkModulus = Annotated[
    float | None,
    typer.Option(
        "--bulk-modulus-Pa",
        min=100.0,
        help="K at φ 0.15, for published figures. Default: the campaign's.",
    ),
]


def calibrate_figures(
    campaign: Campaign,
    store: RunStore,
    use: str | None,
    planar_correction: str | None,
    bulk_modulus: float | None,
    settings: dict[str, Any],
) -> SummaryCalibration:
    """calibrate_summary with the options as they were typed. Raises InferenceError where one of them is not known."""
    if planar_correction is not None and planar_correction not in READINGS:
        raise InferenceError(
            "", "--planar-correction", f'"{planar_correction}" is not known; use one of {", ".join(READINGS)}'
        )
    names = "depth" if use is None else use
    figures = dict.fromkeys(name.strip().replace("-", "_") for name in names.split(",") if name.strip())
    return calibrate_summary(
        campaign,
        store,
        use=tuple(figures),
        depth_reading=planar_correction,
        bulk_modulus=bulk_modulus,
        **settings,
    )


PUBLISHED_ONLY = "is for published figures; this campaign has tracks"
TRACKS_ONLY = "is for tracks; this campaign holds published figures"


def refuse_options(campaign: Campaign, why: str, **given: object) -> None:
    """Raise InferenceError for the first of these options that was given: it would be ignored."""
    for name, value in given.items():
        if value is not None:
            option = "--bulk-modulus-Pa" if name == "bulk_modulus" else f"--{name.replace('_', '-')}"
            raise InferenceError(campaign.folder, option, f"{why}; leave it out")
