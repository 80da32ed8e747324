"""``labsim rerun``: does a result come out again, number for number?"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import LabsimError
from ..text_files import load_json
from . import _provenance, options
from ._compare import Comparison, compare_folders

SUMMARIES = (
    "diagnosis.json",
    "calibration.json",
    "run.json",
    "drop.json",
    "scan.json",
    "tracks.json",
    "scans.json",
)
REPEATABLE = ("simulate", "calibrate", "diagnose", "demo", "track", "ct")  # write into --out alone
DIFFERENT = 1  # exit status


def rerun(
    made: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of an earlier command.")],
    out: options.Out = None,
    stored: Annotated[
        bool, typer.Option("--stored", help="Take runs from the usual store instead of simulating all again.")
    ] = False,
    tolerance: Annotated[
        float, typer.Option("--tolerance", min=0.0, help="Relative difference that counts as the same.")
    ] = 0.0,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Repeat what made OUT in a new folder and compare every number; exit status 0 the same, 1 different."""
    made_by = read_made_by(made)
    command = made_by["command"][1:]
    folder = options.make_output_folder(out, made.resolve(), "rerun")
    again = folder / "again"
    arguments = strip(command, keep_store=stored)
    arguments += ["--out", str(again), "--quiet"]
    for name, value in (("--workers", workers), ("--scheduler", scheduler)):
        if value is not None:
            arguments += [name, str(value)]
    if not stored:
        os.environ["LABSIM_STORE"] = str(folder / "runs")
    repeat(arguments, Path(made_by["folder"]), quiet)
    changed = list_changes(made_by)
    found = compare_folders(made, again, tolerance)
    summary = {
        "same": found.same,
        "numbers": found.numbers,
        "files": found.files,
        "not_compared": found.skipped,
        "differences": found.differences,
        "changed_since": changed,
        "repeated_in": str(again),
    }
    options.write_json(folder / "rerun.json", summary)
    options.finish(summary, tell(found, changed, again), as_json=as_json, quiet=quiet)
    if not found.same:
        raise typer.Exit(DIFFERENT)


def read_made_by(folder: Path) -> dict[str, Any]:
    """``made_by`` of the summary in an output folder. Raises LabsimError where there is none."""
    if not folder.is_dir():
        raise LabsimError(folder, "OUT", "is not a folder; name the output folder of an earlier command")
    for name in SUMMARIES:
        file = folder / name
        if not file.is_file():
            continue
        summary = load_json(file, LabsimError, "name the output folder of an earlier command")
        made_by = summary.get(_provenance.KEY) if isinstance(summary, dict) else None
        shape = {"command": list, "folder": str, "versions": dict, "solver": str, "inputs": dict}
        if not isinstance(made_by, dict) or any(
            not isinstance(made_by.get(key), kind) for key, kind in shape.items()
        ):
            raise LabsimError(file, _provenance.KEY, "is missing; make the result with this version first")
        _check_command(file, made_by)
        for path in made_by["inputs"]:
            if not Path(path).exists():
                raise LabsimError(path, "", f"is gone; {folder} was made from it")
        return made_by
    raise LabsimError(folder, "OUT", f"holds no summary of labsim ({', '.join(SUMMARIES)})")


def _check_command(file: Path, made_by: dict[str, Any]) -> None:
    """A summary is a file like any other: whatever it says, nothing is run but what makes such a summary."""
    command = made_by["command"]
    if not all(isinstance(each, str) and "\0" not in each for each in command) or len(command) < 2:
        raise LabsimError(
            file, f"{_provenance.KEY}.command", "is not a command of labsim; make the result again"
        )
    if command[1] not in REPEATABLE:
        said = f"{command[1][:80]!r} is not repeated; only {', '.join(REPEATABLE)} are"
        raise LabsimError(file, f"{_provenance.KEY}.command", said)
    for key in ("versions", "inputs"):
        for name, value in made_by[key].items():
            if not isinstance(value, str):
                said = f"{value!r:.80} is not a text; make the result again"
                raise LabsimError(file, f"{_provenance.KEY}.{key}.{name}", said)


def strip(command: list[str], *, keep_store: bool) -> list[str]:
    """The command without what it wrote to and how it spoke."""
    valued = {"--out", "-o"} | (set() if keep_store else {"--store"})
    kept, skip = [], False
    for argument in command:
        if skip:
            skip = False
        elif argument in valued:
            skip = True
        elif argument.partition("=")[0] not in valued and argument not in _provenance.FLAGS:
            kept.append(argument)
    return kept


def list_changes(made_by: dict[str, Any]) -> dict[str, list[str]]:
    """What is not as it was: name -> [then, now]."""
    from ..sph import solver_hash

    now = _provenance.list_versions()
    changes = {
        name: [old, now.get(name, "gone")]
        for name, old in made_by["versions"].items()
        if now.get(name) != old
    }
    if made_by["solver"] != solver_hash():
        changes["solver"] = [made_by["solver"], solver_hash()]
    for path, old in made_by["inputs"].items():
        if (new := _provenance.hash_input(Path(path))) != old:
            changes[path] = [old[:16], new[:16]]
    return changes


def repeat(arguments: list[str], folder: Path, quiet: bool) -> None:
    """Run a command of labsim in this process, from the folder it was run from."""
    from . import app

    if not folder.is_dir():
        raise LabsimError(folder, f"{_provenance.KEY}.folder", "is gone; the command was started there")
    if not quiet:
        typer.echo("labsim " + " ".join(arguments), err=True)
    here, before = Path.cwd(), list(_provenance._arguments)
    try:
        os.chdir(folder)
        _provenance.remember(arguments)
        app(args=arguments, prog_name="labsim", standalone_mode=False)
    finally:
        os.chdir(here)
        _provenance.remember(before)


def tell(found: Comparison, changed: dict[str, list[str]], again: Path) -> str:
    lines = [f"changed since: {name}: {old} -> {new}" for name, (old, new) in changed.items()]
    if found.same:
        lines.append(f"the same: {found.numbers} numbers in {found.files} files; repeated in {again}")
    else:
        lines += found.differences[:20]
        if len(found.differences) > 20:
            lines.append(f"... and {len(found.differences) - 20} more (rerun.json)")
        lines.append(
            f"different in {len(found.differences)} places of {found.files} files; repeated in {again}"
        )
    return "\n".join(lines)
