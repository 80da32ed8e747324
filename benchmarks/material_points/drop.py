"""One drop: what is stated (dust, projectile, speed, hidden terms) and what comes out (depth against time, the points)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.material_points import step
from benchmarks.material_points.dust import find_unstressed, look_up, tabulate_strengths

SOLID = 2000.0  # kg/m^3
GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True)
class Dust:
    """The nominal dust, and the terms that a nominal model lacks (all off by default)."""

    p_m: float = 1300.0
    filling_factor: float = 0.15
    depth: float = 20e-3
    phi_1: float = 0.12
    phi_2: float = 0.58
    delta: float = 0.58
    shear_factor: float = 1.0
    tensile_factor: float = 1.0
    bulk_modulus: float = 45e3
    shear_to_bulk: float = 0.5
    eta: float = 0.0
    rate_n: float = 1.0
    rate_in_shear: bool = True
    gas_pressure: float = 0.0
    weakening: float = 0.0  # share of the strength that shearing can take away
    weakening_shear: float = 0.3
    hardening: float = 0.0  # relative growth of Y per plastic strain
    crust: tuple[float, float] = (0.0, 1.0)  # Δφ, ℓ (m)
    gradient: float = 0.0  # dφ/dz downwards, 1/m
    layers: tuple[float, float] = (0.0, 1.0)  # amplitude of φ, period (m)
    interface: tuple[float, float, float] = (
        0.0,
        1.0,
        1.0,
    )  # depth, thickness (m), factor of the strength inside


@dataclass(frozen=True)
class Body:
    """The projectile and the forces on it that are not the dust's stress."""

    radius: float = 0.5e-3
    mass: float = 1.32994e-6
    sphere: bool = False
    friction: float = 0.0
    side: float = 0.0  # N per metre of immersed length
    shaft_drag: float = 0.0  # N s^2/m^2 per metre of immersed length
    pull: float = 0.0  # N upwards while in the dust
    accreted: float = 0.0  # share of the mass per radius of depth


@dataclass(frozen=True)
class Numerics:
    cells: float = 8.0  # a/h
    courant: float = 0.35
    own: float = 0.0  # of its velocity beyond the grid's, kept by a point
    width: float = 5.0  # of the domain, radii
    height: float = 4.0  # of dust below ``reach``, radii
    near: float = 3.0  # radii from the axis and from ``reach`` within which a cell holds per_cell² points
    per_cell: int = 2  # points a cell and direction
    start: float = 1.5  # cells above the surface where the tip starts
    raised: float = 0.0  # cells by which the dust's surface lies above its nominal height
    gap: float = 0.0  # cells between surface and the outermost node it pushes


@dataclass(frozen=True)
class Result:
    """time, depth, speed: (n,) from contact on; points: (k, 4) r, z, volume, φ at the end."""

    time: np.ndarray
    depth: np.ndarray
    speed: np.ndarray
    stopping_time: float
    stopping_depth: float
    points: np.ndarray = field(repr=False)
    steps: int = 0


def fill_factor_at(dust: Dust, depth: np.ndarray) -> np.ndarray:
    """Initial φ at a depth (m, positive downwards)."""
    phi = np.full_like(depth, dust.filling_factor)
    phi = phi + dust.crust[0] * np.exp(-depth / dust.crust[1])
    phi = phi + dust.gradient * depth
    if dust.layers[0]:
        phi = phi + dust.layers[0] * np.sin(2 * np.pi * depth / dust.layers[1])
    return np.clip(phi, 0.125, 0.5)


def lay_points(
    dust: Dust, h: float, near: tuple[int, int], whole: tuple[int, int], per_cell: int, tables
) -> np.ndarray:
    """Points of the dust at rest under its own weight, p = ρ g depth where the dust can bear it.

    near, whole : cells along r and in depth; ``per_cell``² points a cell in the near part, one a cell beyond it.
    """
    cell_r, cell_z = np.meshgrid(np.arange(whole[0]), np.arange(whole[1]), indexing="ij")
    is_near = (cell_r < near[0]) & (cell_z < near[1])
    within = (np.arange(per_cell) + 0.5) / per_cell
    fine_r = (cell_r[is_near][:, None] + np.repeat(within, per_cell)).ravel()
    fine_z = (cell_z[is_near][:, None] + np.tile(within, per_cell)).ravel()
    r = np.concatenate([fine_r, cell_r[~is_near] + 0.5]) * h
    depth = np.concatenate([fine_z, cell_z[~is_near] + 0.5]) * h
    area = np.where(np.arange(r.size) < fine_r.size, (h / per_cell) ** 2, h**2)
    points = np.zeros((r.size, step.COLUMNS))
    points[:, step.R], points[:, step.Z] = r, -depth
    phi = fill_factor_at(dust, depth)
    strength = np.ones_like(phi)
    middle, thickness, factor = dust.interface
    if middle > 0.0:
        strength[np.abs(depth - middle) < 0.5 * thickness] = factor
    points[:, step.PHI] = points[:, step.PHI_I] = phi
    points[:, step.MASS] = phi * SOLID * 2 * np.pi * r * area
    points[:, step.STRENGTH] = strength
    for k in range(r.size):
        weight = phi[k] * SOLID * GRAVITY * depth[k]
        points[k, step.PRESSURE] = min(weight, 0.999 * strength[k] * look_up(tables[0], phi[k]))
        points[k, step.PHI0] = find_unstressed(phi[k], points[k, step.PRESSURE], phi[k], dust.bulk_modulus)
    return points


def run_drop(
    dust: Dust,
    body: Body,
    speed: float,
    numerics: Numerics = Numerics(),
    stop_factor: float = 1.25,
    reach: float | None = None,
) -> Result:
    """Run one drop; ``reach`` (m) is the depth the domain must leave room for, 2.6 radii by default."""
    tables = tabulate_strengths(dust.p_m, dust.phi_1, dust.phi_2, dust.delta, dust.tensile_factor)
    h = body.radius / numerics.cells
    if reach is None:  # half as deep again as a nominal drop
        heavier = body.mass / (1.33e-6 * (body.radius / 0.5e-3) ** 3)
        reach = body.radius * max(0.5, 3.5 * speed * np.sqrt(heavier) * (body.radius / 0.5e-3) ** 0.25)
    bottom = min(dust.depth, numerics.height * body.radius + reach)
    layers = round(bottom / h)
    wide = round(numerics.width * numerics.cells)
    near = (
        int(numerics.near * numerics.cells),
        round(((numerics.near - 0.5) * body.radius + reach) / h),
    )
    points = lay_points(dust, h, near, (wide, layers), numerics.per_cell, tables)
    points[:, step.Z] += numerics.raised * h
    above = int(2.0 * numerics.cells)
    shape = (wide + 5, layers + above + 5)
    law = np.array(
        [
            dust.bulk_modulus, dust.shear_to_bulk, dust.shear_factor, dust.eta, dust.rate_n, dust.gas_pressure,
            SOLID, GRAVITY, dust.weakening, dust.weakening_shear, dust.hardening, float(dust.rate_in_shear),
        ]
    )  # fmt: skip
    body_of = np.array(
        [body.radius, body.mass, speed, float(body.sphere), body.friction, numerics.gap, numerics.start * h]
    )
    forces = np.array([body.side, body.shaft_drag, body.pull, body.accreted])
    curve = np.zeros((4000, 3))
    end = 60e-3 * body.radius / 1e-3
    interval = 5e-6 * body.radius / 0.5e-3
    written, steps, stopping_time, stopping_depth = step.advance(
        points, h, -layers * h, shape, *tables, law, body_of, forces, numerics.courant, end, stop_factor,
        curve, interval, numerics.own,
    )  # fmt: skip
    curve = curve[:written]
    at_end = np.column_stack(
        [
            points[:, step.R],
            points[:, step.Z],
            points[:, step.MASS] / (points[:, step.PHI] * SOLID),
            points[:, step.PHI],
        ]
    )
    return Result(*curve.T.copy(), stopping_time, stopping_depth, at_end, steps)


def extrapolate_drop(
    dust: Dust,
    body: Body,
    speed: float,
    numerics: Numerics,
    finer: float = 1.5,
    stop_factor: float = 1.25,
    reach: float | None = None,
) -> Result:
    """The limit of no cell size: two runs, the second with ``finer`` times the cells, and a straight line in the cell size.

    The projectile is felt at nodes inside it, so depths err in proportion to a cell. Depths are compared at the same share of
    each run's stopping time, so that the stop stays sharp. points : of the finer run.
    """
    runs = [
        run_drop(dust, body, speed, replace(numerics, cells=cells), stop_factor, reach)
        for cells in (numerics.cells, finer * numerics.cells)
    ]
    weights = np.array([-1.0, finer]) / (finer - 1.0)
    stop = float(weights @ [run.stopping_time for run in runs])
    begin = max(run.time[0] / run.stopping_time for run in runs)
    end = min(run.time[-1] / run.stopping_time for run in runs)
    share = np.linspace(begin, end, max(run.time.size for run in runs))
    depth = weights @ [np.interp(share * run.stopping_time, run.time, run.depth) for run in runs]
    rate = weights @ [
        run.stopping_time * np.interp(share * run.stopping_time, run.time, run.speed) for run in runs
    ]
    deepest = float(weights @ [run.stopping_depth for run in runs])
    return Result(share * stop, depth, rate / stop, stop, deepest, runs[1].points, runs[1].steps)
