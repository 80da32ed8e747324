"""Small pieces of the sentences of a page: numbers, lists, units."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects import Parameter

SHOWN = {"Pa": (1e-3, "kPa"), "m": (1e3, "mm"), "1/m": (1e-3, "1/mm"), "1": (1.0, "")}  # to what people see


def shown_unit(parameter: Parameter) -> tuple[float, str]:
    return SHOWN.get(parameter.unit, (1.0, parameter.unit))


def add_article(label: str) -> str:
    return "the nominal model" if label == "nominal" else label


def say_count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def list_names(names: Sequence[str]) -> str:
    return ", ".join(names)


def say_range(values: Sequence[float], form: str) -> str:
    if not values:
        return "–"
    low, high = form.format(min(values)), form.format(max(values))
    return low if low == high else f"{low} to {high}"
