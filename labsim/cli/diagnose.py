"""``labsim diagnose``: what the calibrated simulation gets wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..campaign import read_campaign
from ..campaign_tables import MATERIAL_KEYS
from ..diagnosis.summary import SummaryDiagnosis, diagnose_summary
from ..effects import Model, write_model
from ..inference.runs import RunStore
from . import options
from ._published import PUBLISHED_ONLY, BulkModulus, PlanarCorrection, Use, calibrate_figures, refuse_options
from .calibrate import write_calibration
from .measured import diagnose_measured, has_tracks


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
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Calibrate, predict what was not calibrated, and say what the simulation gets wrong."""
    read = read_campaign(campaign)
    tracks = has_tracks(read)
    if tracks:
        refuse_options(
            read, PUBLISHED_ONLY, use=use, planar_correction=planar_correction, bulk_modulus=bulk_modulus
        )
    folder, opened = options.make_output_folder(out, campaign, "diagnose"), RunStore(store)
    with options.show_progress(quiet) as progress:
        settings = {"workers": workers, "scheduler": scheduler, "seed": seed, "progress": progress}
        if tracks:
            summary, lines = diagnose_measured(read, folder, opened, settings)
        else:
            calibration = calibrate_figures(read, opened, use, planar_correction, bulk_modulus, settings)
            found = diagnose_summary(
                calibration, opened, workers=workers, scheduler=scheduler, progress=progress
            )
            summary, lines = write_diagnosis(found, folder)
    options.finish(
        summary,
        f"{lines}\n\nwritten to {options.shorten_path(folder)}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )


def write_diagnosis(found: SummaryDiagnosis, folder: Path) -> tuple[dict, str]:
    """Files of a calibration and its diagnosis; the summary and the lines for people."""
    from ..report.run_figures import draw_density_field
    from ..report.summary_figures import draw_compacted_volume, draw_depth_law, draw_penetration
    from ..report.summary_page import write_page
    from ..report.tables import diagnosis_lines, diagnosis_summary

    calibration = found.calibration
    write_calibration(calibration, folder)
    summary = diagnosis_summary(found)
    options.write_json(folder / "diagnosis.json", summary)
    q = calibration.quantiles
    material = calibration.campaign.material.replace(bulk_modulus=calibration.bulk_modulus)
    fields = [field for field, _low, _high in MATERIAL_KEYS.values()]
    write_model(
        folder / "model.toml",
        Model(q["q50"], material=tuple((field, getattr(material, field)) for field in fields)),
        comments=[
            f"{calibration.campaign.name}: p_m calibrated on {' and '.join(calibration.use)}, planar, "
            f"90 % between {q['q05']:.0f} and {q['q95']:.0f} Pa"
        ],
    )
    draw_penetration(calibration, folder / "penetration.png")
    draw_depth_law(found, folder / "depth_law.png")
    draw_compacted_volume(found, folder / "compacted_volume.png")
    draw_density_field(calibration.finest_run, folder / "density_field.png")
    write_page(found, folder)
    return summary, diagnosis_lines(found)
