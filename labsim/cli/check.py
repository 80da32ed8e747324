"""``labsim check``: read everything, say what is there and what is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..campaign import describe_campaign, read_campaign
from . import options


def check(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder.")],
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Read a campaign whole, say what is there and what is wrong."""
    summary = describe_campaign(read_campaign(campaign))
    options.finish(summary, summary["text"], as_json=as_json, quiet=quiet)
