"""Cohesive matter that flows at constant volume (undrained clay, metal): linear elastic, von Mises yield, no pull beyond a limit.

    p = K (ρ/ρ0 - 1) ≥ -tension,  √(3 J2) ≤ 2 cohesion,  elastic shear with Jaumann's rate and radial return

Hill (1950), The Mathematical Theory of Plasticity. ``cohesion`` is half the strength in triaxial compression (undrained shear
strength), so simple shear yields at 2/√3 of it. Where p would fall below -tension the matter opens: ρ0 follows.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from labsim.records import FloatArray
from labsim.sph._jit import compiled
from labsim.sph.materials import _parts as parts

if TYPE_CHECKING:
    from labsim.sph.setting import DropSetting
    from labsim.sph.state import Rows

PARAMETERS = (
    parts.Parameter("cohesion", "Pa", 1e-3, 1e9, 5e3, "soft clay, undrained"),
    parts.Parameter("shear_modulus", "Pa", 1.0, 1e11, 5e5, "rigidity 100 of soft clay"),
    parts.Parameter("bulk_modulus", "Pa", 1.0, 1e12, 5e6, "ten times shear: Poisson's ratio 0.45"),
    parts.Parameter("tension", "Pa", 0.0, 1e12, 1e12, "none: holds together"),
    *parts.RATE,
)
CALIBRATED = parts.Calibrated("cohesion", 1e2, 1e6)
TERMS = ("strength_rate",)  # of a setting that it takes


class State(NamedTuple):
    reference: FloatArray  # ρ0, kg/m³


class Constants(NamedTuple):
    cohesion: float
    shear_modulus: float
    bulk_modulus: float
    tension: float
    rate: parts.Rate


make_constants = parts.make_constants
make_tables = parts.make_tables  # nothing is looked up
check = parts.check
sound_speed = parts.sound_speed
find_warnings = parts.find_warnings  # none
bearable_pressure = parts.bearable_pressure  # any


def start(setting: DropSetting, phi: FloatArray, pressure: FloatArray | float) -> tuple[State, FloatArray]:
    """Own rows at rest under a pressure (Pa), and the sound speed (m/s)."""
    law = make_constants(setting)
    density = phi * setting.monomer_density
    sound = np.sqrt((law.bulk_modulus + 4 / 3 * law.shear_modulus) / density)
    return State(density / (1 + pressure / law.bulk_modulus)), sound


def resistance(setting: DropSetting) -> float:
    return float(8.0 * make_constants(setting).cohesion)  # about what a deep tip meets


def elastic_energy(setting: DropSetting, s: Rows, own: State) -> FloatArray:
    """Per mass, J/kg."""
    law = make_constants(setting)
    volume = parts.find_volume_energy(s, own.reference, law.bulk_modulus)
    return volume + parts.find_shape_energy(s, law.shear_modulus)


@compiled
def update(low, high, dt, axisymmetric, s, own, constants, tables):
    """One step of particles low..high-1: velocity gradient in, density, stress, sound and the book of work out."""
    r, vr, lxx, lxz, lzx, lzz, rho, exchange = s.ring, s.u, s.lxx, s.lxz, s.lzx, s.lzz, s.density, s.exchange
    sxx, szz, sxz, pressure, sound, work = s.sxx, s.szz, s.sxz, s.pressure, s.sound, s.work
    exchanged, crushing, reference = s.exchanged, s.crushing, own.reference
    bulk, shear, tension = constants.bulk_modulus, constants.shear_modulus, constants.tension
    yield2 = 4.0 * constants.cohesion * constants.cohesion
    third = 1.0 / 3.0
    hoops = 1.0 if axisymmetric else 0.0
    yield_square = s.yield_square
    for i in range(low, high):
        yield_square[i] = yield2
    for i in range(low, high):
        hoop = hoops * vr[i] / r[i]
        div = lxx[i] + lzz[i] + hoop
        rho_old = rho[i]
        rho_new = rho_old * parts.exponential(-dt * (div + exchange[i]))
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        trial = bulk * (rho_new / reference[i] - 1.0)
        p = max(trial, -tension)
        reference[i] = rho_new / (1.0 + p / bulk) if p != trial else reference[i]
        exx, ezz, exz, spin = parts.find_strain_rates(lxx[i], lzz[i], lxz[i], lzx[i], div)
        a, c, b = parts.shear_elastically(dt, shear, exx, ezz, exz, spin, sxx_old, szz_old, sxz_old)
        limit2 = yield2
        if len(constants.rate.on) > 0:
            limit2 *= parts.strengthen(parts.find_shear_rate(exx, ezz, exz), constants.rate) ** 2
        a, c, b = parts.return_radially(a, c, b, limit2)
        if len(constants.rate.on) > 0:  # one array more and the loop would not be vectorised
            yield_square[i] = limit2
        rho[i], pressure[i], sxx[i], szz[i], sxz[i] = rho_new, p, a, c, b
        sound[i] = math.sqrt((bulk * rho_new / reference[i] + 4.0 * third * shear) / rho_new)
        crushing[i] = 0.0  # nothing is crushed, so nothing is exchanged
        power = parts.find_power(
            div, exx, ezz, exz, hoop, p_old + p, sxx_old + a, szz_old + c, sxz_old + b
        )  # of twice the mean stress
        work[i] += dt * power / (rho_old + rho_new)
        exchanged[i] += dt * (p_old + p) * exchange[i] / (rho_old + rho_new)
