"""Porous dust: elastic-plastic, with the modified Sirono equation of state of Güttler et al. (2009), eqs. 4-6.

    p = Σ(φ) on compaction, K(φ0') (φ/φ0' - 1) between, T(φ) on extension; φ0' is the filling factor at zero stress

Σ, T, Y and K are those of ``labsim.sph.sirono``; the shear modulus is shear_to_bulk K. The deviatoric stress follows Jaumann's
rate and returns radially to √(3 J2) = Y (von Mises, hoop stress included).
Optional terms: Σ (1 + η ε̇ⁿ) (1 + μ log10(ε̇/ε̇0)) with ε̇ the rate of compression; trapped gas p + P0 ((1 - φi)/(1 - φ) - 1);
factors on Σ and on Y that go with the plastic shear strain, the sum of (√(3 J2) - Y)/(3 G) over all returns to the yield surface;
a factor on Σ that dust keeps from the depth where it lay; a factor on Σ that goes with the time since the start.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from labsim.records import FloatArray, Material
from labsim.sph import sirono
from labsim.sph._jit import compiled
from labsim.sph.materials import _parts as parts

if TYPE_CHECKING:
    from collections.abc import Callable

    from labsim.sph.setting import DropSetting
    from labsim.sph.state import Rows

SOURCE = "Güttler et al. (2009), eq. "
PARAMETERS = (  # those of the rate are in Material.constants, all others fields of Material, with the limits of campaigns
    parts.Parameter("p_m", "Pa", 1.0, 1e8, Material.p_m, SOURCE + "6, dynamic compression"),
    parts.Parameter("phi_1", "1", 0.0, 0.74, Material.phi_1, SOURCE + "6"),
    parts.Parameter("phi_2", "1", 0.01, 1.0, Material.phi_2, SOURCE + "6"),
    parts.Parameter("delta", "1", 0.01, 5.0, Material.delta, SOURCE + "6"),
    parts.Parameter("tensile_log10_a", "1", -5.0, 9.0, Material.tensile_log10_a, SOURCE + "5"),
    parts.Parameter("tensile_log10_b", "1", -20.0, 20.0, Material.tensile_log10_b, SOURCE + "5"),
    parts.Parameter("shear_factor", "1", 0.0, 100.0, Material.shear_factor, "Sirono (2004)"),
    parts.Parameter(
        "bulk_modulus", "Pa", 1e2, 1e9, Material.bulk_modulus, "at φ 0.15; others use 4.5 to 300 kPa"
    ),
    parts.Parameter("bulk_exponent", "1", 0.0, 15.0, Material.bulk_exponent, "Sirono (2004)"),
    parts.Parameter("shear_to_bulk", "1", 1e-3, 1.5, Material.shear_to_bulk, "Poisson's ratio 0.29"),
    *parts.RATE,
)
CALIBRATED = parts.Calibrated("p_m", 300.0, 6000.0)
TERMS = tuple(parts.TERMS)  # of a setting that it takes: all


LAYERS_PER_SPACING = 20  # entries of the table of what goes with the depth
STRAIN_TOP, STRAIN_SIZE = 4.0, 401  # of the table of what goes with the plastic strain; beyond it is constant
TIME_SIZE = 1001  # entries of the table of what goes with the time, which ends at its last knot
PER_STRAIN = (STRAIN_SIZE - 1) / STRAIN_TOP

sound_speed = parts.sound_speed


class State(NamedTuple):
    """Rows that this law carries: φ0', Σ and |T| at the particle's φ (Pa), and, where something goes with it, the plastic shear
    strain and the time since the start (s)."""

    zero_stress: FloatArray
    compressive: FloatArray
    tensile: FloatArray
    sheared: FloatArray
    age: FloatArray


class Tables(NamedTuple):
    """strengths : over φ; of_strain, shear_of_strain : factors on Σ and Y over the plastic strain, empty where both are one;
    of_depth : on Σ over the depth that dust lay at, empty where it is one; per_depth : its entries a metre; of_time, per_time :
    the same over the time since the start, and its entries a second."""

    strengths: sirono.Strengths
    of_strain: FloatArray
    shear_of_strain: FloatArray
    of_depth: FloatArray
    per_depth: float
    of_time: FloatArray
    per_time: float


class Constants(NamedTuple):
    """The law in numbers, Pa and kg/m³."""

    solid_density: float
    bulk_modulus: float
    bulk_exponent: float
    shear_to_bulk: float
    shear_factor: float
    rate: parts.Rate
    gas_pressure: float
    extras: tuple[int, ...]  # empty: no term below, exponent 4 of K. A type, so known to the compiler


def start(setting: DropSetting, phi: FloatArray, pressure: FloatArray | float) -> tuple[State, FloatArray]:
    """Own rows of dust at rest under an elastic pressure (Pa), and its sound speed (m/s)."""
    material = setting.material
    stiffness = sirono.bulk_modulus(phi, material)
    sound = np.sqrt(stiffness * (1 + 4 / 3 * material.shear_to_bulk) / (phi * setting.monomer_density))
    nothing = np.zeros(phi.size)
    zero_stress = sirono.zero_stress_filling_factor(phi, nothing + pressure, material)
    return State(zero_stress, nothing, nothing, nothing, nothing), sound


def bearable_pressure(setting: DropSetting, phi: FloatArray) -> FloatArray:
    """What dust at rest may carry without crushing, Pa."""
    weakest = min((factor for _, factor in setting.strength_of_depth), default=1.0)
    weakest *= setting.strength_of_time[0][1] if setting.strength_of_time else 1.0
    return 0.8 * min(weakest, 1.0) * sirono.compressive_strength(phi, setting.material)


def resistance(setting: DropSetting) -> float:
    """Strength (Pa) that decides how deep a projectile goes; it only sizes boxes."""
    return setting.material.p_m * min(setting.material.shear_factor, 1.0)


def check(setting: DropSetting, refuse: Callable[[str, str], None]) -> None:
    """Refuse (key, reason) what lies outside the limits of the law."""
    make_constants(setting)
    low, high, p_m = setting.material.phi_1, setting.material.phi_2, setting.material.p_m
    graded = setting.filling_gradient * min(setting.extent[1], setting.graded_depth)
    for added in (0.0, setting.crust_excess, graded):
        phi = setting.filling_factor + added
        if not low < phi < high:
            refuse("filling_factor", f"{phi:.4g} lies outside ({low:.4g}, {high:.4g}), where Σ(φ) is defined")
    if not p_m > 0:
        refuse("material.p_m", f"is {p_m!r} Pa; it must be positive")


def find_warnings(setting: DropSetting, s: Rows, own: State) -> list[str]:
    """What a user should know of the state at the stop."""
    clamped = np.mean(s.density / setting.monomer_density > setting.material.phi_2 - sirono.EDGE)
    warning = f"φ was at its upper limit φ2 in {100 * clamped:.2g} % of the particles"
    return [warning] if clamped > 1e-3 else []


def make_constants(setting: DropSetting) -> Constants:
    """The numbers of the law as the compiled update wants them."""
    material = setting.material
    (rate,) = parts.read_parameters(setting, parts.RATE)
    of_strain = setting.strength_of_strain or setting.shear_of_strain
    tabled = of_strain or setting.strength_of_depth or setting.strength_of_time
    plain = material.bulk_exponent == 4.0 and not rate.on and setting.pore_gas == 0.0 and not tabled
    extras = () if plain else (1,)
    return Constants(
        setting.monomer_density, material.bulk_modulus, material.bulk_exponent, material.shear_to_bulk,
        material.shear_factor, rate._replace(on=extras), setting.pore_gas, extras,
    )  # fmt: skip


def make_tables(setting: DropSetting) -> Tables:
    """What the compiled update looks up."""
    strengths = sirono.tabulate_strengths(setting.material, setting.strength_shape)
    places = (*_tabulate_layers(setting), *_tabulate_times(setting))
    if not (setting.strength_of_strain or setting.shear_of_strain):
        return Tables(strengths, np.zeros(0), np.zeros(0), *places)
    strain = np.linspace(0.0, STRAIN_TOP, STRAIN_SIZE)
    of_strain, shear_of_strain = (
        np.interp(strain, *np.asarray(law or ((0.0, 1.0),), dtype=float).T)
        for law in (setting.strength_of_strain, setting.shear_of_strain)
    )
    return Tables(strengths, of_strain, shear_of_strain, *places)


def _tabulate_layers(setting: DropSetting) -> tuple[FloatArray, float]:
    """Factors on Σ over the depth, and their number a metre. A particle has the harmonic mean over its spacing: layers bear one
    pressure one after another, and what each gives way adds up."""
    if not setting.strength_of_depth:
        return np.zeros(0), 0.0
    fine = LAYERS_PER_SPACING
    depth = (np.arange(round(setting.extent[1] / setting.spacing) * fine + fine + 1) - fine / 2) * (
        setting.spacing / fine
    )
    factor = np.interp(depth, *np.asarray(setting.strength_of_depth, dtype=float).T)
    trapezoid = np.ones(fine + 1) / fine
    trapezoid[[0, -1]] *= 0.5
    return 1.0 / np.convolve(1.0 / factor, trapezoid, "valid"), fine / setting.spacing


def _tabulate_times(setting: DropSetting) -> tuple[FloatArray, float]:
    """Factors on Σ over the time since the start, and their number a second."""
    if not setting.strength_of_time:
        return np.zeros(0), 0.0
    times, factors = np.asarray(setting.strength_of_time, dtype=float).T
    last = max(float(times[-1]), 1e-9)
    return np.interp(np.linspace(0.0, last, TIME_SIZE), times, factors), (TIME_SIZE - 1) / last


@compiled
def interpolate(factors, position):
    """A factor at a place in its table, counted in entries; beyond the ends it is constant."""
    place = min(max(position, 0.0), factors.size - 1.001)
    cell = np.uint64(place)
    return factors[cell] + (place - cell) * (factors[cell + np.uint64(1)] - factors[cell])


@compiled
def update(low, high, dt, axisymmetric, s, own, constants, tables):
    """One step of the material for particles low..high-1: velocity gradient in, density, φ0' and stress out. Plastic state is
    committed here, once per step. exchange: growth of volume, 1/s, by exchange with neighbours. work: stress power spent so far,
    per mass; exchanged: what of it pressure gave up in the exchange; crushing: rate at which φ0' grew, 1/s.

    Without extras (no optional term, exponent 4 of K) the loop has no branch and no call, and is vectorised.
    """
    solid_density, k0, gamma = constants.solid_density, constants.bulk_modulus, constants.bulk_exponent
    shear_to_bulk, shear_factor, gas = constants.shear_to_bulk, constants.shear_factor, constants.gas_pressure
    plain = len(constants.extras) == 0
    r, vr, lxx, lxz, lzx, lzz, rho, exchange = s.ring, s.u, s.lxx, s.lxz, s.lzx, s.lzz, s.density, s.exchange
    phi_zero, compressive, tensile, phi_initial = own.zero_stress, own.compressive, own.tensile, s.initial
    sheared, strained = own.sheared, not plain and tables.of_strain.size > 0
    laid, layered = s.laid, not plain and tables.of_depth.size > 0
    age, aging = own.age, not plain and tables.of_time.size > 0
    sxx, szz, sxz, pressure, sound = s.sxx, s.szz, s.sxz, s.pressure, s.sound
    work, exchanged, crushing, yield_square = s.work, s.exchanged, s.crushing, s.yield_square
    inverse_step = (sirono.TABLE_SIZE - 1) / sirono.TABLE_TOP / solid_density
    hoops = 1.0 if axisymmetric else 0.0
    per_dt = 1.0 / dt if dt > 0.0 else 0.0
    # three loops, because one that looks up a table cannot be vectorised
    for i in range(low, high):
        rho[i] *= parts.exponential(-dt * (lxx[i] + lzz[i] + hoops * vr[i] / r[i] + exchange[i]))
    for i in range(low, high):
        compressive[i], tensile[i] = sirono.look_up(tables.strengths, rho[i] * inverse_step)
        yield_square[i] = shear_factor * shear_factor * compressive[i] * tensile[i]
    for i in range(low, high):
        hoop = hoops * vr[i] / r[i]
        div = lxx[i] + lzz[i] + hoop
        rho_new = rho[i]
        rho_old = rho_new / parts.exponential(-(div + exchange[i]) * dt)
        phi = rho_new * (1.0 / solid_density)
        strength, tension = compressive[i], tensile[i]
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        if not plain and div < 0.0:
            strength *= parts.strengthen(-div, constants.rate)
        if strained:
            strength *= interpolate(tables.of_strain, sheared[i] * PER_STRAIN)
        if layered:
            strength *= interpolate(tables.of_depth, laid[i] * tables.per_depth)
        if aging:
            age[i] += dt
            strength *= interpolate(tables.of_time, age[i] * tables.per_time)
        x = phi_zero[i]
        k = k0 * sirono.raise_to(x * (1.0 / 0.15), gamma, plain)
        trial = k * (phi / x - 1.0)
        p = min(max(trial, -tension), strength)
        if plain:
            moved = sirono.solve_zero_stress(phi, p, k0, gamma, plain)
            x = moved if p != trial else x
        elif p != trial:
            x = sirono.solve_zero_stress(phi, p, k0, gamma, plain)
        k = k0 * sirono.raise_to(x * (1.0 / 0.15), gamma, plain)
        crushing[i] += 0.2 * (max(x - phi_zero[i], 0.0) / phi_zero[i] * per_dt - crushing[i])
        phi_zero[i] = x
        shear = shear_to_bulk * k
        exx, ezz, exz, spin = parts.find_strain_rates(lxx[i], lzz[i], lxz[i], lzx[i], div)
        a, c, b = parts.shear_elastically(dt, shear, exx, ezz, exz, spin, sxx_old, szz_old, sxz_old)
        limit2 = shear_factor * shear_factor * strength * tension
        if strained:
            limit2 *= interpolate(tables.shear_of_strain, sheared[i] * PER_STRAIN) ** 2
            beyond = math.sqrt(parts.measure_shear(a, c, b)) - math.sqrt(limit2)
            sheared[i] += max(beyond, 0.0) / (3.0 * shear)
        a, c, b = parts.return_radially(a, c, b, limit2)
        if not plain:  # one array more and the loop would not be vectorised
            yield_square[i] = limit2
        sxx[i], szz[i], sxz[i] = a, c, b
        total = p
        stiffness = k * phi / x * (1.0 + 4.0 * (1.0 / 3.0) * shear_to_bulk)
        if not plain and gas > 0.0:
            total += gas * ((1.0 - phi_initial[i]) / (1.0 - phi) - 1.0)
            stiffness += gas * phi * (1.0 - phi_initial[i]) / (1.0 - phi) ** 2
        pressure[i] = total
        sound[i] = math.sqrt(stiffness / rho_new)
        p2, a, c, b = p_old + total, sxx_old + a, szz_old + c, sxz_old + b  # twice the mean stress
        power = parts.find_power(div, exx, ezz, exz, hoop, p2, a, c, b)
        work[i] += dt * power / (rho_old + rho_new)
        exchanged[i] += dt * p2 * exchange[i] / (rho_old + rho_new)


def elastic_energy(setting: DropSetting, s: Rows, own: State) -> FloatArray:
    """Held per mass, J/kg: by the volume between φ0' and φ, and by the deviatoric stress."""
    k = sirono.bulk_modulus(own.zero_stress, setting.material)
    volume = parts.find_volume_energy(s, setting.monomer_density * own.zero_stress, k)
    return np.asarray(volume + parts.find_shape_energy(s, setting.material.shear_to_bulk * k))
