"""``labsim effects``: the catalogue of what a simulation can get wrong."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..effects import KINDS, Effect, Parameter, list_effects
from ..report.phrases import shown_unit
from . import options

WIDE = 130  # columns that the table needs; a list below that, and into files
KEY = (
    "Priors: a ± b normal, |0 ± b| its upper half, a ×/÷ b log-normal, a to b uniform; each with its reason in --json. "
    "Add your own as CAMPAIGN/effects/NAME.py (docs/effects.md)."
)


def effects(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            help="Campaign folder: its own effects join, and numbers are its own. Default: a usual one."
        ),
    ] = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """List what the simulation may get wrong: name, parameter, prior and what each leaves in the data."""
    read = read_campaign(campaign) if campaign is not None else None
    known = list_effects(read)
    reasons = {name: effect.applies(read) if read else "" for name, effect in known.items()}
    summary = {
        "campaign": read.name if read else None,
        "effects": [_summary(e, reasons[n]) for n, e in known.items()],
    }
    if quiet or as_json:
        options.finish(summary, "", as_json=as_json, quiet=quiet)
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if console.width < WIDE:
        typer.echo(_list_narrow(known, reasons))
        return
    table = Table(show_lines=True, title=f"{len(known)} effects", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("what is wrong", ratio=3)
    for heading in ("parameter", "unit", "prior"):
        table.add_column(heading, no_wrap=True)
    table.add_column("what it leaves in the data", ratio=6)
    for kind in KINDS:
        for name, effect in known.items():
            if effect.kind == kind:
                leaves = f"(not here: {reasons[name]}) {effect.leaves}" if reasons[name] else effect.leaves
                shown = [_show(parameter) for parameter in effect.parameters] or [("none: on or off", "", "")]
                columns = ("\n".join(lines) for lines in zip(*shown, strict=True))
                table.add_row(*(Text(cell) for cell in (name, f"{kind}: {effect.title}", *columns, leaves)))
    console.print(table)
    console.print(Text(KEY))


def _list_narrow(known: dict[str, Effect], reasons: dict[str, str]) -> str:
    lines = []
    for kind in KINDS:
        for name, effect in known.items():
            if effect.kind == kind:
                lines.append(f"{name} ({kind}): {effect.title}")
                for shown, unit, prior in map(_show, effect.parameters):
                    lines.append(f"    {shown}" + (f" in {unit}" if unit else "") + f", prior {prior}")
                if reasons[name]:
                    lines.append(f"    not here: {reasons[name]}")
                lines += textwrap.wrap(
                    effect.leaves, 96, initial_indent="    leaves: ", subsequent_indent="    "
                )
    return "\n".join([*lines, "", *textwrap.wrap(KEY, 100)])


def _show(parameter: Parameter) -> tuple[str, str, str]:
    """Symbol and name, the unit that people see, the prior in it."""
    factor, unit = shown_unit(parameter)
    prior = parameter.prior
    scaled = type(prior)(
        **{
            key: value if key == "sd_log" else value * factor
            for key, value in ((key, getattr(prior, key)) for key in prior.__dataclass_fields__)
        }
    )
    name = (
        parameter.name
        if parameter.symbol in ("", parameter.name)
        else f"{parameter.symbol} = {parameter.name}"
    )
    return name, unit, scaled.describe()


def _summary(effect: Effect, reason: str) -> dict[str, Any]:
    return {
        "name": effect.name,
        "title": effect.title,
        "kind": effect.kind,
        "description": effect.description,
        "leaves": effect.leaves,
        "expect": dict(effect.expect),
        "references": list(effect.references),
        "costs_runs": effect.costs_runs,
        "applies": not reason,
        "reason_against": reason,
        "file": effect.file,
        "parameters": [
            {
                "name": f"{effect.name}.{parameter.name}",
                "symbol": parameter.symbol or parameter.name,
                "unit": parameter.unit,
                "null": None if parameter.shape else parameter.null,
                "default": parameter.null,
                "shape": parameter.shape,
                "limits": list(parameter.limits),
                "step": parameter.step,
                "prior": {"law": type(parameter.prior).__name__}
                | {key: getattr(parameter.prior, key) for key in parameter.prior.__dataclass_fields__},
                "prior_reason": parameter.text,
                "scale": parameter.scale if math.isfinite(parameter.scale) else None,
            }
            for parameter in effect.parameters
        ],
    }
