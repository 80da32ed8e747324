"""Porous dust: elastic-plastic, with the modified Sirono equation of state of Güttler et al. (2009), eqs. 4-6.

    p = Σ(φ) on compaction, K(φ0') (φ/φ0' - 1) between, T(φ) on extension; φ0' is the filling factor at zero stress
    Σ(φ) = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10),  T(φ) = -10^(a + bφ) Pa,  Y(φ) = shear_factor √(Σ|T|)
    K(φ0') = K0 (φ0'/0.15)^γ,  μ = shear_to_bulk K

The strengths depend on φ alone and are tabulated; between φ1 + 0.002 and φ2 - 0.002 the table is the formula, below it
Σ keeps its value there (a powder without strength would never come to rest), above it goes on along the tangent.
The deviatoric stress follows Jaumann's rate and returns radially to √(3 J2) = Y (von Mises, hoop stress included).
Optional terms: Σ (1 + η ε̇ⁿ) (1 + μ log10(ε̇/ε̇0)) with ε̇ the rate of compression; trapped gas p + P0 ((1 - φi)/(1 - φ) - 1).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...records import FloatArray, Material
from .._jit import compiled
from ._parts import (
    RATE,
    Calibrated,
    Parameter,
    Rate,
    exponential,
    find_power,
    find_strain_rates,
    read_parameters,
    return_radially,
    shear_elastically,
    strengthen,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..setting import DropSetting
    from ..state import Rows

PARAMETERS = (  # those of the rate are in Material.constants, all others fields of Material, with the limits of campaigns
    Parameter("p_m", "Pa", 1.0, 1e8, Material.p_m, "Güttler et al. (2009), eq. 6, dynamic compression"),
    Parameter("phi_1", "1", 0.0, 0.74, Material.phi_1, "Güttler et al. (2009), eq. 6"),
    Parameter("phi_2", "1", 0.01, 1.0, Material.phi_2, "Güttler et al. (2009), eq. 6"),
    Parameter("delta", "1", 0.01, 5.0, Material.delta, "Güttler et al. (2009), eq. 6"),
    Parameter("tensile_log10_a", "1", -5.0, 9.0, Material.tensile_log10_a, "Güttler et al. (2009), eq. 5"),
    Parameter("tensile_log10_b", "1", -20.0, 20.0, Material.tensile_log10_b, "Güttler et al. (2009), eq. 5"),
    Parameter("shear_factor", "1", 0.0, 100.0, Material.shear_factor, "Sirono (2004)"),
    Parameter(
        "bulk_modulus", "Pa", 100.0, 1e9, Material.bulk_modulus, "at φ 0.15; others use 4.5 to 300 kPa"
    ),
    Parameter("bulk_exponent", "1", 0.0, 15.0, Material.bulk_exponent, "Sirono (2004)"),
    Parameter("shear_to_bulk", "1", 1e-3, 1.5, Material.shear_to_bulk, "Poisson's ratio 0.29"),
    *RATE,
)
CALIBRATED = Calibrated("p_m", 300.0, 6000.0)
TERMS = (
    "strength_rate",
    "pore_gas",
    "strength_shape",
    "crust_excess",
    "filling_gradient",
)  # of a setting that it takes
REFERENCE_FILLING_FACTOR = 0.15  # where bulk_modulus is stated
EDGE = 0.002  # distance in φ from the poles of Σ at which the table leaves the formula
TABLE_SIZE = 8193
TABLE_TOP = 0.75  # φ of the last entry


def compressive_strength(filling_factor: FloatArray, material: Material) -> FloatArray:
    """Σ(φ) in Pa, continued beyond its poles as the module says. Güttler et al. (2009), eq. 6."""
    phi = np.asarray(filling_factor, dtype=float)
    low, high = material.phi_1 + EDGE, material.phi_2 - EDGE
    inside = np.clip(phi, low, high)
    exponent = material.delta * math.log(10.0)
    ratio = (inside - material.phi_1) / (material.phi_2 - inside)
    strength = material.p_m * ratio**exponent
    slope = strength * exponent * (1 / (inside - material.phi_1) + 1 / (material.phi_2 - inside))
    return strength + np.where(phi > high, slope * (phi - high), 0.0)


def tensile_strength(filling_factor: FloatArray, material: Material) -> FloatArray:
    """T(φ) in Pa, negative. Güttler et al. (2009), eq. 5."""
    phi = np.asarray(filling_factor, dtype=float)
    return -(10.0 ** (material.tensile_log10_a + material.tensile_log10_b * phi))


def shear_strength(filling_factor: FloatArray, material: Material) -> FloatArray:
    """Y(φ) = shear_factor √(Σ|T|) in Pa, Sirono (2004)."""
    compressive = compressive_strength(filling_factor, material)
    return material.shear_factor * np.sqrt(compressive * -tensile_strength(filling_factor, material))


def bulk_modulus(zero_stress_filling_factor: FloatArray, material: Material) -> FloatArray:
    """K(φ0') in Pa."""
    ratio = np.asarray(zero_stress_filling_factor, dtype=float) / REFERENCE_FILLING_FACTOR
    return material.bulk_modulus * ratio**material.bulk_exponent


def tabulate_strengths(
    material: Material, shape: tuple[tuple[float, float], ...] = ()
) -> tuple[FloatArray, FloatArray]:
    """Σ and |T| at TABLE_SIZE values of φ from 0 to TABLE_TOP; shape multiplies Σ by a factor linear in φ."""
    phi = np.linspace(0.0, TABLE_TOP, TABLE_SIZE)
    strength = compressive_strength(phi, material)
    if shape:
        knots, factors = np.asarray(shape, dtype=float).T
        strength = strength * np.interp(phi, knots, factors)
    return strength, -tensile_strength(phi, material)


def zero_stress_filling_factor(phi: FloatArray, pressure: FloatArray, material: Material) -> FloatArray:
    """φ0' of dust at filling factor phi under an elastic pressure (Pa): ``solve_zero_stress`` for arrays."""
    x = phi / (1.0 + pressure / bulk_modulus(phi, material))
    for _ in range(3):
        k, ratio = bulk_modulus(x, material), phi / x
        slope = k / x * (material.bulk_exponent * (ratio - 1.0) - ratio)
        x = x - (k * (ratio - 1.0) - pressure) / slope
    return x


class State(NamedTuple):
    """Rows that this law carries: φ0', and Σ and |T| at the particle's φ (Pa)."""

    zero_stress: FloatArray
    compressive: FloatArray
    tensile: FloatArray


class Constants(NamedTuple):
    """The law in numbers, Pa and kg/m³."""

    solid_density: float
    bulk_modulus: float
    bulk_exponent: float
    shear_to_bulk: float
    shear_factor: float
    rate: Rate
    gas_pressure: float
    extras: tuple[int, ...]  # empty: no rate term, no gas, exponent 4 of K. A type, so known to the compiler


class Tables(NamedTuple):
    """Σ and |T|, Pa, at TABLE_SIZE values of φ from 0 to TABLE_TOP."""

    compressive: FloatArray
    tensile: FloatArray


def start(setting: DropSetting, phi: FloatArray, pressure: FloatArray | float) -> tuple[State, FloatArray]:
    """Own rows of dust at rest under an elastic pressure (Pa), and its sound speed (m/s)."""
    material = setting.material
    stiffness = bulk_modulus(phi, material)
    sound = np.sqrt(stiffness * (1 + 4 / 3 * material.shear_to_bulk) / (phi * setting.monomer_density))
    nothing = np.zeros(phi.size)
    return State(zero_stress_filling_factor(phi, nothing + pressure, material), nothing, nothing), sound


def bearable_pressure(setting: DropSetting, phi: FloatArray) -> FloatArray:
    """What dust at rest may carry without crushing, Pa."""
    return 0.8 * compressive_strength(phi, setting.material)


def resistance(setting: DropSetting) -> float:
    """Strength (Pa) that decides how deep a projectile goes; it only sizes boxes."""
    return setting.material.p_m * min(setting.material.shear_factor, 1.0)


def check(setting: DropSetting, refuse: Callable[[str, str], None]) -> None:
    """Refuse (key, reason) what lies outside the limits of the law."""
    material = setting.material
    make_constants(setting)
    low, high = material.phi_1, material.phi_2
    reachable = [setting.filling_factor, setting.filling_factor + setting.crust_excess]
    graded = min(setting.extent[1], setting.graded_depth)
    reachable.append(setting.filling_factor + setting.filling_gradient * graded)
    for phi in reachable:
        if not low < phi < high:
            refuse("filling_factor", f"{phi:.4g} lies outside ({low:.4g}, {high:.4g}), where Σ(φ) is defined")
    if not material.p_m > 0:
        refuse("material.p_m", f"is {material.p_m!r} Pa; it must be positive")


def sound_speed(setting: DropSetting) -> float:
    """Of compression waves in undisturbed dust, m/s."""
    stiffness = setting.material.bulk_modulus * (1 + 4 / 3 * setting.material.shear_to_bulk)
    return math.sqrt(stiffness / (setting.monomer_density * setting.filling_factor))


def find_warnings(setting: DropSetting, s: Rows, own: State) -> list[str]:
    """What a user should know of the state at the stop."""
    clamped = np.mean(s.density / setting.monomer_density > setting.material.phi_2 - 0.002)
    return (
        [f"φ was at its upper limit φ2 in {100 * clamped:.2g} % of the particles"] if clamped > 1e-3 else []
    )


def make_constants(setting: DropSetting) -> Constants:
    """The numbers of the law as the compiled update wants them."""
    material = setting.material
    (rate,) = read_parameters(setting, RATE)
    plain = material.bulk_exponent == 4.0 and not rate.on and setting.pore_gas == 0.0
    extras = () if plain else (1,)
    return Constants(
        setting.monomer_density, material.bulk_modulus, material.bulk_exponent, material.shear_to_bulk,
        material.shear_factor, rate._replace(on=extras), setting.pore_gas, extras,
    )  # fmt: skip


def make_tables(setting: DropSetting) -> Tables:
    """What the compiled update looks up."""
    return Tables(*tabulate_strengths(setting.material, setting.strength_shape))


@compiled
def _raise_to(ratio, gamma, fourth):
    """ratio ** gamma; the exponent of nearly every dust is 4 (``fourth``), and two products are far cheaper than a power."""
    return ratio * ratio * ratio * ratio if fourth else ratio**gamma


@compiled
def solve_zero_stress(phi, pressure, k0, gamma, fourth):
    """φ0' with K(φ0') (φ/φ0' - 1) = pressure, by Newton from the explicit estimate φ/(1 + p/K(φ))."""
    x = phi / (1.0 + pressure / (k0 * _raise_to(phi * (1.0 / 0.15), gamma, fourth)))
    for _ in range(3):
        k = k0 * _raise_to(x * (1.0 / 0.15), gamma, fourth)
        ratio = phi / x
        x -= x * (k * (ratio - 1.0) - pressure) / (k * (gamma * (ratio - 1.0) - ratio))
    return x


@compiled
def update(low, high, dt, axisymmetric, s, own, constants, tables):
    """One step of the material for particles low..high-1: velocity gradient in, density, φ0' and stress out. Plastic state is
    committed here, once per step. exchange: growth of volume, 1/s, by exchange with neighbours. work: stress power spent so far,
    per mass; exchanged: what of it pressure gave up in the exchange; crushing: rate at which φ0' grew, 1/s.

    Without extras (no rate term, no gas, exponent 4 of K) the loop has no branch and no call, and is vectorised.
    """
    solid_density, k0, gamma = constants.solid_density, constants.bulk_modulus, constants.bulk_exponent
    shear_to_bulk, shear_factor, gas_pressure = (
        constants.shear_to_bulk,
        constants.shear_factor,
        constants.gas_pressure,
    )
    plain = len(constants.extras) == 0
    strength_table, tension_table = tables.compressive, tables.tensile
    r, vr, lxx, lxz, lzx, lzz, rho, exchange = s.ring, s.u, s.lxx, s.lxz, s.lzx, s.lzz, s.density, s.exchange
    phi_zero, compressive, tensile, phi_initial = own.zero_stress, own.compressive, own.tensile, s.initial
    sxx, szz, sxz, pressure, sound = s.sxx, s.szz, s.sxz, s.pressure, s.sound
    work, exchanged, crushing, yield_square = s.work, s.exchanged, s.crushing, s.yield_square
    inverse_step = (TABLE_SIZE - 1) / TABLE_TOP / solid_density
    third = 1.0 / 3.0
    hoops = 1.0 if axisymmetric else 0.0
    top = strength_table.size - 2
    inverse_solid = 1.0 / solid_density
    per_dt = 1.0 / dt if dt > 0.0 else 0.0
    # three loops, because one that looks up a table cannot be vectorised
    for i in range(low, high):
        rho[i] *= exponential(-dt * (lxx[i] + lzz[i] + hoops * vr[i] / r[i] + exchange[i]))
    for i in range(low, high):
        position = rho[i] * inverse_step
        cell = np.uint64(min(max(int(position), 0), top))
        part = position - cell
        below, above = strength_table[cell], strength_table[cell + np.uint64(1)]
        compressive[i] = below + part * (above - below)
        below, above = tension_table[cell], tension_table[cell + np.uint64(1)]
        tensile[i] = below + part * (above - below)
        yield_square[i] = shear_factor * shear_factor * compressive[i] * tensile[i]
    for i in range(low, high):
        hoop = hoops * vr[i] / r[i]
        div = lxx[i] + lzz[i] + hoop
        rho_new = rho[i]
        rho_old = rho_new / exponential(-(div + exchange[i]) * dt)
        phi = rho_new * inverse_solid
        strength, tension = compressive[i], tensile[i]
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        if not plain and div < 0.0:
            strength *= strengthen(-div, constants.rate)
        x = phi_zero[i]
        k = k0 * _raise_to(x * (1.0 / 0.15), gamma, plain)
        trial = k * (phi / x - 1.0)
        p = min(max(trial, -tension), strength)
        if plain:
            moved = solve_zero_stress(phi, p, k0, gamma, plain)
            x = moved if p != trial else x
        elif p != trial:
            x = solve_zero_stress(phi, p, k0, gamma, plain)
        k = k0 * _raise_to(x * (1.0 / 0.15), gamma, plain)
        crushing[i] += 0.2 * (max(x - phi_zero[i], 0.0) / phi_zero[i] * per_dt - crushing[i])
        phi_zero[i] = x
        shear = shear_to_bulk * k
        exx, ezz, exz, spin = find_strain_rates(lxx[i], lzz[i], lxz[i], lzx[i], div)
        a, c, b = shear_elastically(dt, shear, exx, ezz, exz, spin, sxx_old, szz_old, sxz_old)
        limit2 = shear_factor * shear_factor * strength * tension
        a, c, b = return_radially(a, c, b, limit2)
        if not plain:  # one array more and the loop would not be vectorised
            yield_square[i] = limit2
        sxx[i], szz[i], sxz[i] = a, c, b
        total = p
        stiffness = k * phi / x * (1.0 + 4.0 * third * shear_to_bulk)
        if not plain and gas_pressure > 0.0:
            total += gas_pressure * ((1.0 - phi_initial[i]) / (1.0 - phi) - 1.0)
            stiffness += gas_pressure * phi * (1.0 - phi_initial[i]) / (1.0 - phi) ** 2
        pressure[i] = total
        sound[i] = math.sqrt(stiffness / rho_new)
        power = find_power(
            div, exx, ezz, exz, hoop, p_old + total, sxx_old + a, szz_old + c, sxz_old + b
        )  # of twice the mean stress
        work[i] += dt * power / (rho_old + rho_new)
        exchanged[i] += dt * (p_old + total) * exchange[i] / (rho_old + rho_new)


def elastic_energy(setting: DropSetting, s: Rows, own: State) -> FloatArray:
    """Elastic energy held per mass, J/kg: of the volume between φ0' and φ, and of the deviatoric stress."""
    material, monomer_density = setting.material, setting.monomer_density
    density, zero_stress, sxx, szz, sxz = s.density, own.zero_stress, s.sxx, s.szz, s.sxz
    k = bulk_modulus(zero_stress, material)
    ratio = density / (monomer_density * zero_stress)
    shape = sxx**2 + szz**2 + (sxx + szz) ** 2 + 2.0 * sxz**2
    volume = k / (monomer_density * zero_stress) * (np.log(ratio) + 1.0 / ratio - 1.0)
    return volume + shape / (4.0 * material.shear_to_bulk * k * density)


def gas_energy(setting: DropSetting, s: Rows) -> FloatArray:
    """Energy held per mass, J/kg, by trapped gas (isothermal) since the pores were as at ``initial`` φ: all of it comes back.

    ∫ P0 ((1 - φi)/(1 - φ) - 1) dφ/(ρs φ²) from φi to φ.
    """
    initial, gas_pressure, monomer_density = s.initial, setting.pore_gas, setting.monomer_density
    phi = s.density / monomer_density

    def primitive(at: FloatArray) -> FloatArray:
        return (1.0 - initial) * (np.log(at / (1.0 - at)) - 1.0 / at) + 1.0 / at

    return gas_pressure / monomer_density * (primitive(phi) - primitive(initial))
