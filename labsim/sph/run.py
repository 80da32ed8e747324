"""What a drop gave: its curve, the dust at the stop, and how far momentum and energy balance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..records import FloatArray
from . import particles as rows
from ._jit import solver_hash
from .materials.porous_dust import gas_energy
from .setting import DropSetting

CURVE_POINTS = 500  # kept of the curve, at most


@dataclass(frozen=True)
class Particles:
    """Dust at the stop, arrays of shape (n,): r (or x), z in m with z = 0 at the undisturbed surface; volume in m³ (in the
    plane m² per particle, a volume per metre); pressure and shear (√(3 J2)) in Pa; speeds in m/s."""

    r: FloatArray
    z: FloatArray
    volume: FloatArray
    filling_factor: FloatArray
    initial_filling_factor: FloatArray
    pressure: FloatArray
    shear: FloatArray
    speed_r: FloatArray
    speed_z: FloatArray


@dataclass(frozen=True)
class DropRun:
    """Arrays time (s, 0 at contact), depth (m), velocity (m/s, downwards), force (N, on the projectile) of shape (m,)."""

    setting: DropSetting
    time: FloatArray
    depth: FloatArray
    velocity: FloatArray
    force: FloatArray
    penetration_depth: float  # m, at the first v = 0
    stopping_time: float  # s
    stopped: bool
    particles: Particles
    steps: int
    rebuilds: int
    wall: float  # s
    momentum_error: float  # of m v
    energy_error: float  # of the kinetic energy at contact
    energies: dict[str, float]  # J (planar: J/m), between contact and the end of the run
    viscous_share: float  # heat of artificial viscosity until the stop, of the energy that was brought in
    solver: str
    warnings: tuple[str, ...] = ()

    @property
    def updates_per_s(self) -> float:
        return self.particles.r.size * self.steps / self.wall

    def compacted_volume(self, threshold: float) -> float:
        """Volume of dust with a filling factor above ``threshold``, m³ (planar: m²)."""
        return float(self.particles.volume[self.particles.filling_factor > threshold].sum())

    def depth_at(self, time: FloatArray) -> FloatArray:
        """Depth (m) at times (s) from contact; before it free fall without gravity, after the run's end at rest."""
        before = np.minimum(time, 0.0) * self.velocity[0]
        return np.interp(time, self.time, self.depth) + before


def make_run(
    setting: DropSetting,
    log: FloatArray,
    stop_step: int | None,
    at_stop: FloatArray,
    at_end: FloatArray,
    at_start: FloatArray,
    wall: np.ndarray,
    per_unit: float,
    rebuilds: int,
    seconds: float,
) -> DropRun:
    """Book momentum and energy, thin the curve, and pack the record."""
    planar = setting.geometry == "planar"
    stop = stop_step if stop_step is not None else len(log) - 1
    body_mass = setting.projectile.mass / per_unit
    warnings = []
    if stop_step is None:
        warnings.append(f"did not stop within {setting.duration * 1e3:.3g} ms")
    clamped = np.mean(at_stop[rows.DENSITY] / setting.monomer_density > setting.material.phi_2 - 0.002)
    if clamped > 1e-3:
        warnings.append(f"φ was at its upper limit φ2 in {100 * clamped:.2g} % of the particles")

    brought = body_mass * setting.impact_speed
    momentum = float(np.sum(at_end[rows.MASS] * at_end[rows.W])) - body_mass * log[-1, 2]
    missing = momentum + brought - (log[-1, 4] + log[-1, 5])
    kinetic_0 = 0.5 * body_mass * setting.impact_speed**2

    mass = at_end[rows.MASS]
    dust_kinetic = 0.5 * float(np.sum(mass * (at_end[rows.U] ** 2 + at_end[rows.W] ** 2)))
    body_kinetic = 0.5 * body_mass * log[-1, 2] ** 2
    fallen = body_mass * log[-1, 1] - float(np.sum(mass * (at_end[rows.Z] - at_start[rows.Z])))
    stress_work = float(np.sum(mass * at_end[rows.WORK]))
    elastic = float(np.sum(mass * (at_end[rows.ELASTIC] - at_start[rows.ELASTIC])))
    gas = float(
        np.sum(
            mass
            * gas_energy(
                at_end[rows.DENSITY], at_end[rows.INITIAL], setting.pore_gas, setting.monomer_density
            )
        )
    )
    energies = {
        "kinetic_at_contact": kinetic_0,
        "gravity": setting.gravity * fallen,
        "kinetic": dust_kinetic + body_kinetic,
        "elastic": elastic,
        "gas": gas,
        "plastic": stress_work - elastic - gas,
        "viscous": float(log[-1, 6]),
        "friction": float(log[-1, 7]),
        "outside": float(log[-1, 9]),
        "contact": float(log[-1, 8]),
    }
    spent = sum(
        energies[k]
        for k in ("kinetic", "elastic", "gas", "plastic", "viscous", "friction", "outside", "contact")
    )
    energy_error = (kinetic_0 + energies["gravity"] - spent) / kinetic_0
    viscous_share = float(log[stop, 6]) / (kinetic_0 + body_mass * setting.gravity * log[stop, 1])

    # the stop lies between the last step with v > 0 and the first without
    if stop_step is not None and log[stop, 2] != log[stop - 1, 2]:
        part = log[stop - 1, 2] / (log[stop - 1, 2] - log[stop, 2])
    else:
        part = 1.0
    stopping_time = log[stop - 1, 0] + part * (log[stop, 0] - log[stop - 1, 0])
    depth = log[stop - 1, 1] + 0.5 * part * log[stop - 1, 2] * (log[stop, 0] - log[stop - 1, 0])

    keep = np.unique(
        np.append(np.arange(0, len(log), math.ceil(len(log) / CURVE_POINTS)), [stop, len(log) - 1])
    )
    sxx, szz, sxz = at_stop[rows.SXX], at_stop[rows.SZZ], at_stop[rows.SXZ]
    dust = Particles(
        r=at_stop[rows.X],
        z=at_stop[rows.Z],
        volume=at_stop[rows.MASS] / at_stop[rows.DENSITY] * (1.0 if planar else per_unit),
        filling_factor=at_stop[rows.DENSITY] / setting.monomer_density,
        initial_filling_factor=at_stop[rows.INITIAL],
        pressure=at_stop[rows.PRESSURE],
        shear=np.sqrt(1.5 * (sxx**2 + szz**2 + (sxx + szz) ** 2) + 3 * sxz**2),
        speed_r=at_stop[rows.U],
        speed_z=at_stop[rows.W],
    )
    return DropRun(
        setting=setting,
        time=log[keep, 0],
        depth=log[keep, 1],
        velocity=log[keep, 2],
        force=log[keep, 3] * per_unit,
        penetration_depth=float(depth),
        stopping_time=float(stopping_time),
        stopped=stop_step is not None,
        particles=dust,
        steps=len(log) - 1,
        rebuilds=rebuilds,
        wall=seconds,
        momentum_error=float(missing / brought),
        energy_error=float(energy_error),
        energies={key: value * per_unit for key, value in energies.items()},
        viscous_share=viscous_share,
        solver=solver_hash(),
        warnings=tuple(warnings),
    )
