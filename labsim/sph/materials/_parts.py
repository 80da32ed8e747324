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


@compiled
def find_strain_rates(lxx, lzz, lxz, lzx, div):
    """Deviatoric strain rates xx, zz, xz and the spin, 1/s, of a velocity gradient whose trace, hoop strain included, is ``div``."""
    third = 1.0 / 3.0
    return lxx - div * third, lzz - div * third, 0.5 * (lxz + lzx), 0.5 * (lxz - lzx)


@compiled
def shear_elastically(dt, shear, exx, ezz, exz, spin, sxx, szz, sxz):
    """Deviatoric stress xx, zz, xz (Pa) after a step with Jaumann's rate and the shear modulus ``shear`` (Pa)."""
    a = sxx + dt * (2.0 * shear * exx + 2.0 * spin * sxz)
    c = szz + dt * (2.0 * shear * ezz - 2.0 * spin * sxz)
    b = sxz + dt * (2.0 * shear * exz + spin * (szz - sxx))
    return a, c, b


@compiled
def measure_shear(a, c, b):
    """3 J2 of a deviatoric stress xx, zz, xz, Pa²: the square of q."""
    return 1.5 * (a * a + c * c + (a + c) * (a + c)) + 3.0 * b * b


@compiled
def return_radially(a, c, b, yield2):
    """Deviatoric stress xx, zz, xz, shortened to √(3 J2) = √yield2 where it is longer."""
    q2 = measure_shear(a, c, b)
    f = math.sqrt(yield2 / max(max(q2, yield2), 1.0e-300))
    return a * f, c * f, b * f


@compiled
def find_power(div, exx, ezz, exz, hoop, p, sxx, szz, sxz):
    """Power of pressure and deviatoric stress on a strain rate, W/m³."""
    return -p * div + sxx * exx + szz * ezz + 2.0 * sxz * exz - (sxx + szz) * (hoop - div * (1.0 / 3.0))
