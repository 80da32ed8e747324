"""``labsim diagnose``: what the calibrated simulation gets wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..diagnosis.campaign import Diagnosis, diagnose_campaign
from ..diagnosis.published.campaign import SummaryDiagnosis, diagnose_summary
from ..runs.store import RunStore
from . import options
from ._published import PUBLISHED_ONLY, BulkModulus, PlanarCorrection, Use, calibrate_figures, refuse_options


def diagnose(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder.")],
    out: options.Out = None,
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
    """Calibrate, predict what was not calibrated, and say what the simulation gets wrong."""
    read = read_campaign(campaign)
    if read.has_records:
        refuse_options(
            read, PUBLISHED_ONLY, use=use, planar_correction=planar_correction, bulk_modulus=bulk_modulus
        )
    folder, opened = options.make_output_folder(out, campaign, "diagnose"), RunStore(store)
    found: Diagnosis | SummaryDiagnosis
    with options.show_progress(
        quiet, options.DIAGNOSE if read.has_records else options.PUBLISHED
    ) as progress:
        settings: dict[str, Any] = {
            "workers": workers,
            "scheduler": scheduler,
            "seed": seed,
            "progress": progress,
        }
        if read.has_records:
            found = diagnose_campaign(read, opened, **settings)
        else:
            calibration = calibrate_figures(read, opened, use, planar_correction, bulk_modulus, settings)
            found = diagnose_summary(
                calibration, opened, workers=workers, scheduler=scheduler, progress=progress
            )
        from ..report.outputs import write_result  # matplotlib is slow to import and only needed at the end

        summary, lines = write_result(found, folder, options.write_json)
    options.finish(
        summary,
        f"{lines}\n\nwritten to {options.shorten_path(folder)}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )
