"""``labsim demo``: the main job on the data that ships with labsim."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..campaign import describe_campaign, read_campaign
from ..diagnosis.summary import diagnose_summary
from ..examples import example
from ..inference.runs import RunStore
from ..inference.summary import calibrate_summary
from . import options


def demo(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Output folder. Default: labsim-demo in this folder.")
    ] = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    store: options.Store = None,
    seed: options.Seed = 1,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Check, calibrate and diagnose the published drops of Güttler et al. (2009); minutes once, seconds again."""
    campaign = read_campaign(example("guettler2009"))
    folder = options.make_output_folder(out or Path("labsim-demo"), campaign.folder, "demo")
    opened = RunStore(store)
    if not (quiet or as_json):
        typer.echo(describe_campaign(campaign)["text"] + "\n")
    with options.show_progress(quiet) as progress:
        calibration = calibrate_summary(
            campaign, opened, workers=workers, scheduler=scheduler, seed=seed, progress=progress
        )
        found = diagnose_summary(calibration, opened, workers=workers, scheduler=scheduler, progress=progress)
    from ..report.outputs import write_result
    from ..report.tables import calibration_lines

    summary, lines = write_result(found, folder, options.write_json)

    made = "\n".join(f"  {path.name}" for path in sorted(folder.iterdir()) if not path.name.startswith("."))
    counted = (
        f"{summary['runs_new']} new runs, {summary['runs_reused']} from the store, {summary['wall_s']:.0f} s"
    )
    options.finish(
        summary,
        f"{calibration_lines(calibration)}\n\n{lines}\n\n{counted}; written to {options.shorten_path(folder)}:\n{made}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )
