"""The dust's law for one material point: strengths, pressure with its zero-stress filling factor, radial return.

Equations: Güttler et al. (2009) eqs. 4-6; the exponent of K is 4. Everything in SI.
"""

from __future__ import annotations

import numpy as np
from numba import njit

TABLE_END = 0.75  # of filling factor
TABLE_SIZE = 8193


def tabulate_strengths(p_m, phi_1, phi_2, delta, tensile_factor=1.0, tensile_a=2.8, tensile_b=1.48):
    """Σ and |T| (Pa), each (8193,), over filling factors from 0 to 0.75."""
    phi = np.linspace(0.0, TABLE_END, TABLE_SIZE)
    exponent = delta * np.log(10.0)
    low, high = phi_1 + 0.002, phi_2 - 0.002
    inside = np.clip(phi, low, high)
    compressive = p_m * ((inside - phi_1) / (phi_2 - inside)) ** exponent
    # above the last point inside the bounds the curve goes on along its tangent
    top = p_m * ((high - phi_1) / (phi_2 - high)) ** exponent
    slope = top * exponent * (1.0 / (high - phi_1) + 1.0 / (phi_2 - high))
    compressive = np.where(phi > high, top + slope * (phi - high), compressive)
    tensile = tensile_factor * 10.0 ** (tensile_a + tensile_b * phi)
    return compressive, tensile


@njit(inline="always", fastmath=True)
def look_up(table, phi):
    x = phi * ((TABLE_SIZE - 1) / TABLE_END)
    k = min(max(int(x), 0), TABLE_SIZE - 2)
    return table[k] + (x - k) * (table[k + 1] - table[k])


@njit(inline="always", fastmath=True)
def find_unstressed(phi, pressure, guess, k0):
    """φ0′ on whose elastic line K0 (φ0′/0.15)^4 (φ/φ0′ - 1) the state (φ, p) lies, by Newton's method."""
    k = k0 / 0.15**4
    x = guess
    for _ in range(20):
        step = (k * x**3 * (phi - x) - pressure) / (k * x * x * (3.0 * phi - 4.0 * x))
        x -= step
        if abs(step) < 1e-9:
            break
    return x
