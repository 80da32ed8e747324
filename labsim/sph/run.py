"""What a drop or a push gave: its curve, the dust at the stop, and how far momentum and energy balance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ..records import FloatArray, Summarised
from . import particles as rows
from .materials import find_law, solver_hash
from .materials._parts import gas_energy
from .reconstruction import differentiate_field, share_above
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


@dataclass(frozen=True, repr=False)
class DropRun(Summarised):
    """Arrays time (s, 0 at contact), depth (m), velocity (m/s, downwards), force (N, on the projectile) and shaft_work (J since
    contact, of the part of the force that acts along an upright surface) of shape (m,)."""

    setting: DropSetting
    time: FloatArray
    depth: FloatArray
    velocity: FloatArray
    force: FloatArray
    shaft_work: FloatArray
    penetration_depth: float  # m, at the first v = 0, or where its path ended
    stopping_time: float  # s
    stopped: bool  # or led to the end of its path
    particles: Particles
    steps: int
    rebuilds: int
    wall: float  # s
    momentum_error: float  # of m v
    energy_error: float  # of the kinetic energy at contact and what forces from outside gave
    energies: dict[str, float]  # J (planar: J/m), between contact and the end of the run
    viscous_share: float  # heat of artificial viscosity until the stop, of the energy that was brought in
    solver: str
    warnings: tuple[str, ...] = ()

    def say(self) -> str:
        """What was dropped, how deep and how long, and how well the book of energy closes."""
        law, stop = Path(self.setting.material.law).stem, "after" if self.stopped else "not at rest after"
        return (
            f"{self.setting.projectile.tip} of {2e3 * self.setting.projectile.tip_radius:.3g} mm into {law}: "
            f"{self.penetration_depth * 1e3:.4g} mm deep {stop} {self.stopping_time * 1e3:.4g} ms, "
            f"energy {self.energy_error:+.2%}"
        )

    @property
    def fell_through(self) -> bool:
        """Whether it ended before its time without a stop: where the bottom of the dust begins to be felt."""
        return not self.stopped and bool(self.time[-1] < self.setting.duration)

    @property
    def updates_per_s(self) -> float:
        return self.particles.r.size * self.steps / self.wall

    def compacted_volume(self, threshold: float) -> float:
        """Volume of dust with a filling factor above ``threshold``, m³ (planar: m²): φ is linear inside each particle's cell."""
        across_r, across_z = self._across_cells
        share = share_above(self.particles.filling_factor - threshold, across_r, across_z)
        return float(np.sum(share * self.particles.volume))

    @cached_property
    def _across_cells(self) -> tuple[FloatArray, FloatArray]:
        """What φ changes by from the middle of each particle's cell to its edges."""
        p = self.particles
        axisymmetric = self.setting.geometry == "axisymmetric"
        area = p.volume / (2 * math.pi * np.abs(p.r)) if axisymmetric else p.volume
        h = self.setting.numerics.smoothing * self.setting.spacing
        by_r, by_z = differentiate_field(p.r, p.z, area, p.filling_factor, h, axisymmetric)
        half = 0.5 * np.sqrt(area)
        return half * by_r, half * by_z

    def energy_share(self, sink: str) -> float:
        """What went into ``sink``, a name in ``energies``, of the kinetic energy at contact and of what gravity and a driver
        gave."""
        given = (
            self.energies["kinetic_at_contact"] + self.energies["gravity"] + self.energies.get("driver", 0.0)
        )
        return self.energies[sink] / given if given else 0.0

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
    """Book momentum and energy, thin the curve, and pack the record. A projectile that is led has no place in the books: what
    its driver gives goes into the dust."""
    law = find_law(setting.material.law)
    planar = setting.geometry == "planar"
    stop = stop_step if stop_step is not None else len(log) - 1
    led = setting.path[0].size > 0
    body_mass = 0.0 if led else setting.projectile.mass / per_unit
    warnings = []
    if stop_step is None:
        what = "reach the end of its path" if led else "stop"
        within = f"{setting.duration * 1e3:.3g} ms"
        if log[-1, 0] < setting.duration:
            within = f"{setting.extent[1] * 1e3:.3g} mm of dust"
        warnings.append(f"did not {what} within {within}")
    warnings += law.find_warnings(setting, *rows.name_rows(setting, at_stop))

    brought = body_mass * setting.impact_speed
    momentum = float(np.sum(at_end[rows.MASS] * at_end[rows.W])) - body_mass * log[-1, 2]
    missing = momentum + brought - (log[-1, 4] + log[-1, 5])
    kinetic_0 = 0.5 * body_mass * setting.impact_speed**2

    mass = at_end[rows.MASS]
    dust_kinetic = 0.5 * float(np.sum(mass * (at_end[rows.U] ** 2 + at_end[rows.W] ** 2)))
    body_kinetic = 0.5 * body_mass * log[-1, 2] ** 2
    fallen = body_mass * log[-1, 1] - float(np.sum(mass * (at_end[rows.Z] - at_start[rows.Z])))
    stress_work = float(np.sum(mass * at_end[rows.WORK]))
    exchanged = float(np.sum(mass * at_end[rows.EXCHANGED]))
    elastic = float(np.sum(mass * (at_end[rows.ELASTIC] - at_start[rows.ELASTIC])))
    gas = float(np.sum(mass * gas_energy(setting, rows.name_rows(setting, at_end)[0])))
    energies = {
        "kinetic_at_contact": kinetic_0,
        "gravity": setting.gravity * fallen,
        "kinetic": dust_kinetic + body_kinetic,
        "elastic": elastic,
        "gas": gas,
        "plastic": stress_work - elastic - gas - exchanged,
        "exchange": exchanged,
        "viscous": float(log[-1, 6]),
        "friction": float(log[-1, 7]),
        "outside": float(log[-1, 9]),
        "contact": float(log[-1, 8]),
    }
    driver = float(log[-1, 10])
    if led:
        energies["driver"] = driver
        brought = float(np.sum(np.abs(log[1:, 3]) * np.diff(log[:, 0])))
    sources = ("kinetic_at_contact", "gravity", "driver")
    spent = sum(energies[sink] for sink in energies if sink not in sources)
    scale = max(map(abs, energies.values())) if led else kinetic_0 + max(-energies["outside"], 0.0)
    energy_error = (kinetic_0 + energies["gravity"] + driver - spent) / (scale or 1.0)
    given = kinetic_0 + body_mass * setting.gravity * log[stop, 1] + log[stop, 10]
    viscous_share = float(log[stop, 6]) / (given or 1.0)

    # the stop lies between the last step with v > 0 and the first without
    if stop_step is not None and not led and log[stop, 2] != log[stop - 1, 2]:
        part = log[stop - 1, 2] / (log[stop - 1, 2] - log[stop, 2])
    else:
        part = 1.0
    stopping_time = log[stop - 1, 0] + part * (log[stop, 0] - log[stop - 1, 0])
    depth = log[stop - 1, 1] + 0.5 * part * log[stop - 1, 2] * (log[stop, 0] - log[stop - 1, 0])
    if led:
        depth = log[stop, 1]

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
        shaft_work=log[keep, 11] * per_unit,
        penetration_depth=float(depth),
        stopping_time=float(stopping_time),
        stopped=stop_step is not None,
        particles=dust,
        steps=len(log) - 1,
        rebuilds=rebuilds,
        wall=seconds,
        momentum_error=float(missing / (brought or 1.0)),
        energy_error=float(energy_error),
        energies={key: value * per_unit for key, value in energies.items()},
        viscous_share=viscous_share,
        solver=solver_hash(setting.material.law),
        warnings=tuple(warnings),
    )
