"""``labsim check``: say what is in a campaign, what is missing, what looks odd."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import describe_campaign, read_campaign
from ..effects.loading import list_own_files
from ..errors import LabsimError
from ..records import Campaign
from . import options


def check(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder.")],
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Say what is in a campaign, what is missing and what looks odd."""
    read = read_campaign(campaign)
    from ..inference import observations
    from ..inspection import inspect_campaign  # needs heavy libraries, mistakes in the files do not

    with options.show_progress(quiet or as_json or not sys.stderr.isatty()) as progress:
        seen = inspect_campaign(read, progress)
    found, troubles, odd = seen.parts, seen.troubles, seen.all_odd
    wide = max((len(each.name) for each in found), default=0)
    summary = describe_campaign(read)
    lines = [summary["text"], "there:", *(f"  {each.name:{wide}}  {each.line}" for each in found)]
    own = [*list_own_files(read.folder).values(), *observations.list_own_files(read.folder)]
    code = [f"{file.parent.name}/{file.name}" for file in own]
    lines += [
        f"  {name}  code of this campaign: calibrate, diagnose and effects run it, check does not"
        for name in code
    ]
    inside = (
        f"{read.folder}/"  # names in the list are those inside the campaign; the error line has the whole
    )
    unreadable = [f"{name}: {str(trouble).replace(inside, '')}" for name, trouble in troubles.items()]
    for title, part in (("cannot be read", unreadable), ("odd", odd), ("missing", seen.missing)):
        if part:
            lines += [f"{title}:", *(f"  {line}" for line in part)]
    lines.append(f"{_count_unreadable(read, len(troubles))}; {_count_odd(len(odd), alone=not troubles)}")
    summary |= {
        "text": "\n".join(lines),
        "measured": {each.name: each.numbers for each in found},
        "unreadable": unreadable,
        "missing": seen.missing,
        "code": code,
        "warnings": odd,
    }
    options.finish(summary, summary["text"], as_json=as_json, quiet=quiet)
    if troubles:
        raise _join(troubles)


def _count_unreadable(campaign: Campaign, count: int) -> str:
    if not count:
        return "nothing is wrong with its files"
    return f"{count} of {len(campaign.drops) + len(campaign.scans)} drops and scans cannot be read"


def _count_odd(count: int, *, alone: bool) -> str:
    if not count:
        return "nothing looks odd" if alone else "nothing else looks odd"
    return f"{count} thing{'s look' if count > 1 else ' looks'} odd"


def _join(troubles: dict[str, Any]) -> LabsimError:
    """The first trouble, and the names of what cannot be read besides."""
    (_, first), *others = troubles.items()
    more = f" (nor can {', '.join(name for name, _ in others)} be read)" if others else ""
    return LabsimError(first.where, first.key, first.message + more)
