"""What several laws need: declared parameters, and a kernel. Part of every run's hash, unlike the laws themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import SimulationError
from .._jit import compiled

if TYPE_CHECKING:
    from ..setting import DropSetting

TERMS = {
    "strength_rate": 0.0,
    "pore_gas": 0.0,
    "strength_shape": (),
    "crust_excess": 0.0,
    "filling_gradient": 0.0,
}


@dataclass(frozen=True)
class Parameter:
    """One number of a law: its limits are those of ``Material.constants``, both included."""

    name: str
    unit: str
    low: float
    high: float
    default: float
    source: str


def read_parameters(setting: DropSetting, parameters: tuple[Parameter, ...]) -> list[float]:
    """The values of a law's parameters, in their order. Raises SimulationError where one is unknown or beyond its limits."""
    given = dict(setting.material.constants)
    known = {each.name for each in parameters}
    for name in given:
        if name not in known:
            raise SimulationError(
                "simulation", f"material.{name}", f"this law has {', '.join(sorted(known))}"
            )
    for each in parameters:
        value = given.get(each.name, each.default)
        if not (math.isfinite(value) and each.low <= value <= each.high):
            raise SimulationError(
                "simulation",
                f"material.{each.name}",
                f"is {value!r} {each.unit}; use {each.low:g} to {each.high:g}",
            )
    return [given.get(each.name, each.default) for each in parameters]


def refuse_terms(setting: DropSetting, allowed: tuple[str, ...] = ()) -> None:
    """Raise SimulationError where a setting asks for a term of the dust's law that a law has not."""
    for name, null in TERMS.items():
        if name not in allowed and getattr(setting, name) != null:
            raise SimulationError(
                "simulation", name, f"the law {setting.material.law} has no such term; leave it {null!r}"
            )


@compiled
def exponential(y):
    """e^y to 1e-14 for |y| < 1, without the library call that would keep a loop from being vectorised."""
    y *= 0.125
    e = 1.0 + y / 9.0
    for k in (8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0):
        e = 1.0 + e * y / k
    e *= e
    e *= e
    return e * e
