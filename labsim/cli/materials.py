"""``labsim materials``: the laws that matter may follow, with their parameters."""

from __future__ import annotations

import textwrap
from typing import Annotated, Any

import typer

from ..sph.materials import SHELF, find_law, list_laws
from . import options

WIDE = 118  # columns that the table needs; a list below that, and into files


def materials(
    law: Annotated[
        str | None,
        typer.Argument(help="One law: its name, or a file of your own that ends in .py. Default: all."),
    ] = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """List the material laws: parameters, units, defaults, limits, sources, and which one is calibrated."""
    shown = [_summarise(name) for name in ([law] if law else list_laws())]
    if quiet or as_json:
        options.finish({"laws": shown}, "", as_json=as_json, quiet=quiet)
        return
    from rich.console import Console

    console = Console()
    for number, each in enumerate(shown):
        if number:
            console.print()
        console.print(f"{each['name']}: {each['title']}", highlight=False, markup=False, soft_wrap=True)
        if law:
            console.print(each["description"] + "\n", highlight=False, markup=False, soft_wrap=True)
        if console.width < WIDE:
            typer.echo("\n".join(_list_narrow(each)))
        else:
            console.print(_tabulate(each))


def _summarise(name: str) -> dict[str, Any]:
    module = find_law(name)
    title, _, rest = (module.__doc__ or "").strip().partition("\n")
    calibrated = module.CALIBRATED
    return {
        "name": SHELF.locate(name).stem,
        "title": title.rstrip("."),
        "description": rest.strip("\n"),
        "file": str(SHELF.locate(name)),
        "calibrated": {"name": calibrated.name, "range": [calibrated.low, calibrated.high]},
        "carries": list(module.State._fields),
        "parameters": [
            {
                "name": each.name,
                "unit": each.unit,
                "default": each.default,
                "limits": [each.low, each.high],
                "source": each.source,
            }
            for each in module.PARAMETERS
        ],
    }


def _say_calibrated(law: dict[str, Any], parameter: dict[str, Any]) -> str:
    low, high = law["calibrated"]["range"]
    return f"{low:g} to {high:g}" if parameter["name"] == law["calibrated"]["name"] else ""


def _tabulate(law: dict[str, Any]) -> Any:
    from rich.table import Table
    from rich.text import Text

    table = Table()
    for heading in ("parameter", "unit", "default", "limits", "calibrated"):
        table.add_column(heading, no_wrap=True)
    table.add_column("source", ratio=1)
    for each in law["parameters"]:
        low, high = each["limits"]
        cells = (each["name"], each["unit"], f"{each['default']:g}", f"{low:g} to {high:g}")
        table.add_row(*(Text(cell) for cell in (*cells, _say_calibrated(law, each), each["source"])))
    return table


def _list_narrow(law: dict[str, Any]) -> list[str]:
    lines = []
    for each in law["parameters"]:
        low, high = each["limits"]
        unit = "" if each["unit"] == "1" else f" {each['unit']}"
        found = _say_calibrated(law, each)
        words = f"{each['name']}: {each['default']:g}{unit}, {low:g} to {high:g}"
        words += (f", calibrated {found}" if found else "") + f" ({each['source']})"
        lines += textwrap.wrap(words, 96, initial_indent="    ", subsequent_indent="        ")
    return lines
