"""``labsim calibrate``: the posterior of p_m."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..effects import list_effects
from ..effects.model import read_model
from ..inference.runs import RunStore
from ..inference.summary import SummaryCalibration
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
from .measured import calibrate_measured, has_tracks


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
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Find p_m from a campaign: posterior.nc, calibration.json, fit.png, and corner.png of several parameters."""
    read = read_campaign(campaign)
    tracks = has_tracks(read)
    if tracks:
        refuse_options(
            read, PUBLISHED_ONLY, use=use, planar_correction=planar_correction, bulk_modulus=bulk_modulus
        )
    else:
        refuse_options(read, TRACKS_ONLY, parameters=parameters, model=model)
    extended = read_model(model, list_effects(read)) if model is not None else None
    folder = options.make_output_folder(out, campaign, "calibrate")
    with options.show_progress(quiet) as progress:
        settings: dict[str, Any] = {
            "workers": workers,
            "scheduler": scheduler,
            "seed": seed,
            "progress": progress,
        }
        if tracks:
            named = [name.strip() for name in (parameters or "").split(",")]
            names = tuple(name for name in named if name not in ("", "p_m"))
            settings["model"] = extended
            summary, lines = calibrate_measured(read, folder, RunStore(store), names, settings)
        else:
            found = calibrate_figures(read, RunStore(store), use, planar_correction, bulk_modulus, settings)
            summary, lines = write_calibration(found, folder)
    options.finish(
        summary,
        f"{lines}\n\nwritten to {options.shorten_path(folder)}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )


def write_calibration(found: SummaryCalibration, folder: Path) -> tuple[dict, str]:
    """Files of a calibration; its summary and the lines for people."""
    from ..report.summary_figures import draw_corner, draw_fit
    from ..report.tables import calibration_lines, calibration_summary

    summary = calibration_summary(found)
    options.write_json(folder / "calibration.json", summary)
    (folder / "posterior.nc").unlink(missing_ok=True)
    found.posterior.data.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    draw_corner(found, folder / "corner.png")
    draw_fit(found, folder / "fit.png")
    return summary, calibration_lines(found)
