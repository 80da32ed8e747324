"""Options that commands share, and the few things every command does at its end."""

from __future__ import annotations

import json
import math
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer

from .. import text_files
from ..errors import LabsimError
from ..report.figures.formats import FORMATS, further_formats
from ..results import SAID
from . import _provenance

Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", help="Output folder. Default: a new one here, named after the input."),
]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes that run simulations. Default: all cores.")
]
Scheduler = Annotated[str | None, typer.Option("--scheduler", help="Address of a running Dask scheduler.")]
Store = Annotated[
    Path | None,
    typer.Option("--store", help="Folder of the stored runs. Default: LABSIM_STORE or the user's cache."),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary, only errors.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON on standard output.")]


def choose_formats(text: str | None) -> str | None:
    """What pictures of this command are written as beside PNG. Raises LabsimError."""
    names = [name.strip().lower().lstrip(".") for name in (text or "").split(",") if name.strip()]
    for name in names:
        if name not in (*FORMATS, "png"):
            raise LabsimError(
                "", "--format", f"{name!r} is no format of pictures; write {' or '.join(FORMATS)}"
            )
    further_formats.set(tuple(dict.fromkeys(name for name in names if name != "png")))
    return text


Pictures = Annotated[
    str | None,
    typer.Option("--format", callback=choose_formats, help="Pictures beside PNG: pdf, svg or pdf,svg."),
]


def make_output_folder(out: Path | None, source: Path, command: str) -> Path:
    """Make the folder to write into and return it.

    Without --out it is a new ``NAME-COMMAND`` in the current directory (with a number where that is taken), named after the
    input: a file's stem, a folder's name, CAMPAIGN-D01 for a part of a campaign. Never inside a campaign, where it would be
    read as data one day, nor inside a folder that is the input: who stands there gets it beside that folder. Raises LabsimError.
    """
    source = source.resolve()
    if out is None:
        wanted = _leave_input(Path.cwd().resolve(), source) / f"{_name_input(source)}-{command}"
        out, number = wanted, 1
        while out.exists() and not (out.is_dir() and not any(out.iterdir())):
            number += 1
            out = wanted.with_name(f"{wanted.name}-{number}")
    out = out.resolve()
    if (outside := _leave_input(out, source)) != out:
        raise LabsimError(
            out,
            "--out",
            f"lies inside the input or a campaign; name a folder outside, as {outside / out.name}",
        )
    new = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as trouble:
        raise LabsimError(
            out, "--out", f"cannot be made ({trouble.strerror}); name a folder you may write to"
        ) from None
    _output[:], _made[:] = [out], [out] if new else []
    return out


def _find_campaign(path: Path) -> Path | None:
    """The campaign folder that a path is or lies in."""
    return next((each for each in (path, *path.parents) if (each / "campaign.toml").is_file()), None)


def _leave_input(place: Path, source: Path) -> Path:
    """``place``, or the first folder above it that lies in no campaign and not in a folder that is the input."""
    if campaign := _find_campaign(place):
        place = campaign.parent
    if source.is_dir() and source in (place, *place.parents):
        place = source.parent
    return place


def _name_input(source: Path) -> str:
    campaign = _find_campaign(source)
    if source.is_file() and campaign is None and source.suffix != ".toml":
        return source.stem
    folder = source.parent if source.is_file() else source
    return folder.name if campaign in (None, folder) else f"{campaign.name}-{folder.name}"


def drop_empty_folder() -> None:
    """Remove the output folder that this command made and left empty."""
    for folder in _made:
        with suppress(OSError):
            folder.rmdir()


_made: list[Path] = []
_output: list[Path] = []


def output_folder() -> Path | None:
    """The folder that this command writes to, once it has made it."""
    return _output[-1] if _output else None


def write_json(path: Path, summary: dict[str, Any], item: str | None = None) -> Path:
    """Write a summary file with ``made_by``: command, versions, solver, inputs and seed, which ``labsim rerun`` goes by.

    item : the input of one measurement of many.
    """
    if (made_by := _provenance.describe()) is not None or item is not None:
        summary[_provenance.KEY] = {**(made_by or {}), **({"item": item} if item else {})}
    return text_files.write_json(path, summary)


def shorten_path(path: Path) -> str:
    """As seen from the current directory, where it lies in there."""
    here = Path.cwd().resolve()
    return str(path.relative_to(here) if here in path.parents else path)


def finish(
    summary: dict[str, Any], lines: str, *, as_json: bool, quiet: bool, folder: Path | None = None
) -> None:
    """Last words of a command: JSON where asked for, otherwise the lines a person reads.

    folder : where the lines are kept as summary.txt, which ``labsim.load`` shows again.
    """
    if folder is not None:
        (folder / SAID).write_text(lines + "\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps(text_files.make_finite(summary), ensure_ascii=False, allow_nan=False))
    elif not quiet:
        typer.echo(lines)


class Progress(Protocol):
    """What long work calls: ``progress(done, total, text)``, as often as it likes, in any unit of work.

    A text is a stage. One that ends in ", N new" announces N runs; each further call is one run done.
    """

    def __call__(self, done: float, total: float, text: str) -> None: ...


OTHERS = ""  # of the stages: the one that all texts belong to that none of the others begins
CALIBRATE = ("nominal model", "sampling the posterior")
DIAGNOSE = ("nominal model", "what each cause changes", OTHERS, "sampling the posterior")
PUBLISHED = ("calibration runs", "sampling the posterior", "prediction runs")


class _Stage:
    """Where one stage of the work is, in the words of people; ``place`` as ``stage 2 of 4, ``."""

    def __init__(self, text: str, place: str = "") -> None:
        self.place = place
        text = re.sub(r"@[^ ,]+", "", text)  # a variant of a cause's shape is that cause
        found = re.fullmatch(r"(.*), (\d+) new", text)
        self.name, self.runs = (found[1], int(found[2])) if found else (text, 0)
        self.calls = 0
        self.done = False

    def tell(self, done: float, total: float) -> str:
        """Name of the stage, and the runs that are done of all where it consists of runs."""
        self.calls += 1
        name = self.place + self.name
        if not self.runs:
            return name
        return f"{name}, {min(self.calls - 1, self.runs) if done < total else self.runs} of {self.runs} runs"


class _Places:
    """Which of the announced stages a text belongs to. What comes back to an earlier one counts as the later: it costs little."""

    def __init__(self, stages: Sequence[str]) -> None:
        self.stages, self.reached = stages, 0

    def find(self, text: str) -> str:
        """``stage 2 of 4, ``; nothing where no stages are announced, or the text belongs to none."""
        begun = [name != OTHERS and text.startswith(name) for name in self.stages]
        if not any(begun) and OTHERS not in self.stages:
            return ""
        number = begun.index(True) if any(begun) else self.stages.index(OTHERS)
        self.reached = max(self.reached, number)
        return f"stage {self.reached + 1} of {len(self.stages)}, "


@contextmanager
def show_progress(quiet: bool, stages: Sequence[str] = ()) -> Iterator[Progress]:
    """A bar a stage with the time left on a terminal; elsewhere plain lines, one now and then (standard error both).

    stages : how the texts of each stage begin, in their order.
    """
    if quiet:
        yield lambda done, total, text: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            TaskProgressColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )
        from rich.progress import Progress as Bars

        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            TaskProgressColumn(),
            TextColumn("elapsed"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
            shown: dict[str, tuple[_Stage, Any]] = {}
            places = _Places(stages)

            def report(done: float, total: float, text: str) -> None:
                if text not in shown:
                    shown[text] = (_Stage(text, places.find(text)), bars.add_task(text, total=total))
                stage, task = shown[text]
                bars.update(task, completed=done, total=total, description=stage.tell(done, total))

            yield report
    else:
        yield _LineReport(stages)


class _LineReport:
    """Progress for logs: a line when a stage begins, every thirty seconds within it, and when it ends; nothing moves."""

    EVERY = 30.0  # s

    def __init__(self, stages: Sequence[str]) -> None:
        self.places, self.start = _Places(stages), time.monotonic()
        self.text, self.began, self.last, self.first = "", 0.0, 0.0, 0.0
        self.stage = _Stage("")

    def __call__(self, done: float, total: float, text: str) -> None:
        now = time.monotonic()
        if text != self.text:
            self.text, self.began, self.last, self.first = text, now, -math.inf, done
            self.stage = _Stage(text, self.places.find(text))
        said = self.stage.tell(done, total)
        ends = done >= total and not self.stage.done
        if self.stage.done or (now - self.last < self.EVERY and not ends):
            return
        self.last, self.stage.done = now, ends
        since = done - self.first  # what was done before the first call took an unknown time
        parts = [said]
        if total > 0:
            parts.append(f"{100 * done / total:.0f} %")
        if since > 0:
            parts.append(f"elapsed {say_time(now - self.start)}")
        if since > 0 and done < total:
            parts.append(f"about {say_time((now - self.began) * (total - done) / since)} left")
        typer.echo(", ".join(parts), err=True)


def say_time(seconds: float) -> str:
    """45 s, 12 min, 3.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
