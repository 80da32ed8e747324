"""What several laws need: declared parameters, and a kernel. Part of every run's hash, unlike the laws themselves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import SimulationError
from ...records import FloatArray
from .._jit import compiled
from ..plugins import Parameter
from . import find_law

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..setting import DropSetting
    from ..state import Rows

TERMS = {
    "strength_rate": 0.0,
    "pore_gas": 0.0,
    "strength_shape": (),
    "strength_of_strain": (),
    "shear_of_strain": (),
    "strength_of_depth": (),
    "strength_of_time": (),
    "crust_excess": 0.0,
    "filling_gradient": 0.0,
}


class Calibrated(NamedTuple):
    """The parameter that a calibration asks for where nothing else is said, and between which values."""

    name: str
    low: float
    high: float


RATE = (
    Parameter("rate_eta", "s^n", 0.0, 1e3, 0.0, "none; viscous overstress, Perzyna (1966)"),
    Parameter("rate_exponent", "1", 0.0, 1.0, 0.5, "square root of the rate; matters with rate_eta alone"),
    Parameter("rate_log", "1", 0.0, 1.0, 0.0, "none; clay 0.05 to 0.2 a decade, Einav & Randolph (2005)"),
    Parameter(
        "rate_reference", "1/s", 1e-9, 1e6, 3e-6, "laboratory shear test of 1 % an hour; with rate_log alone"
    ),
)


class Rate(NamedTuple):
    """Strength (1 + eta ε̇^exponent) (1 + log log10(ε̇/reference)), the second factor never below one; rates in 1/s."""

    eta: float
    exponent: float
    log: float
    reference: float
    on: tuple[int, ...]  # empty: strength does not depend on the rate. A type, so known to the compiler


def _read_rate(setting: DropSetting, eta: float, exponent: float, log: float, reference: float) -> Rate:
    """``strength_rate`` of a setting, an effect, is ``rate_eta`` by another name; both at once are refused."""
    if setting.strength_rate != 0.0:
        if eta != 0.0:
            raise SimulationError(
                "simulation", "strength_rate", "is the law's rate_eta by another name; give one of them"
            )
        eta, exponent = setting.strength_rate, setting.strength_rate_exponent
    return Rate(eta, exponent, log, reference, (1,) if eta > 0.0 or log > 0.0 else ())


def read_parameters(setting: DropSetting, parameters: tuple[Parameter, ...]) -> list[Any]:
    """The values of a law's parameters, in their order; RATE, at the end, becomes one Rate.

    Raises SimulationError where one is unknown or beyond its limits.
    """
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
    values: list[Any] = [given.get(each.name, each.default) for each in parameters]
    return (
        [*values[: -len(RATE)], _read_rate(setting, *values[-len(RATE) :])]
        if RATE[0] in parameters
        else values
    )


def refuse_terms(setting: DropSetting, allowed: tuple[str, ...] = ()) -> None:
    """Raise SimulationError where a setting asks for a term of the dust's law that a law has not."""
    for name, null in TERMS.items():
        if name not in allowed and getattr(setting, name) != null:
            raise SimulationError(
                "simulation", name, f"the law {setting.material.law} has no such term; leave it {null!r}"
            )


def make_constants(setting: DropSetting) -> Any:
    """Of a law whose Constants are its PARAMETERS, in their order, RATE as one."""
    law = find_law(setting.material.law)
    return law.Constants(*read_parameters(setting, law.PARAMETERS))


def check(setting: DropSetting, refuse: Callable[[str, str], None]) -> None:
    """Of a law with no more limits than those of its PARAMETERS and TERMS."""
    law = find_law(setting.material.law)
    law.make_constants(setting)
    refuse_terms(setting, getattr(law, "TERMS", ()))


class Tables(NamedTuple):
    """Of a law that looks nothing up."""

    none: FloatArray


def make_tables(setting: DropSetting) -> Tables:
    """Of a law that looks nothing up."""
    return Tables(np.zeros(1))


def bearable_pressure(setting: DropSetting, phi: FloatArray) -> FloatArray:
    """Of a law that no pressure crushes."""
    return np.full_like(phi, np.inf)


def sound_speed(setting: DropSetting) -> float:
    """Of compression waves in undisturbed matter, m/s, as the law's start has it."""
    phi = np.array([setting.filling_factor])
    return float(find_law(setting.material.law).start(setting, phi, 0.0)[1][0])


def find_warnings(setting: DropSetting, s: Rows, own: Any) -> list[str]:
    """Of a law that has nothing to say at the stop."""
    return []


def find_shape_energy(s: Rows, shear_modulus: FloatArray | float) -> FloatArray:
    """Elastic energy of the deviatoric stress per mass, J/kg."""
    squared = s.sxx**2 + s.szz**2 + (s.sxx + s.szz) ** 2 + 2.0 * s.sxz**2
    return np.asarray(squared / (4.0 * shear_modulus * s.density))


def find_volume_energy(s: Rows, reference: FloatArray, bulk_modulus: FloatArray | float) -> FloatArray:
    """Elastic energy per mass, J/kg, of p = bulk_modulus (ρ/reference - 1)."""
    ratio = s.density / reference
    return np.asarray(bulk_modulus / reference * (np.log(ratio) + 1.0 / ratio - 1.0))


def gas_energy(setting: DropSetting, s: Rows) -> FloatArray:
    """Energy held per mass, J/kg, by trapped gas (isothermal) since the pores were as at ``initial`` φ: all of it comes back.

    ∫ P0 ((1 - φi)/(1 - φ) - 1) dφ/(ρs φ²) from φi to φ.
    """
    initial, gas_pressure, monomer_density = s.initial, setting.pore_gas, setting.monomer_density
    if gas_pressure == 0.0:
        return np.zeros_like(initial)
    phi = s.density / monomer_density

    def primitive(at: FloatArray) -> FloatArray:
        return (1.0 - initial) * (np.log(at / (1.0 - at)) - 1.0 / at) + 1.0 / at

    return gas_pressure / monomer_density * (primitive(phi) - primitive(initial))


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
    """Deviatoric strain rates xx, zz, xz and the spin, 1/s, of a velocity gradient; ``div`` with the hoop strain."""
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


@compiled
def strengthen(strain_rate, rate):
    """Factor on a strength at a strain rate, 1/s: -div v against compaction, ``find_shear_rate`` against shear."""
    factor = 1.0
    if rate.eta > 0.0:
        factor *= 1.0 + rate.eta * strain_rate**rate.exponent
    if rate.log > 0.0:
        factor *= 1.0 + rate.log * math.log10(max(strain_rate / rate.reference, 1.0))
    return factor


@compiled
def find_shear_rate(exx, ezz, exz):
    """√(2/3 e:e) of a deviatoric strain rate, 1/s: what the axis of a triaxial test strains at when its volume stays."""
    return 2.0 / 3.0 * math.sqrt(measure_shear(exx, ezz, exz))
