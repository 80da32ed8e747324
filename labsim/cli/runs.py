"""``labsim runs``: what the store holds, whether it is sound, and making room."""

from __future__ import annotations

import time
from enum import StrEnum
from typing import Annotated

import typer

from ..errors import InferenceError
from ..report.pages.phrases import say_count
from ..runs.store import RunStore
from . import options


class Action(StrEnum):
    list = "list"
    verify = "verify"
    prune = "prune"


def runs(
    action: Annotated[
        Action, typer.Argument(help="list, verify (read every file whole), or prune.")
    ] = Action.list,
    failed: Annotated[bool, typer.Option("--failed", help="prune: remove failed runs too.")] = False,
    everything: Annotated[bool, typer.Option("--everything", help="prune: remove all runs.")] = False,
    last: Annotated[int, typer.Option("--last", min=0, help="list: so many lines, 0 for all.")] = 20,
    store: options.Store = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """List, verify or prune the stored runs; prune removes damaged files and runs of other solver versions."""
    opened = RunStore(store)
    if action is Action.verify:
        damaged = opened.verify()
        for file, reason in damaged:
            typer.echo(f"{file}: {reason}", err=True)
        total = len(list(opened.folder.glob("??/*.h5")))
        summary = {
            "store": opened.folder,
            "runs": total,
            "damaged": [str(f) for f, _ in damaged],
        }
        options.finish(
            summary,
            f"{opened.folder}: {say_count(total - len(damaged), 'run')} whole, {len(damaged)} damaged",
            as_json=as_json,
            quiet=quiet,
        )
        if damaged:
            raise InferenceError(
                opened.folder, "", f"{len(damaged)} of {total} files damaged; labsim runs prune removes them"
            )
        return
    if action is Action.prune:
        removed = opened.prune(failed=failed, everything=everything)
        left = len(opened.index())
        options.finish(
            {"store": opened.folder, "removed": removed, "runs": left},
            f"{opened.folder}: {say_count(removed, 'file')} removed, {say_count(left, 'run')} left",
            as_json=as_json,
            quiet=quiet,
        )
        return
    found = opened.index()
    size = sum(entry.bytes for entry in found)
    lines = [
        f"{entry.key[:12]}  {time.strftime('%Y-%m-%d %H:%M', time.localtime(entry.created))}  {entry.status:6s} "
        f"{entry.wall:7.1f} s  {entry.label}"
        for entry in found[: last or None]
    ]
    if len(found) > len(lines):
        lines.append(f"... and {len(found) - len(lines)} more (--last 0 shows all)")
    lines.append(f"{opened.folder}: {say_count(len(found), 'run')}, {size / 1e6:.1f} MB")
    summary = {"store": opened.folder, "runs": [entry.__dict__ for entry in found], "bytes": size}
    options.finish(summary, "\n".join(lines), as_json=as_json, quiet=quiet)
