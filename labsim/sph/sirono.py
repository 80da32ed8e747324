"""Strengths and stiffness of porous dust over its filling factor φ: Güttler et al. (2009), eqs. 4-6, and Sirono (2004).

    Σ(φ) = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10),  T(φ) = -10^(a + bφ) Pa,  Y(φ) = shear_factor √(Σ|T|),  K(φ0') = K0 (φ0'/0.15)^γ

φ0' is the filling factor at zero stress. The strengths depend on φ alone and are tabulated; between φ1 + 0.002 and φ2 - 0.002 the
table is the formula, below it Σ keeps its value there (a powder without strength would never come to rest), above it goes on
along the tangent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..records import FloatArray, Material
from ._jit import compiled

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


class Strengths(NamedTuple):
    """Σ and |T|, Pa, at TABLE_SIZE values of φ from 0 to TABLE_TOP."""

    compressive: FloatArray
    tensile: FloatArray


def tabulate_strengths(material: Material, shape: tuple[tuple[float, float], ...] = ()) -> Strengths:
    """The table of both strengths; shape, pairs of φ and a factor, multiplies Σ by a factor linear in φ."""
    phi = np.linspace(0.0, TABLE_TOP, TABLE_SIZE)
    strength = compressive_strength(phi, material)
    if shape:
        knots, factors = np.asarray(shape, dtype=float).T
        strength = strength * np.interp(phi, knots, factors)
    return Strengths(strength, -tensile_strength(phi, material))


def zero_stress_filling_factor(phi: FloatArray, pressure: FloatArray, material: Material) -> FloatArray:
    """φ0' of dust at filling factor phi under an elastic pressure (Pa): ``solve_zero_stress`` for arrays."""
    x = phi / (1.0 + pressure / bulk_modulus(phi, material))
    for _ in range(3):
        k, ratio = bulk_modulus(x, material), phi / x
        slope = k / x * (material.bulk_exponent * (ratio - 1.0) - ratio)
        x = x - (k * (ratio - 1.0) - pressure) / slope
    return x


@compiled
def raise_to(ratio, gamma, fourth):
    """ratio ** gamma; the exponent of nearly every dust is 4 (``fourth``), and two products are far cheaper than a power."""
    return ratio * ratio * ratio * ratio if fourth else ratio**gamma


@compiled
def solve_zero_stress(phi, pressure, k0, gamma, fourth):
    """φ0' with K(φ0') (φ/φ0' - 1) = pressure, by Newton from the explicit estimate φ/(1 + p/K(φ))."""
    x = phi / (1.0 + pressure / (k0 * raise_to(phi * (1.0 / 0.15), gamma, fourth)))
    for _ in range(3):
        k = k0 * raise_to(x * (1.0 / 0.15), gamma, fourth)
        ratio = phi / x
        x -= x * (k * (ratio - 1.0) - pressure) / (k * (gamma * (ratio - 1.0) - ratio))
    return x


@compiled
def look_up(strengths, position):
    """Σ and |T|, Pa, at a place in the table, counted in entries."""
    cell = np.uint64(min(max(int(position), 0), strengths.compressive.size - 2))
    part = position - cell
    below, above = strengths.compressive[cell], strengths.compressive[cell + np.uint64(1)]
    compressive = below + part * (above - below)
    below, above = strengths.tensile[cell], strengths.tensile[cell + np.uint64(1)]
    return compressive, below + part * (above - below)
