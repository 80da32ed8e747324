"""Grains that press, rub and lock (sand, snow, regolith): elastic, Drucker-Prager cone, cap of compaction, limit of tension.

    p = K ln(ρ/ρ0),  elastic shear with Jaumann's rate;  q = √(3 J2) ≤ k + M p,  -tension ≤ p ≤ p_c(φ)
    M = 6 sin(friction)/(3 - sin(friction)),  k = 6 cohesion cos(friction)/(3 - sin(friction)): triaxial compression is
        that of Mohr and Coulomb; on the cone dε_v = -M_ψ dε_q with M_ψ the same of the dilatancy angle
    p_c = cap_pressure (φ/φ_ref)^cap_exponent,  φ_ref the setting's filling factor

Drucker & Prager (1952), Q. Appl. Math. 10, 157. Flat cap: DiMaggio & Sandler (1971), J. Eng. Mech. 97, 935. p_c: the compression
line ln(1/φ) = N - λ ln p of Butterfield (1979), Géotechnique 29, 469; cap_exponent = 1/λ. No tension reaches
beyond the apex k/M. Where pull opens the matter ρ0 follows; loosened matter has the cap of its φ.

The return is exact for a step of constant strain rate without spin and cap: dp/dλ = K M_ψ and dq/dλ = -3 G are constants, so
the cone is met at λ = (q - k - M p)/(3 G + K M M_ψ); p is then cut at its limits and q at the cone of that p, which covers
the apex and both corners (there two surfaces flow, each with a multiplier that is positive).
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
    parts.Parameter("friction_angle", "°", 0.0, 60.0, 35.0, "dry sand of medium density: 33 to 38°"),
    parts.Parameter(
        "dilatancy_angle", "°", 0.0, 60.0, 5.0, "about friction less the critical angle, Bolton (1986)"
    ),
    parts.Parameter(
        "cohesion", "Pa", 0.0, 1e9, 0.0, "dry sand; lunar regolith 100 to 1000, Carrier et al. (1991)"
    ),
    parts.Parameter("tension", "Pa", 0.0, 1e9, 0.0, "none, as between dry grains"),
    parts.Parameter(
        "cap_pressure", "Pa", 1.0, 1e12, 1e12, "none: sand of hard grains; fresh snow 1e3 to 1e5"
    ),
    parts.Parameter(
        "cap_exponent", "1", 0.0, 200.0, 10.0, "one over the slope of ln(1/φ) over ln p, here 0.1"
    ),
    parts.Parameter("bulk_modulus", "Pa", 1.0, 1e12, 2e6, "sand under centimetres of its own weight"),
    parts.Parameter("shear_modulus", "Pa", 1.0, 1e12, 1.2e6, "Poisson's ratio 0.25"),
    *parts.RATE,
)
CALIBRATED = parts.Calibrated("friction_angle", 20.0, 50.0)
TERMS = ("strength_rate", "crust_excess", "filling_gradient")  # of a setting that it takes


class State(NamedTuple):
    reference: FloatArray  # ρ0, kg/m³
    cap: FloatArray  # p_c at the particle's φ, Pa


class Constants(NamedTuple):
    slope: float  # M
    dilatancy: float  # M_ψ
    intercept: float  # k, Pa
    tension: float
    cap_pressure: float
    cap_exponent: float
    bulk_modulus: float
    shear_modulus: float
    cap_density: float  # where cap_pressure is stated, kg/m³
    rate: parts.Rate


make_tables = parts.make_tables  # nothing is looked up
sound_speed = parts.sound_speed
find_warnings = parts.find_warnings  # none


def make_constants(setting: DropSetting) -> Constants:
    friction, dilation, cohesion, tension, *rest, rate = parts.read_parameters(setting, PARAMETERS)
    sine, sine_dilation = math.sin(math.radians(friction)), math.sin(math.radians(dilation))
    slope, intercept = 6 * sine / (3 - sine), 6 * cohesion * math.cos(math.radians(friction)) / (3 - sine)
    pull = min(tension, intercept / slope) if slope > 0.0 else tension
    density = setting.filling_factor * setting.monomer_density
    flow = 6 * sine_dilation / (3 - sine_dilation)
    return Constants._make([slope, flow, intercept, pull, *rest, density, rate])


def start(setting: DropSetting, phi: FloatArray, pressure: FloatArray | float) -> tuple[State, FloatArray]:
    """Own rows at rest under a pressure (Pa), and the sound speed (m/s)."""
    law = make_constants(setting)
    density = phi * setting.monomer_density
    cap = law.cap_pressure * (density / law.cap_density) ** law.cap_exponent
    sound = np.sqrt((law.bulk_modulus + 4 / 3 * law.shear_modulus) / density)
    return State(density * np.exp(-(0.0 * phi + pressure) / law.bulk_modulus), cap), sound


def bearable_pressure(setting: DropSetting, phi: FloatArray) -> FloatArray:
    """What matter at rest may carry without compaction, Pa."""
    return start(setting, phi, 0.0)[0].cap


def resistance(setting: DropSetting) -> float:
    """About what a tip meets one radius below the surface, Pa."""
    law = make_constants(setting)
    weight = law.cap_density * setting.gravity * setting.projectile.tip_radius
    return min(3.0 * law.intercept + 20.0 * law.slope * weight, 3.0 * law.cap_pressure)


def check(setting: DropSetting, refuse: Callable[[str, str], None]) -> None:
    law = make_constants(setting)
    parts.refuse_terms(setting, TERMS)
    if law.dilatancy > law.slope:
        refuse("material.dilatancy_angle", "is above friction_angle: shear would create energy; lower it")


def elastic_energy(setting: DropSetting, s: Rows, own: State) -> FloatArray:
    """Per mass, J/kg."""
    law = make_constants(setting)
    strain = s.pressure / law.bulk_modulus
    volume = law.bulk_modulus * (np.expm1(strain) - strain) / s.density
    return volume + parts.find_shape_energy(s, law.shear_modulus)


@compiled
def update(low, high, dt, axisymmetric, s, own, constants, tables):
    """One step of particles low..high-1: velocity gradient in, density, stress, sound and the book of work out."""
    r, vr, lxx, lxz, lzx, lzz, rho, exchange = s.ring, s.u, s.lxx, s.lxz, s.lzx, s.lzz, s.density, s.exchange
    sxx, szz, sxz, pressure, sound, work = s.sxx, s.szz, s.sxz, s.pressure, s.sound, s.work
    exchanged, crushing, reference, cap = s.exchanged, s.crushing, own.reference, own.cap
    bulk, shear = constants.bulk_modulus, constants.shear_modulus
    slope, dilatancy, intercept = constants.slope, constants.dilatancy, constants.intercept
    yield_square = s.yield_square
    per_flow = 1.0 / (3.0 * shear + bulk * slope * dilatancy)
    hoops = 1.0 if axisymmetric else 0.0
    per_dt = 1.0 / dt if dt > 0.0 else 0.0
    for i in range(low, high):  # apart, because a power cannot be vectorised
        hoop = hoops * vr[i] / r[i]
        rho[i] *= parts.exponential(-dt * (lxx[i] + lzz[i] + hoop + exchange[i]))
        cap[i] = constants.cap_pressure * (rho[i] / constants.cap_density) ** constants.cap_exponent
    for i in range(low, high):
        hoop = hoops * vr[i] / r[i]
        div = lxx[i] + lzz[i] + hoop
        swelling = dt * (div + exchange[i])
        rho_new = rho[i]
        rho_old = rho_new * parts.exponential(swelling)
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        exx, ezz, exz, spin = parts.find_strain_rates(lxx[i], lzz[i], lxz[i], lzx[i], div)
        a, c, b = parts.shear_elastically(dt, shear, exx, ezz, exz, spin, sxx_old, szz_old, sxz_old)
        rub, crush, flow = 1.0, 1.0, per_flow
        if len(constants.rate.on) > 0:
            rub = parts.strengthen(parts.find_shear_rate(exx, ezz, exz), constants.rate)
            crush = parts.strengthen(max(-div, 0.0), constants.rate)
            flow = 1.0 / (3.0 * shear + bulk * rub * slope * dilatancy)
        trial = p_old - bulk * swelling
        above = math.sqrt(parts.measure_shear(a, c, b)) - rub * (intercept + slope * trial)
        dilated = trial + bulk * dilatancy * max(above, 0.0) * flow
        p = min(max(dilated, -constants.tension), crush * cap[i])
        limit = max(rub * (intercept + slope * p), 0.0)
        a, c, b = parts.return_radially(a, c, b, limit * limit)
        if len(constants.rate.on) > 0:
            yield_square[i] = limit * limit
        reference[i] = rho_new * parts.exponential(-p / bulk)
        pressure[i], sxx[i], szz[i], sxz[i] = p, a, c, b
        sound[i] = math.sqrt((bulk + 4.0 / 3.0 * shear) / rho_new)
        crushing[i] += 0.2 * (max(dilated - p, 0.0) / bulk * per_dt - crushing[i])
        power = parts.find_power(
            div, exx, ezz, exz, hoop, p_old + p, sxx_old + a, szz_old + c, sxz_old + b
        )  # of twice the mean stress
        work[i] += dt * power / (rho_old + rho_new)
        exchanged[i] += dt * (p_old + p) * exchange[i] / (rho_old + rho_new)
    if len(constants.rate.on) == 0:  # apart: one array more and the loop would not be vectorised
        for i in range(low, high):
            yield_square[i] = max(intercept + slope * pressure[i], 0.0) ** 2
