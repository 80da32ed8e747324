"""``labsim effects``: the catalogue of what a simulation can get wrong."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..effects import KINDS, Effect, Parameter, list_effects
from ..effects.model import read_model
from ..effects.terms import list_terms
from ..errors import EffectError
from ..report.pages.phrases import shown_unit
from . import options

WIDE = 130  # columns that the table needs; a list below that, and into files
KEY = (
    "Priors: a ± b normal, |0 ± b| its upper half, a ×/÷ b log-normal, a to b uniform; each with its reason in --json. "
    "Add your own as CAMPAIGN/effects/NAME.py (docs/effects-writing.md)."
)

LEARNED = '''"""{term.title}, learned by labsim diagnose ({out}).

{term.source}.
"""

from labsim.effects import Normal, Parameter
from labsim.effects.terms import {verb}_term, list_terms

TERM = list_terms()["{name}"]

title = "{term.title}"
kind = "{kind}"
parameters = (
    Parameter(
        "coefficient",
        "{term.unit}",
        null=0.0,
        limits=({low:g}, {high:g}),
        prior=Normal(0.0, {size:g}),
        step={size:g},
        symbol="c",
        text="c times {term.formula}. As wide as what was learned is large; another campaign has to find it again.",
    ),
)
leaves = "What no listed cause left in the campaign that it was learned from."
references = ("{term.source}",)
expect = {{}}


def change_{of}({of}, values, place):
    return {verb}_term({of}, TERM, values["coefficient"]{more})
'''


def effects(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            help="Campaign folder: its own effects join, and numbers are its own. Default: a usual one."
        ),
    ] = None,
    learned: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Folder of a diagnosis that learned a formula: it becomes an effect of CAMPAIGN, or of the current folder.",
        ),
    ] = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """List what the simulation may get wrong: name, parameter, prior and what each leaves in the data."""
    if learned is not None:
        written = write_learned(learned, campaign or Path())
        lines = "\n".join(f"{path}: labsim diagnose tries it by name from now on" for path in written)
        options.finish({"written": [str(path) for path in written]}, lines, as_json=as_json, quiet=quiet)
        return
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


def write_learned(out: Path, campaign: Path) -> list[Path]:
    """Write each term of OUT's learned law as an effect of its own, CAMPAIGN/effects/NAME.py.

    Raises EffectError where OUT holds no such law, or an effect of that name is there already.
    """
    file = out / "model.toml"
    terms = read_model(file).law.terms
    if not terms:
        raise EffectError(file, "law", "holds no term; a diagnosis learns one where its verdict is unknown")
    written = []
    for name, coefficient in terms:
        term, path = list_terms()[name], campaign / "effects" / f"learned_{name}.py"
        if path.exists():
            raise EffectError(path, "effects", "is there already; rename or remove it")
        low, high = (min(max(limit, -1e9), 1e9) for limit in term.limits)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            LEARNED.format(
                term=term, name=name, out=out.name, low=low, high=high, size=float(f"{abs(coefficient):.3g}"),
                kind="measurement" if term.acts.see else "material" if "strength" in term.place else "contact",
                of="instrument" if term.acts.see else "setting", verb="see" if term.acts.see else "add",
                more=", place" if term.acts.see else "",
            ),
            encoding="utf-8",
        )  # fmt: skip
        written.append(path)
    return written


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
        "affects_simulation": effect.affects_simulation,
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
