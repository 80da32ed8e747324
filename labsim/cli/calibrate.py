"""``labsim calibrate``: the posterior of p_m."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..campaign import read_campaign
from ..effects import list_effects
from ..effects.model import read_model
from ..errors import InferenceError
from ..inference.planar import READINGS
from ..inference.runs import RunStore
from ..inference.summary import SummaryCalibration, calibrate_summary
from . import options
from .measured import calibrate_measured, has_tracks

Use = Annotated[
    str,
    typer.Option(
        "--use", help="Figures to calibrate on, with commas: depth, stopping_time. The others are a test."
    ),
]
Correction = Annotated[
    str | None,
    typer.Option(
        "--planar-correction", help=f"Planar factor: {', '.join(READINGS)}. Default: the campaign's."
    ),
]
BulkModulus = Annotated[
    float | None, typer.Option("--bulk-modulus-Pa", min=100.0, help="K at φ 0.15. Default: the campaign's.")
]


def calibrate(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder.")],
    out: options.Out = None,
    use: Use = "depth",
    planar_correction: Correction = None,
    bulk_modulus: BulkModulus = None,
    parameters: Annotated[
        str,
        typer.Option(
            "--parameters", help="p_m and names of effects to fit with it, with commas (tracks only)."
        ),
    ] = "p_m",
    model: Annotated[
        Path | None,
        typer.Option("--model", help="model.toml whose effects belong to the simulation (tracks only)."),
    ] = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    store: options.Store = None,
    seed: options.Seed = 1,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Find p_m from a campaign: posterior.nc, calibration.json, corner.png, fit.png."""
    read = read_campaign(campaign)
    figures = parse_use(use)
    if has_tracks(read):
        folder = options.make_output_folder(out, campaign, "calibrate")
        names = tuple(name.strip() for name in parameters.split(",") if name.strip() not in ("", "p_m"))
        with options.show_progress(quiet) as progress:
            settings = {"workers": workers, "scheduler": scheduler, "seed": seed, "progress": progress}
            if model is not None:
                settings["model"] = read_model(model, list_effects(read))
            summary, lines = calibrate_measured(read, folder, RunStore(store), names, settings)
        options.finish(summary, f"{lines}\n\nwritten to {folder}", as_json=as_json, quiet=quiet)
        return
    check_summary(read)
    if model is not None:
        raise InferenceError(model, "--model", "is for campaigns with tracks; these are published figures")
    folder = options.make_output_folder(out, campaign, "calibrate")
    with options.show_progress(quiet) as progress:
        found = calibrate_summary(
            read,
            RunStore(store),
            use=figures,
            depth_reading=parse_correction(planar_correction),
            bulk_modulus=bulk_modulus,
            workers=workers,
            scheduler=scheduler,
            seed=seed,
            progress=progress,
        )
    summary, lines = write_calibration(found, folder)
    options.finish(summary, f"{lines}\n\nwritten to {folder}", as_json=as_json, quiet=quiet)


def write_calibration(found: SummaryCalibration, folder: Path) -> tuple[dict, str]:
    """Files of a calibration; its summary and the lines for people."""
    from ..report.summary_figures import draw_corner, draw_fit
    from ..report.tables import calibration_lines, calibration_summary

    summary = calibration_summary(found)
    options.write_json(folder / "calibration.json", summary)
    (folder / "posterior.nc").unlink(missing_ok=True)
    found.posterior.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    draw_corner(found, folder / "corner.png")
    draw_fit(found, folder / "fit.png")
    return summary, calibration_lines(found)


def parse_use(use: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name.strip().replace("-", "_") for name in use.split(",") if name.strip()))


def parse_correction(name: str | None) -> str | None:
    if name is not None and name not in READINGS:
        raise InferenceError(
            "", "--planar-correction", f'"{name}" is not known; use one of {", ".join(READINGS)}'
        )
    return name


def check_summary(campaign) -> None:  # type: ignore[no-untyped-def]
    """Only published figures can be calibrated on so far; tracks are refused, not guessed at."""
    kinds = {drop.record.kind for drop in campaign.drops}
    if kinds != {"summary"}:
        raise InferenceError(
            campaign.folder,
            "record.kind",
            f"this version calibrates on published figures only, not on {' and '.join(sorted(kinds - {'summary'}))}; "
            'use drops of kind "summary"',
        )
