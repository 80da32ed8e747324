"""Porous dust: elastic-plastic, with the modified Sirono equation of state of Güttler et al. (2009), eqs. 4-6.

    p = Σ(φ) on compaction, K(φ0') (φ/φ0' - 1) between, T(φ) on extension; φ0' is the filling factor at zero stress
    Σ(φ) = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10),  T(φ) = -10^(a + bφ) Pa,  Y(φ) = shear_factor √(Σ|T|)
    K(φ0') = K0 (φ0'/0.15)^γ,  μ = shear_to_bulk K

The strengths depend on φ alone and are tabulated; between φ1 + 0.002 and φ2 - 0.002 the table is the formula, below it
Σ keeps its value there (a powder without strength would never come to rest), above it goes on along the tangent.
The deviatoric stress follows Jaumann's rate and returns radially to √(3 J2) = Y (von Mises, hoop stress included).
Two optional terms: Σ (1 + η ε̇ⁿ) with ε̇ the rate of compression, and trapped gas p + P0 ((1 - φi)/(1 - φ) - 1).
"""

from __future__ import annotations

import math

import numpy as np

from ...records import FloatArray, Material
from .._jit import compiled

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


@compiled
def _raise_to(ratio, gamma, fourth):
    """ratio ** gamma; the exponent of nearly every dust is 4 (``fourth``), and two products are far cheaper than a power."""
    return ratio * ratio * ratio * ratio if fourth else ratio**gamma


@compiled
def _exponential(y):
    """e^y to 1e-14 for |y| < 1, without the library call that would keep a loop from being vectorised."""
    y *= 0.125
    e = 1.0 + y / 9.0
    for k in (8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0):
        e = 1.0 + e * y / k
    e *= e
    e *= e
    return e * e


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
def update_stress(
    low, high, dt, axisymmetric, plain, law, strength_table, tension_table, r, vr, lxx, lxz, lzx, lzz,
    rho, phi_zero, phi_initial, sxx, szz, sxz, pressure, sound, work, compressive, tensile,
):  # fmt: skip
    """One step of the material for particles low..high-1: velocity gradient in, density, φ0' and stress out. Plastic state is
    committed here, once per step. work: stress power spent so far, per mass; compressive, tensile: Σ and |T| of each particle.

    law: monomer density, K0, γ, shear_to_bulk, shear_factor, η and n of the rate term, gas pressure.
    plain: no rate term, no gas, exponent 4 of K. Then the loop has no branch and no call, and is vectorised.
    """
    solid_density, k0, gamma, shear_to_bulk, shear_factor, rate_eta, rate_n, gas_pressure = law
    inverse_step = (TABLE_SIZE - 1) / TABLE_TOP / solid_density
    third = 1.0 / 3.0
    hoops = 1.0 if axisymmetric else 0.0
    top = strength_table.size - 2
    inverse_solid = 1.0 / solid_density
    # three loops, because one that looks up a table cannot be vectorised
    for i in range(low, high):
        rho[i] *= _exponential(-dt * (lxx[i] + lzz[i] + hoops * vr[i] / r[i]))
    for i in range(low, high):
        position = rho[i] * inverse_step
        cell = np.uint64(min(max(int(position), 0), top))
        part = position - cell
        below, above = strength_table[cell], strength_table[cell + np.uint64(1)]
        compressive[i] = below + part * (above - below)
        below, above = tension_table[cell], tension_table[cell + np.uint64(1)]
        tensile[i] = below + part * (above - below)
    for i in range(low, high):
        hoop = hoops * vr[i] / r[i]
        div = lxx[i] + lzz[i] + hoop
        rho_new = rho[i]
        rho_old = rho_new / _exponential(-div * dt)
        phi = rho_new * inverse_solid
        strength, tension = compressive[i], tensile[i]
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        if not plain and rate_eta > 0.0 and div < 0.0:
            strength *= 1.0 + rate_eta * (-div) ** rate_n
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
        phi_zero[i] = x
        shear = shear_to_bulk * k
        exx = lxx[i] - div * third
        ezz = lzz[i] - div * third
        exz = 0.5 * (lxz[i] + lzx[i])
        spin = 0.5 * (lxz[i] - lzx[i])
        a = sxx_old + dt * (2.0 * shear * exx + 2.0 * spin * sxz_old)
        c = szz_old + dt * (2.0 * shear * ezz - 2.0 * spin * sxz_old)
        b = sxz_old + dt * (2.0 * shear * exz + spin * (szz_old - sxx_old))
        q2 = 1.5 * (a * a + c * c + (a + c) * (a + c)) + 3.0 * b * b
        yield2 = shear_factor * shear_factor * strength * tension
        f = math.sqrt(yield2 / max(max(q2, yield2), 1.0e-300))
        a *= f
        b *= f
        c *= f
        h = -(a + c)
        sxx[i], szz[i], sxz[i] = a, c, b
        total = p
        stiffness = k * phi / x * (1.0 + 4.0 * third * shear_to_bulk)
        if not plain and gas_pressure > 0.0:
            total += gas_pressure * ((1.0 - phi_initial[i]) / (1.0 - phi) - 1.0)
            stiffness += gas_pressure * phi * (1.0 - phi_initial[i]) / (1.0 - phi) ** 2
        pressure[i] = total
        sound[i] = math.sqrt(stiffness / rho_new)
        h_old = -(sxx_old + szz_old)
        work[i] += (
            dt * (
                -(p_old + total) * div
                + (sxx_old + a) * exx + (szz_old + c) * ezz + 2.0 * (sxz_old + b) * exz
                + (h_old + h) * (hoop - div * third)
            ) / (rho_old + rho_new)
        )  # fmt: skip


def elastic_energy(
    density: FloatArray, zero_stress: FloatArray, sxx: FloatArray, szz: FloatArray, sxz: FloatArray,
    material: Material, monomer_density: float,
) -> FloatArray:  # fmt: skip
    """Elastic energy held per mass, J/kg: of the volume between φ0' and φ, and of the deviatoric stress."""
    k = bulk_modulus(zero_stress, material)
    ratio = density / (monomer_density * zero_stress)
    shape = sxx**2 + szz**2 + (sxx + szz) ** 2 + 2.0 * sxz**2
    volume = k / (monomer_density * zero_stress) * (np.log(ratio) + 1.0 / ratio - 1.0)
    return volume + shape / (4.0 * material.shear_to_bulk * k * density)


def gas_energy(
    density: FloatArray, initial: FloatArray, gas_pressure: float, monomer_density: float
) -> FloatArray:
    """Energy held per mass, J/kg, by trapped gas (isothermal) since the pores were as at ``initial`` φ: all of it comes back.

    ∫ P0 ((1 - φi)/(1 - φ) - 1) dφ/(ρs φ²) from φi to φ.
    """
    phi = density / monomer_density

    def primitive(at: FloatArray) -> FloatArray:
        return (1.0 - initial) * (np.log(at / (1.0 - at)) - 1.0 / at) + 1.0 / at

    return gas_pressure / monomer_density * (primitive(phi) - primitive(initial))
