"""``labsim calibrate``: the posterior of p_m."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..effects import list_effects
from ..effects.model import read_model
from ..inference.calibrate import Calibration
from ..inference.calibrate import calibrate as calibrate_drops
from ..inference.published.calibrate import SummaryCalibration
from ..runs.store import RunStore
from . import options
from ._published import (
    PUBLISHED_ONLY,
    TRACKS_ONLY,
    BulkModulus,
    PlanarCorrection,
    Use,
    calibrate_figures,
    refuse_options,
)


def calibrate(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder.")],
    out: options.Out = None,
    parameters: Annotated[
        str | None,
        typer.Option(
            help="p_m and names of effects to fit with it, with commas (tracks only). Default: p_m."
        ),
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="model.toml whose effects belong to the simulation (tracks only).")
    ] = None,
    use: Use = None,
    planar_correction: PlanarCorrection = None,
    bulk_modulus: BulkModulus = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    store: options.Store = None,
    seed: options.Seed = 1,
    pictures: options.Pictures = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Find p_m from a campaign: posterior.nc, calibration.json, fit.png, and corner.png of several parameters."""
    read = read_campaign(campaign)
    if read.has_records:
        refuse_options(
            read, PUBLISHED_ONLY, use=use, planar_correction=planar_correction, bulk_modulus=bulk_modulus
        )
    else:
        refuse_options(read, TRACKS_ONLY, parameters=parameters, model=model)
    extended = read_model(model, list_effects(read)) if model is not None else None
    folder, opened = options.make_output_folder(out, campaign, "calibrate"), RunStore(store)
    found: Calibration | SummaryCalibration
    with options.show_progress(
        quiet, options.CALIBRATE if read.has_records else options.PUBLISHED[:2]
    ) as progress:
        settings: dict[str, Any] = {
            "workers": workers,
            "scheduler": scheduler,
            "seed": seed,
            "progress": progress,
        }
        if read.has_records:
            named = [name.strip() for name in (parameters or "").split(",")]
            names = ("p_m", *(name for name in named if name not in ("", "p_m")))
            found = calibrate_drops(
                read, names, store=opened, backend=folder / "chain.h5", model=extended, **settings
            )
        else:
            found = calibrate_figures(read, opened, use, planar_correction, bulk_modulus, settings)
        from ..report.outputs import write_result  # matplotlib is slow to import and only needed at the end

        summary, lines = write_result(found, folder, options.write_json)
    options.finish(
        summary,
        f"{lines}\n\nwritten to {options.shorten_path(folder)}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )
