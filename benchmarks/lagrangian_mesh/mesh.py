"""A drop on the mesh of quadrilaterals: what is stated (dust, projectile, mesh), and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from benchmarks.lagrangian_mesh import quadrilateral

BEAD_DENSITY = 2540.0  # kg/m^3
BEAD = BEAD_DENSITY * 4.0 / 3.0 * np.pi  # kg/m^3: mass of a glass bead over the cube of its radius

LOOSEST = 0.005  # of φ over φ1, that a gradient leaves


@dataclass(frozen=True)
class Dust:
    p_m: float = 1300.0
    filling_factor: float = 0.15
    phi_1: float = 0.12
    phi_2: float = 0.58
    delta: float = 0.58
    bulk_modulus: float = 45e3
    shear_to_bulk: float = 0.5
    shear_factor: float = 1.0
    tensile_factor: float = 1.0
    solid: float = 2000.0
    gas_pressure: float = 0.0  # of the gas that the pores hold and keep
    eta: float = 0.0  # Σ (1 + eta rate^rate_n) while dust is compacted at a rate (1/s), and Y with it
    rate_n: float = 1.0
    crust: tuple[float, float] = (0.0, 1.0)  # Δφ, ℓ (m): φ + Δφ exp(-depth/ℓ)
    gradient: float = 0.0  # dφ/dz downwards, 1/m
    layers: tuple[float, float] = (0.0, 1.0)  # amplitude of φ, period (m)
    interface: tuple[float, float, float] = (0.0, 0.0, 1.0)  # depth, thickness (m), factor on Σ in it
    weakening: float = 0.0  # share of Σ that shear can take, and Y with it
    weakening_shear: float = 0.3  # plastic strain that takes half of that
    hardening: float = 0.0  # growth of Y per plastic strain
    # c, τ (s): Σ (1 - c ln(1 + t/τ)) at a time t since contact, and Y with it
    creep: tuple[float, float] = (0.0, 1.0)

    @property
    def law(self) -> np.ndarray:
        """The numbers that the mesh takes, in its order."""
        return np.array(
            [
                self.p_m, self.phi_1, self.phi_2, self.delta * np.log(10.0), self.bulk_modulus,
                self.shear_to_bulk, self.shear_factor, self.tensile_factor, self.solid,
                self.gas_pressure, self.filling_factor, self.eta, self.rate_n,
                self.weakening, self.weakening_shear, self.hardening, *self.creep, 0.0,
            ]
        )  # fmt: skip

    def fill(self, depth: np.ndarray) -> np.ndarray:
        """φ before the drop at a depth, m. A falling one ends near φ1: looser dust does not bear its weight, and how far it sinks
        goes with how deep the mesh is."""
        loosest = min(self.filling_factor, self.phi_1 + LOOSEST)
        graded = np.maximum(self.filling_factor + self.gradient * depth, loosest)
        layers = self.layers[0] * np.sin(2.0 * np.pi * depth / self.layers[1])
        return graded + self.crust[0] * np.exp(-depth / self.crust[1]) + layers


@dataclass(frozen=True)
class Forces:
    """On the projectile while it is in the dust, upwards, beside the dust's stress."""

    side: float = 0.0  # N per metre of immersed length
    shaft_drag: float = 0.0  # N s^2/m^2 per metre of immersed length
    pull: float = 0.0  # N
    viscous: float = 0.0  # N s/m
    inertial: float = 0.0  # N s^2/m^2
    film: tuple[float, float] = (0.0, 0.0)  # N, and the depth (m) that it reaches to
    gathered: float = 0.0  # not a force: share of the mass that is gathered per radius of depth

    @property
    def law(self) -> np.ndarray:
        """The numbers that the mesh takes, in its order, per radian."""
        held = [self.side, self.shaft_drag, self.pull, self.viscous, self.inertial, self.film[0]]
        return np.array([*(each / (2 * np.pi) for each in held), self.film[1]])


@dataclass(frozen=True)
class Numerics:
    cells: float = 8.0  # in a tip radius, where the mesh is even
    growth: float = 1.12  # of a cell to the next beyond ``even``; 1: even everywhere
    even: float = 1.5  # tip radii from the axis and from the surface
    width: float = 6.0  # tip radii
    depth: float = 6.0  # tip radii
    floor: float = np.inf  # m, of a hard bottom that lies higher
    courant: float = 0.6
    linear: float = 0.02  # bulk viscosity
    quadratic: float = 1.2
    hourglass: float = 0.1


@dataclass(frozen=True)
class Result:
    """time, depth, speed, force on the projectile: (k,), SI. r, z, volume, phi of the cells at the end: (n, m); nodes_r, nodes_z
    (n+1, m+1). energies in J, and energy_error in kinetic energies at contact."""

    time: np.ndarray = field(repr=False)
    depth: np.ndarray = field(repr=False)
    speed: np.ndarray = field(repr=False)
    force: np.ndarray = field(repr=False)
    stopping_time: float
    stopping_depth: float
    r: np.ndarray = field(repr=False)
    z: np.ndarray = field(repr=False)
    volume: np.ndarray = field(repr=False)
    phi: np.ndarray = field(repr=False)
    nodes_r: np.ndarray = field(repr=False)
    nodes_z: np.ndarray = field(repr=False)
    energies: dict[str, float]
    energy_error: float
    steps: int


def grade(even: float, whole: float, h: float, growth: float) -> np.ndarray:
    """Edges of the cells: h wide up to ``even``, from there each ``growth`` times the last, to ``whole`` at least."""
    edges = list(np.arange(round(even / h) + 1) * h)
    width = h
    while edges[-1] < whole - 0.5 * width:
        width *= growth
        edges.append(edges[-1] + width)
    return np.array(edges)


def lay_mesh(r: np.ndarray, z: np.ndarray, dust: Dust, gravity: float) -> np.ndarray:
    """Cells (n, m, 8) of dust at rest between nodes (n+1, m+1): under its own weight as far as it bears it elastically."""

    def mean(x: np.ndarray) -> np.ndarray:
        return 0.25 * (x[:-1, :-1] + x[1:, :-1] + x[:-1, 1:] + x[1:, 1:])

    cells = np.zeros((r.shape[0] - 1, r.shape[1] - 1, quadrilateral.COLUMNS))
    across_r, across_z = r[:-1, 1:] - r[1:, :-1], z[:-1, 1:] - z[1:, :-1]
    other_r, other_z = r[1:, 1:] - r[:-1, :-1], z[1:, 1:] - z[:-1, :-1]
    cells[..., quadrilateral.VOLUME] = mean(r) * 0.5 * (across_r * other_z - other_r * across_z)
    phi = dust.fill(-mean(z))
    cells[..., quadrilateral.PHI] = phi
    cells[..., quadrilateral.MASS] = phi * dust.solid * cells[..., quadrilateral.VOLUME]
    crush = np.vectorize(lambda each: quadrilateral.find_strengths(each, dust.law)[0])(phi)
    strength = np.where(
        np.abs(-mean(z) - dust.interface[0]) < 0.5 * dust.interface[1], dust.interface[2], 1.0
    )
    cells[..., quadrilateral.STRENGTH] = strength
    pressure = np.minimum(-phi * dust.solid * gravity * mean(z), 0.999 * crush * strength)
    cells[..., quadrilateral.PRESSURE] = pressure
    cells[..., quadrilateral.PHI0] = [
        [quadrilateral.find_unstressed(f, p, dust.bulk_modulus) for f, p in zip(*rows, strict=True)]
        for rows in zip(phi, pressure, strict=True)
    ]
    return cells


def find_elastic_energy(cells: np.ndarray, dust: Dust) -> float:
    """Per radian: what the way from φ to φ0′ gives back, and that of the deviatoric stress."""
    ratio = cells[..., quadrilateral.PHI] / cells[..., quadrilateral.PHI0]
    bulk = dust.bulk_modulus * (cells[..., quadrilateral.PHI0] / quadrilateral.REFERENCE) ** 4
    srr, szz, srz = (cells[..., k] for k in (quadrilateral.SRR, quadrilateral.SZZ, quadrilateral.SRZ))
    volumetric = bulk * ratio * (np.log(ratio) + 1.0 / ratio - 1.0)
    shear = (srr**2 + szz**2 + (srr + szz) ** 2 + 2.0 * srz**2) / (4.0 * dust.shear_to_bulk * bulk)
    return float(np.sum((volumetric + shear) * cells[..., quadrilateral.VOLUME]))


def find_gas_energy(cells: np.ndarray, dust: Dust) -> float:
    """Per radian: ∫ (P - P0) dV of the gas at one temperature, from its volume at the start to that now."""
    phi = cells[..., quadrilateral.PHI]
    start, now = 1.0 / dust.filling_factor - 1.0, 1.0 / phi - 1.0  # per volume of grains
    energy = dust.gas_pressure * (start * np.log(start / now) - start + now)
    return float(np.sum(energy * phi * cells[..., quadrilateral.VOLUME]))


def run_drop(
    dust: Dust,
    radius: float,
    speed: float,
    numerics: Numerics = Numerics(),
    mass: float | None = None,
    sphere: bool = False,
    gravity: float = 9.81,
    forces: Forces = Forces(),
    after: float = 1.0,
) -> Result:
    """Run one drop to its stop, or ``after`` times as long; mass (kg) is that of a glass bead by default.

    Raises RuntimeError where the mesh tangles.
    """
    mass = BEAD_DENSITY * 4 / 3 * np.pi * radius**3 if mass is None else mass
    h = radius / numerics.cells
    edges_r = grade(numerics.even * radius, numerics.width * radius, h, numerics.growth)
    edges_z = grade(numerics.even * radius, numerics.depth * radius, h, numerics.growth)
    if numerics.floor < edges_z[-1]:
        last = int(np.argmin(np.abs(edges_z - numerics.floor)))
        edges_z = edges_z[: last + 1] * numerics.floor / edges_z[last]
    r, z = (np.ascontiguousarray(x) for x in np.meshgrid(edges_r, -edges_z, indexing="ij"))
    cells = lay_mesh(r, z, dust, gravity)
    elastic = find_elastic_energy(cells, dust)
    curve = np.zeros((400_000, 4))
    body = np.array([radius, mass / (2 * np.pi), speed, float(sphere), forces.gathered])
    damping = np.array([numerics.linear, numerics.quadratic, numerics.hourglass])
    law, end = dust.law, 60.0 * radius
    steps, stopped, spent = quadrilateral.advance(
        r, z, cells, law, damping, body, forces.law, gravity, numerics.courant, end, after, curve
    )
    if steps < 0:
        raise RuntimeError(
            f"the mesh tangled {-curve[-steps, 1] / radius:.2f} tip radii deep; it serves to about 1.5 radii"
        )
    curve = curve[: steps + 1].copy()
    clock, height, velocity, force = curve.T
    if stopped == 0:
        raise RuntimeError(f"no stop within {clock[-1] * 1e3:.3g} ms")
    back = (
        velocity[stopped]
        / (velocity[stopped] - velocity[stopped - 1])
        * (clock[stopped] - clock[stopped - 1])
    )
    elastic = find_elastic_energy(cells, dust) - elastic
    gas = find_gas_energy(cells, dust)
    energies = {
        "kinetic at contact": 0.5 * mass * speed**2,
        "gravity": -mass * gravity * height[-1] - 2 * np.pi * spent[5],
        "kinetic": 2 * np.pi * spent[4] + 0.5 * mass * velocity[-1] ** 2,
        "elastic": 2 * np.pi * elastic,
        "gas": 2 * np.pi * gas,
        "plastic": 2 * np.pi * (spent[0] - elastic - gas),
        "viscous": 2 * np.pi * spent[1],
        "hourglass": 2 * np.pi * spent[2],
        "contact": 2 * np.pi * spent[3],
        "forces": 2 * np.pi * spent[6],
        "gathered mass": 2 * np.pi * spent[7],
    }
    brought, gained, *left = energies.values()
    return Result(
        time=clock,
        depth=-height,
        speed=-velocity,
        force=2 * np.pi * force,
        stopping_time=clock[stopped] - back,
        stopping_depth=-(height[stopped] - 0.5 * back * velocity[stopped]),
        r=0.25 * (r[:-1, :-1] + r[1:, :-1] + r[:-1, 1:] + r[1:, 1:]),
        z=0.25 * (z[:-1, :-1] + z[1:, :-1] + z[:-1, 1:] + z[1:, 1:]),
        volume=2 * np.pi * cells[..., quadrilateral.VOLUME],
        phi=cells[..., quadrilateral.PHI],
        nodes_r=r,
        nodes_z=z,
        energies=energies,
        energy_error=(brought + gained - sum(left)) / brought,
        steps=steps,
    )
