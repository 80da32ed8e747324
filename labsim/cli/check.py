"""``labsim check``: say what is in a campaign, what is missing, what looks odd."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from ..campaign import describe_campaign, read_campaign
from ..effects.loading import list_own_files
from . import options


def check(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder.")],
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Say what is in a campaign, what is missing and what looks odd."""
    read = read_campaign(campaign)
    summary = describe_campaign(read)
    from ._inspect import (
        inspect_campaign,
        list_missing,
    )  # tracks and scans need heavy libraries, mistakes do not

    with options.show_progress(quiet or as_json or not sys.stderr.isatty()) as progress:
        drops, scans, scales = inspect_campaign(read, progress)
    missing = list_missing(read)
    odd = scales + [f"{found.name}: {text}" for found in (*drops, *scans) for text in found.odd]
    wide = max((len(found.name) for found in (*drops, *scans)), default=0)
    head, verdict = summary["text"].rsplit("\n", 1)
    lines = [head, "there:"]
    lines += [f"  {found.name:{wide}}  {found.line}" for found in (*drops, *scans)]
    code = [f"effects/{file.name}" for file in list_own_files(read.folder).values()]
    lines += [
        f"  {name}  code of this campaign: calibrate, diagnose and effects run it, check does not"
        for name in code
    ]
    if missing:
        lines += ["missing:", *(f"  {line}" for line in missing)]
    if odd:
        lines += ["odd:", *(f"  {line}" for line in odd)]
    said = f"{len(odd)} thing{'s look' if len(odd) > 1 else ' looks'} odd" if odd else "nothing looks odd"
    lines.append(f"{verdict}; {said}")
    summary |= {
        "text": "\n".join(lines),
        "measured": {found.name: found.numbers for found in (*drops, *scans)},
        "missing": missing,
        "code": code,
        "warnings": odd,
    }
    options.finish(summary, summary["text"], as_json=as_json, quiet=quiet)
