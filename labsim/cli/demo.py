"""``labsim demo``: the main job on the data that ships with labsim."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..diagnosis.campaign import Diagnosis, diagnose_campaign
from ..diagnosis.published.campaign import SummaryDiagnosis, diagnose_summary
from ..examples import example
from ..inference.published.calibrate import calibrate_summary
from ..results import SAID
from ..runs.store import RunStore
from . import _provenance, options

END = "\n\n"  # of what a diagnosis says first: what is wrong, what to do


class Case(StrEnum):
    """What the demo shows."""

    both = "both"
    clay = "clay"
    dust = "dust"


def demo(
    case: Annotated[
        Case,
        typer.Option("--case", help="clay: real cone soundings; dust: the published drops of Güttler et al."),
    ] = Case.both,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Output folder. Default: labsim-demo in this folder.")
    ] = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    store: options.Store = None,
    seed: options.Seed = 1,
    pictures: options.Pictures = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Diagnose what ships with labsim: real soundings in clay, whose cause it finds, and the published drops in dust.

    The drops' files lie in the output folder, those of the soundings in its folder clay. Minutes once, seconds again.
    """
    folder = options.make_output_folder(out or Path("labsim-demo"), example("guettler2009"), "demo")
    opened = RunStore(store)
    settings: dict[str, Any] = {"workers": workers, "scheduler": scheduler}
    summary: dict[str, Any] = {}
    said = []
    stages = {
        Case.both: (*options.DIAGNOSE, "calibration runs", "prediction runs"),
        Case.clay: options.DIAGNOSE,
        Case.dust: options.PUBLISHED,
    }
    with options.show_progress(quiet, stages[case]) as progress:
        settings["progress"] = progress
        if case is not Case.dust:
            clay = diagnose_campaign(read_campaign(example("tiller")), opened, seed=seed, **settings)
            place = folder / "clay" if case is Case.both else folder
            summary["clay"], lines = _write(clay, place, Case.clay)
            said.append(
                f"A cone pushed into clay at nine speeds (tiller, measured)\n{lines.partition(END)[0]}\n"
                f"{_say_where(summary['clay'], place)}"
            )
        if case is not Case.clay:
            calibration = calibrate_summary(
                read_campaign(example("guettler2009")), opened, seed=seed, **settings
            )
            found, lines = _write(diagnose_summary(calibration, opened, **settings), folder, case)
            summary |= found
            said.append(
                f"Projectiles dropped into dust (guettler2009, published figures)\n{lines}\n{_say_where(found, folder)}"
            )
    options.finish(
        summary if case is not Case.clay else summary["clay"],
        "\n\n".join(said),
        as_json=as_json,
        quiet=quiet,
    )


def _write(found: Diagnosis | SummaryDiagnosis, folder: Path, case: Case) -> tuple[dict[str, Any], str]:
    """Write files of a case, so that ``labsim rerun`` of the folder repeats what lies there; summary and lines."""
    from ..report.outputs import write_result  # matplotlib is slow to import and only needed at the end
    from ..report.tables import calibration_lines

    folder.mkdir(exist_ok=True)
    _provenance.specify("--case", case.value)
    summary, lines = write_result(found, folder, options.write_json)
    whole = lines if isinstance(found, Diagnosis) else f"{calibration_lines(found.calibration)}\n\n{lines}"
    (folder / SAID).write_text(whole + "\n", encoding="utf-8")
    return summary, lines


def _say_where(summary: dict[str, Any], folder: Path) -> str:
    return (
        f"{summary['runs_new']} new runs, {summary['runs_reused']} from the store, {summary['wall_s']:.0f} s; "
        f"pictures and page: {options.shorten_path(folder / 'report.html')}"
    )
