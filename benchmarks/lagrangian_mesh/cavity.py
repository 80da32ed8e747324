"""Slow growth of a spherical cavity in the dust: the exact answer, and the mesh's.

From nothing in endless dust it grows in similar steps, so what the wall bears does not change with its radius a. Where the dust
yields, √(3 J2) = |σ_r - σ_θ| = Y(φ) and p = p(φ), the elastic line and then Σ; with ξ = r/a and the velocity a' V(ξ)

    equilibrium  d(p + 2Y/3)/d ln ξ = -2 Y      continuity  (V - ξ) dφ/dξ = -φ (dV/dξ + 2 V/ξ)

inwards from where the elastic dust beyond begins to yield, V = ξ Y/(2μ), to the wall, V = ξ. Bishop, Hill & Mott (1945)
have it for metals, which do not compact.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.lagrangian_mesh import quadrilateral
from benchmarks.lagrangian_mesh.mesh import Dust, lay_mesh


def solve_cavity(dust: Dust) -> tuple[float, np.ndarray, np.ndarray]:
    """Pressure on the wall (Pa), and ξ and φ from the wall outwards to the end of the yielding dust, (k,) each."""
    phi_0 = dust.filling_factor
    bulk = dust.bulk_modulus * (phi_0 / quadrilateral.REFERENCE) ** 4

    def bear(phi: float) -> tuple[float, float]:
        compressive, tensile = quadrilateral.find_strengths(phi, dust.law)
        return min(bulk * (phi / phi_0 - 1.0), compressive), dust.shear_factor * np.sqrt(
            compressive * tensile
        )

    def slopes(log_xi: float, state: np.ndarray) -> list[float]:
        phi, share = state  # share: V/ξ
        small = 1e-7
        (p_below, y_below), (p_above, y_above) = bear(phi - small), bear(phi + small)
        growth = (p_above - p_below + 2.0 / 3.0 * (y_above - y_below)) / (2.0 * small)
        dphi = -2.0 * bear(phi)[1] / growth
        return [dphi, -3.0 * share - (share - 1.0) * dphi / phi]

    def reach_wall(log_xi: float, state: np.ndarray) -> float:
        return state[1] - 1.0

    reach_wall.terminal = True
    begin = [phi_0, bear(phi_0)[1] / (2.0 * dust.shear_to_bulk * bulk)]
    way = solve_ivp(slopes, (0.0, -20.0), begin, events=reach_wall, rtol=1e-8, atol=1e-10, max_step=0.005)
    pressure, shear = bear(way.y[0, -1])
    xi = np.exp(way.t - way.t[-1])
    return pressure + 2.0 / 3.0 * shear, xi[::-1], way.y[0, ::-1]


def grow_cavity(
    dust: Dust, growth: float, speed: float = 0.05, layers: int = 48, sectors: int = 6, outer: float = 40.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Grow a cavity from radius 1 mm by the factor ``growth`` at ``speed`` (m/s), in a shell fixed at ``outer`` mm.

    Returns the wall's radius (m) and pressure (Pa) on the way, and ξ and φ of the cells at the end.
    """
    radii = 1e-3 * np.geomspace(1.0, outer, layers + 1)
    angles = np.linspace(0.0, 0.5 * np.pi, sectors + 1)
    r, z = np.outer(np.sin(angles), radii), -np.outer(np.cos(angles), radii)
    cells = lay_mesh(r, z, dust, 0.0)
    nodes = np.zeros_like(r)
    quarter = 0.25 * cells[..., quadrilateral.MASS]
    for part in (nodes[:-1, :-1], nodes[1:, :-1], nodes[:-1, 1:], nodes[1:, 1:]):
        part += quarter
    u, v, force_r, force_z, spent = *(np.zeros_like(r) for _ in range(4)), np.zeros(3)
    damping = np.array([0.1, 1.2, 0.1])
    out_r, out_z = np.sin(angles), -np.cos(angles)
    radius, dt, walls, pressures = radii[0], 0.0, [], []
    while radius < growth * radii[0]:
        crossing = quadrilateral.load_nodes(r, z, u, v, dt, cells, dust.law, damping, force_r, force_z, spent)
        if crossing < 0.0:
            raise RuntimeError("a cell turned over")
        walls.append(radius)
        # by virtual work: the wall's chords, pushed along the radii of their ends
        chords = 0.5 * (r[:-1, 0] + r[1:, 0]) * np.hypot(np.diff(r[:, 0]), np.diff(z[:, 0]))
        area = chords.sum() * np.cos(0.5 * angles[1])
        pressures.append(-np.sum(force_r[:, 0] * out_r + force_z[:, 0] * out_z) / area)
        dt = 0.5 * crossing
        u += dt * force_r / nodes
        v += dt * force_z / nodes
        u[0], v[-1] = 0.0, 0.0
        u[:, -1] = v[:, -1] = 0.0
        u[:, 0], v[:, 0] = speed * out_r, speed * out_z
        r += dt * u
        z += dt * v
        radius += dt * speed
    away = np.hypot(r, z)
    xi = 0.25 * (away[:-1, :-1] + away[1:, :-1] + away[:-1, 1:] + away[1:, 1:]) / radius
    return np.array(walls), np.array(pressures), xi, cells[..., quadrilateral.PHI]
