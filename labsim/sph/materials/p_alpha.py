"""Porous solid with a crush curve (foams, rock, ice): the P-alpha law, isothermal, with von Mises strength.

    p = K (φ - 1/α)                       solid p_s = K (ρ_s/ρ_s0 - 1) under 1/α of itself, ρ_s = α ρ, α the distension
    α = 1 + (α_e - 1) ((crush_end - p)/(crush_end - crush_start))²  while it is crushed, 1 above crush_end
    1/α = φ0 + (1/h² - 1) p/K             else, so that p = K h² (φ - φ0): elastic, φ0 the filling factor at zero stress
    h = 1 + (α0 - 1)(elastic_speed - 1)/(α_start - 1), α0 = 1/φ0;  √(3 J2) ≤ 2 cohesion,  p ≥ -tension

Herrmann (1969), J. Appl. Phys. 40, 2490: crush curve and h, the sound speed over the solid's; 1/α in the pressure: Carroll & Holt
(1972), J. Appl. Phys. 43, 759. Herrmann's dα/dp = α² (1 - 1/h²)/K is integrated with the h of α0, which makes the elastic line
straight in φ. α_start = 1/φ of the setting, α_e that of crush_start on its line. Looser matter is crushed at crush_start.

Both solutions are exact to round-off: p on the curve is a cubic in x = (crush_end - p)/(crush_end - crush_start) that is concave
and falls, begun to the right of its root; φ0 is a smooth equation that begins next to its root. Five steps of Newton each.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from labsim.records import FloatArray
from labsim.sph._jit import compiled
from labsim.sph.materials import _parts as parts

if TYPE_CHECKING:
    from collections.abc import Callable

    from labsim.sph.setting import DropSetting
    from labsim.sph.state import Rows

PARAMETERS = (
    parts.Parameter("solid_modulus", "Pa", 1.0, 1e12, 1e7, "soft foam; solids, 1e9 and more, shorten steps"),
    parts.Parameter("elastic_speed", "1", 0.01, 1.0, 0.5, "sound speed of the foam over its solid's"),
    parts.Parameter("crush_start", "Pa", 1e-3, 1e11, 1e3, "end of the elastic range, soft foam"),
    parts.Parameter("crush_end", "Pa", 1e-2, 1e12, 1e5, "no pores are left, soft foam"),
    parts.Parameter("cohesion", "Pa", 0.0, 1e11, 1e3, "soft foam; 0: hydrostatic, as in Herrmann (1969)"),
    parts.Parameter("shear_modulus", "Pa", 1.0, 1e12, 1e5, "below half the porous body's bulk modulus"),
    parts.Parameter("tension", "Pa", 0.0, 1e12, 1e12, "none: holds together"),
    *parts.RATE,
)
CALIBRATED = parts.Calibrated("crush_end", 1e4, 1e7)
TERMS = ("strength_rate", "crust_excess", "filling_gradient")  # of a setting that it takes


class State(NamedTuple):
    distension: FloatArray  # α0, at zero stress


class Constants(NamedTuple):
    solid_modulus: float
    elastic_speed: float
    crush_start: float
    crush_end: float
    cohesion: float
    shear_modulus: float
    tension: float
    solid_density: float
    gain: float  # of h per distension lost
    start: float  # α_start
    excess: float  # α_e - 1
    rate: parts.Rate


make_tables = parts.make_tables  # nothing is looked up
sound_speed = parts.sound_speed
find_warnings = parts.find_warnings  # none


def make_constants(setting: DropSetting) -> Constants:
    *values, rate = parts.read_parameters(setting, PARAMETERS)
    modulus, speed, crush_start = values[:3]
    phi = setting.filling_factor
    gain = (1 - speed) / (1 / phi - 1) if phi < 1.0 else 0.0
    excess = 1 / (phi + (1 / speed**2 - 1) * crush_start / modulus) - 1
    return Constants._make([*values, setting.monomer_density, gain, 1 / phi, excess, rate])


def start(setting: DropSetting, phi: FloatArray, pressure: FloatArray | float) -> tuple[State, FloatArray]:
    """Own rows at rest under a pressure (Pa), and the sound speed (m/s)."""
    law = make_constants(setting)
    zero = np.array([solve_zero_stress(each, p, each, law) for each, p in np.broadcast(phi, pressure)])
    h = np.minimum(np.maximum(law.elastic_speed, 1 - law.gain * (1 / zero - 1)), 1.0)
    stiffness = law.solid_modulus * h**2 * phi + 4 / 3 * law.shear_modulus
    return State(1 / zero), np.sqrt(stiffness / (phi * law.solid_density))


def bearable_pressure(setting: DropSetting, phi: FloatArray) -> FloatArray:
    """What matter at rest may carry without compaction, Pa."""
    law = make_constants(setting)
    return np.array([0.9 * find_crushing(each, law, 1.0) for each in phi])


def resistance(setting: DropSetting) -> float:
    """About what a tip meets, Pa: halfway to the end in the logarithm."""
    law = make_constants(setting)
    return math.sqrt(law.crush_start * law.crush_end) + 8.0 * law.cohesion


def check(setting: DropSetting, refuse: Callable[[str, str], None]) -> None:
    law = make_constants(setting)
    parts.refuse_terms(setting, TERMS)
    phi = setting.filling_factor
    if not phi < 1.0:
        refuse("filling_factor", f"is {phi!r}; a porous solid is below 1")
    if not law.crush_start < law.crush_end < 0.5 * phi * law.solid_modulus:
        refuse(
            "material.crush_end",
            f"is {law.crush_end:g} Pa; use more than crush_start, less than filling_factor solid_modulus / 2",
        )
    distension = np.linspace(1.0, law.start, 1000)
    h = 1 - law.gain * (distension - 1)
    x = np.sqrt(np.minimum((distension - 1) / max(law.excess, 1e-300), 1.0))
    curve = law.crush_end - x * (law.crush_end - law.crush_start)
    if law.excess <= 0.0 or np.any(2 * law.gain * distension**2 * curve >= 0.9 * law.solid_modulus * h**3):
        refuse(
            "material.elastic_speed",
            f"is {law.elastic_speed:g}: it would stiffen faster than it is crushed; raise it or solid_modulus",
        )


def elastic_energy(setting: DropSetting, s: Rows, own: State) -> FloatArray:
    """Per mass, J/kg."""
    law = make_constants(setting)
    h = np.maximum(law.elastic_speed, 1 - law.gain * (own.distension - 1))
    stiffness = law.solid_modulus * h**2 / own.distension
    volume = parts.find_volume_energy(s, law.solid_density / own.distension, stiffness)
    return volume + parts.find_shape_energy(s, law.shear_modulus)


@compiled
def find_crushing(phi, law, factor):
    """Pressure at which matter of this filling factor is crushed, Pa; ``factor`` on both ends of the curve."""
    wide = factor * (law.crush_end - law.crush_start) / law.solid_modulus
    end = factor * law.crush_end / law.solid_modulus
    a, b = max(max(phi, 1.0 / law.start) - end, 1.0e-3), law.excess
    rest = max(1.0 - a, 0.0)
    x = min(math.sqrt(rest / (b * a)), 1.0)
    for _ in range(5):
        x += (rest - x * (wide + x * b * (a + x * wide))) / (wide + x * b * (2.0 * a + 3.0 * x * wide))
    x = min(max(x, 0.0), 1.0)
    return law.solid_modulus * max(end - x * wide, phi - 1.0)


@compiled
def solve_zero_stress(phi, p, before, law):
    """φ0 with K h(φ0)² (φ - φ0) = p, begun from the line of the φ0 ``before``."""
    ratio = p / law.solid_modulus
    h = max(law.elastic_speed, 1.0 - law.gain * (1.0 / before - 1.0))
    y = phi - ratio / (h * h)
    for _ in range(5):
        full = 1.0 - law.gain * (1.0 / y - 1.0)
        h, rise = max(law.elastic_speed, full), law.gain / (y * y) if full > law.elastic_speed else 0.0
        y -= (h * h * (phi - y) - ratio) / (2.0 * h * rise * (phi - y) - h * h)
    return y


@compiled
def update(low, high, dt, axisymmetric, s, own, constants, tables):
    """One step of particles low..high-1: velocity gradient in, density, stress, sound and the book of work out."""
    r, vr, lxx, lxz, lzx, lzz, rho, exchange = s.ring, s.u, s.lxx, s.lxz, s.lzx, s.lzz, s.density, s.exchange
    sxx, szz, sxz, pressure, sound, work = s.sxx, s.szz, s.sxz, s.pressure, s.sound, s.work
    exchanged, crushing, yield_square, distension = s.exchanged, s.crushing, s.yield_square, own.distension
    bulk, shear, hoops = constants.solid_modulus, constants.shear_modulus, 1.0 if axisymmetric else 0.0
    per_dt = 1.0 / dt if dt > 0.0 else 0.0
    for i in range(low, high):
        yield_square[i] = (2.0 * constants.cohesion) ** 2
    for i in range(low, high):
        hoop = hoops * vr[i] / r[i]
        div = lxx[i] + lzz[i] + hoop
        rho_old = rho[i]
        rho_new = rho_old * parts.exponential(-dt * (div + exchange[i]))
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        exx, ezz, exz, spin = parts.find_strain_rates(lxx[i], lzz[i], lxz[i], lzx[i], div)
        crush, rub = 1.0, 1.0
        if len(constants.rate.on) > 0:
            crush = parts.strengthen(max(-div, 0.0), constants.rate)
            rub = parts.strengthen(parts.find_shear_rate(exx, ezz, exz), constants.rate)
        phi = rho_new / constants.solid_density
        before = 1.0 / distension[i]
        h = max(constants.elastic_speed, 1.0 - constants.gain * (distension[i] - 1.0))
        trial = bulk * h * h * (phi - before)
        p = min(max(trial, -constants.tension), find_crushing(phi, constants, crush))
        moved = solve_zero_stress(phi, p, before, constants)
        zero = moved if p != trial else before
        h = max(constants.elastic_speed, 1.0 - constants.gain * (1.0 / zero - 1.0))
        distension[i] = 1.0 / zero
        a, c, b = parts.shear_elastically(dt, shear, exx, ezz, exz, spin, sxx_old, szz_old, sxz_old)
        limit2 = (2.0 * rub * constants.cohesion) ** 2
        a, c, b = parts.return_radially(a, c, b, limit2)
        if len(constants.rate.on) > 0:  # one array more and the loop would not be vectorised
            yield_square[i] = limit2
        rho[i], pressure[i], sxx[i], szz[i], sxz[i] = rho_new, p, a, c, b
        sound[i] = math.sqrt((bulk * h * h * phi + 4.0 / 3.0 * shear) / rho_new)
        crushing[i] += 0.2 * (max(zero - before, 0.0) / before * per_dt - crushing[i])
        p, a, c, b = p_old + p, sxx_old + a, szz_old + c, sxz_old + b  # twice the mean stress
        power = parts.find_power(div, exx, ezz, exz, hoop, p, a, c, b)
        work[i] += dt * power / (rho_old + rho_new)
        exchanged[i] += dt * p * exchange[i] / (rho_old + rho_new)
