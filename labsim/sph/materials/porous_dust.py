"""Porous dust: elastic-plastic, with the modified Sirono equation of state of Güttler et al. (2009), eqs. 3-5.

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
    """Σ(φ) in Pa, continued beyond its poles as the module says. Güttler et al. (2009), eq. 5."""
    phi = np.asarray(filling_factor, dtype=float)
    low, high = material.phi_1 + EDGE, material.phi_2 - EDGE
    inside = np.clip(phi, low, high)
    exponent = material.delta * math.log(10.0)
    ratio = (inside - material.phi_1) / (material.phi_2 - inside)
    strength = material.p_m * ratio**exponent
    slope = strength * exponent * (1 / (inside - material.phi_1) + 1 / (material.phi_2 - inside))
    return strength + np.where(phi > high, slope * (phi - high), 0.0)


def tensile_strength(filling_factor: FloatArray, material: Material) -> FloatArray:
    """T(φ) in Pa, negative. Güttler et al. (2009), eq. 4."""
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
def _raise_to(ratio, gamma):
    """ratio ** gamma; the exponent of nearly every dust is 4, and two products are far cheaper than a power."""
    return ratio * ratio * ratio * ratio if gamma == 4.0 else ratio**gamma


@compiled
def solve_zero_stress(phi, pressure, k0, gamma):
    """φ0' with K(φ0') (φ/φ0' - 1) = pressure, by Newton from the explicit estimate φ/(1 + p/K(φ))."""
    x = phi / (1.0 + pressure / (k0 * _raise_to(phi / 0.15, gamma)))
    for _ in range(3):
        k = k0 * _raise_to(x / 0.15, gamma)
        ratio = phi / x
        x -= (k * (ratio - 1.0) - pressure) / (k / x * (gamma * (ratio - 1.0) - ratio))
    return x


@compiled
def update_stress(
    n, dt, axisymmetric, solid_density, strength_table, tension_table, inverse_step, k0, gamma, shear_to_bulk,
    shear_factor, rate_eta, rate_n, gas_pressure,
    r, vr, lxx, lxz, lzx, lzz, rho, phi_zero, phi_initial, sxx, szz, sxz, pressure, sound, work, elastic,
):  # fmt: skip
    """One step of the material: velocity gradient in, density, φ0' and stress out. Plastic state is committed here,
    once per step. work and elastic: stress power spent so far and elastic energy held, per mass."""
    third = 1.0 / 3.0
    top = strength_table.size - 2
    for i in range(n):
        hoop = vr[i] / r[i] if axisymmetric else 0.0
        div = lxx[i] + lzz[i] + hoop
        rho_old = rho[i]
        p_old, sxx_old, szz_old, sxz_old = pressure[i], sxx[i], szz[i], sxz[i]
        rho_new = rho_old * math.exp(-div * dt)
        phi = rho_new / solid_density
        position = phi * inverse_step
        cell = min(max(int(position), 0), top)
        part = position - cell
        strength = strength_table[cell] + part * (strength_table[cell + 1] - strength_table[cell])
        tension = tension_table[cell] + part * (tension_table[cell + 1] - tension_table[cell])
        if rate_eta > 0.0 and div < 0.0:
            strength *= 1.0 + rate_eta * (-div) ** rate_n
        x = phi_zero[i]
        k = k0 * _raise_to(x / 0.15, gamma)
        p = k * (phi / x - 1.0)
        if p > strength:
            p = strength
            x = solve_zero_stress(phi, p, k0, gamma)
            k = k0 * _raise_to(x / 0.15, gamma)
            phi_zero[i] = x
        elif p < -tension:
            p = -tension
            x = solve_zero_stress(phi, p, k0, gamma)
            k = k0 * _raise_to(x / 0.15, gamma)
            phi_zero[i] = x
        shear = shear_to_bulk * k
        exx = lxx[i] - div * third
        ezz = lzz[i] - div * third
        exz = 0.5 * (lxz[i] + lzx[i])
        spin = 0.5 * (lxz[i] - lzx[i])
        a = sxx_old + dt * (2.0 * shear * exx + 2.0 * spin * sxz_old)
        c = szz_old + dt * (2.0 * shear * ezz - 2.0 * spin * sxz_old)
        b = sxz_old + dt * (2.0 * shear * exz + spin * (szz_old - sxx_old))
        h = -(a + c)
        q = math.sqrt(1.5 * (a * a + c * c + h * h) + 3.0 * b * b)
        yield_stress = shear_factor * math.sqrt(strength * tension)
        if q > yield_stress:
            f = yield_stress / q
            a *= f
            b *= f
            c *= f
            h *= f
        sxx[i], szz[i], sxz[i] = a, c, b
        gas = 0.0
        if gas_pressure > 0.0:
            gas = gas_pressure * ((1.0 - phi_initial[i]) / (1.0 - phi) - 1.0)
        total = p + gas
        pressure[i] = total
        rho[i] = rho_new
        stiffness = k * phi / x * (1.0 + 4.0 * third * shear_to_bulk)
        if gas_pressure > 0.0:
            stiffness += gas_pressure * phi * (1.0 - phi_initial[i]) / (1.0 - phi) ** 2
        sound[i] = math.sqrt(stiffness / rho_new)
        h_old = -(sxx_old + szz_old)
        work[i] += (
            dt * (
                -0.5 * (p_old + total) * div
                + 0.5 * (sxx_old + a) * exx + 0.5 * (szz_old + c) * ezz + (sxz_old + b) * exz
                + 0.5 * (h_old + h) * (hoop - div * third)
            ) / (0.5 * (rho_old + rho_new))
        )  # fmt: skip
        ratio = phi / x
        elastic[i] = (
            k / (solid_density * x) * (math.log(ratio) + 1.0 / ratio - 1.0)
            + (a * a + c * c + h * h + 2.0 * b * b) / (4.0 * shear * rho_new)
        )  # fmt: skip
