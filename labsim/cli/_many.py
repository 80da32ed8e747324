"""The same measurement of many drops or scans: here, on processes of this machine, or on the workers of a scheduler.

A worker gets the folder of one item (its path here, its files where the worker may have no disk in common), measures in
a folder of its own, and sends back the files; they are written here, the summary last. An item whose summary is there and
was made from the same input by the same labsim is not measured again.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from ..errors import LabsimError
from ..runs.workers import explain_loss, open_executor, wait_for_any
from ..text_files import load_json
from . import _provenance, options

Measure = Callable[
    [Path, Path, dict[str, Any]], tuple[dict[str, Any], str]
]  # source, target, given -> summary, lines
Files = dict[str, bytes]
LARGEST_SENT = 1 << 31  # bytes of one item through a scheduler
FAILED = "failed.json"  # why there is no summary among the files of one measurement; it stays with the sender


@dataclass(frozen=True)
class Item:
    """source : its folder; given : options of the measurement."""

    name: str
    source: Path
    given: dict[str, Any]


def measure_many(
    measure: Measure,
    summary_name: str,
    items: Sequence[Item],
    out: Path,
    *,
    workers: int | None,
    scheduler: str | None,
    progress: options.Progress,
) -> dict[str, Any]:
    """Measure all items into ``out/NAME/``; the summary of all. An item that cannot be measured does not stop the others."""
    marks = {item.name: _mark(item) for item in items}
    found = {item.name: _find(out / item.name / summary_name, marks[item.name]) for item in items}
    todo = [item for item in items if found[item.name] is None]
    failed: dict[str, str] = {}
    text = f"{len(todo)} of {len(items)} to measure"
    if todo:
        progress(0, len(todo), text)
        done = 0
        with open_executor(workers, scheduler, len(todo), compile_first=False) as (executor, slots):
            running: dict[Future, Item] = {}
            waiting = list(todo)
            while waiting or running:
                while waiting and len(running) < slots:
                    item = waiting.pop(0)
                    source = item.source if scheduler is None else (item.name, _pack(item.source))
                    running[executor.submit(measure_one, measure, source, item.given)] = item
                for future in wait_for_any(executor, running):
                    item = running.pop(future)
                    try:
                        files = future.result()
                        found[item.name] = _write(files, out / item.name, summary_name, marks[item.name])
                    except LabsimError as trouble:
                        failed[item.name] = str(trouble)
                    except Exception as trouble:
                        if (loss := explain_loss(executor, trouble, item.source)) is None:
                            raise
                        raise loss from None
                    done += 1
                    progress(done, len(todo), text)
    return {
        "items": {name: summary for name, summary in found.items() if summary is not None},
        "failed": failed,
        "measured_new": len(todo) - len(failed),
        "reused": len(items) - len(todo),
    }


def finish_many(
    summary: dict[str, Any],
    file: Path,
    line: Callable[[str, dict[str, Any]], str],
    *,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write the summary of all items, say it, and raise where an item failed."""
    lines = [line(name, each) for name, each in summary["items"].items()]
    lines += [f"{name}: error: {text}" for name, text in summary["failed"].items()]
    lines.append(
        f"{summary['measured_new']} measured"
        + (f", {summary['reused']} from before" if summary["reused"] else "")
        + f"; written to {options.shorten_path(file.parent)}"
    )
    options.write_json(file, summary)
    options.finish(summary, "\n".join(lines), as_json=as_json, quiet=quiet, folder=file.parent)
    if summary["failed"]:
        name, text = next(iter(summary["failed"].items()))
        total = len(summary["failed"]) + len(summary["items"])
        raise LabsimError(
            file.parent, name, f"{len(summary['failed'])} of {total} failed, the first because {text}"
        )


def measure_one(measure: Measure, source: Path | tuple[str, Files], given: dict[str, Any]) -> Files:
    """What a worker does: the files of one measurement. source : its folder here, or its name and its files."""
    before = list(_provenance._arguments)
    _provenance.remember([])  # the caller says what made it
    try:
        with tempfile.TemporaryDirectory(prefix="labsim-") as folder:
            target = Path(folder, "out")
            target.mkdir()
            if isinstance(source, tuple):
                name, packed = source
                source = Path(folder, "in", name)
                for part, content in packed.items():
                    file = source / part
                    file.parent.mkdir(parents=True, exist_ok=True)
                    file.write_bytes(content)
            try:
                measure(source, target, given)
            except LabsimError as trouble:
                if not any(target.iterdir()):
                    raise
                (target / FAILED).write_text(json.dumps([trouble.where, trouble.key, trouble.message]))
            return {
                file.relative_to(target).as_posix(): file.read_bytes()
                for file in sorted(target.rglob("*"))
                if file.is_file()
            }
    finally:
        _provenance.remember(before)


def _pack(folder: Path) -> Files:
    """All files of a folder, links followed only to files inside it."""
    home = folder.resolve()
    files, size = {}, 0
    for file in sorted(folder.rglob("*")):
        if not file.is_file():
            continue
        if home not in file.resolve().parents:
            raise LabsimError(
                file, "", "leads out of its folder; copy the record there to send it to a scheduler"
            )
        size += file.stat().st_size
        if size > LARGEST_SENT:
            raise LabsimError(
                folder, "--scheduler", "holds more than 2 GB, too much to send; measure it here"
            )
        files[file.relative_to(folder).as_posix()] = file.read_bytes()
    return files


def _mark(item: Item) -> str:
    """Names input, options and versions of one measurement."""
    text = json.dumps([item.given, _provenance.list_versions(), _hash_code()], sort_keys=True, default=str)
    return hashlib.sha256((text + _provenance.hash_input(item.source)).encode()).hexdigest()


def _hash_code() -> str:
    """Of the packages that measure."""
    home = Path(__file__).parents[1]
    parts = [
        _provenance.hash_input(home / name)
        for name in ("video", "ct", "tracks", "tracking.py", "records.py", "campaign.py")
    ]
    return "".join(parts)


def _find(file: Path, mark: str) -> dict[str, Any] | None:
    try:
        summary = load_json(file, LabsimError, "it is made again")
        return summary if summary[_provenance.KEY]["item"] == mark else None
    except (LabsimError, KeyError, TypeError):
        return None


def _write(files: Files, target: Path, summary_name: str, mark: str) -> dict[str, Any]:
    """Each file aside and renamed, the summary last: where it is, the others are whole. Raises LabsimError where it failed."""
    target.mkdir(parents=True, exist_ok=True)
    (target / summary_name).unlink(missing_ok=True)
    for name, content in files.items():
        part = PurePosixPath(name)
        if part.is_absolute() or ".." in part.parts:
            raise LabsimError(target, name, "is no name of a result")
        if name in (summary_name, FAILED):
            continue
        file = target / part
        file.parent.mkdir(parents=True, exist_ok=True)
        aside = file.with_name(f".{file.name}.{os.getpid()}")
        aside.write_bytes(content)
        os.replace(aside, file)
    if FAILED in files:
        where, key, message = json.loads(files[FAILED])
        raise LabsimError(where, key, f"{message}; {target} holds what was seen")
    summary: dict[str, Any] = json.loads(files[summary_name])
    summary.pop("wall_s", None)
    options.write_json(target / summary_name, summary, item=mark)
    return summary
