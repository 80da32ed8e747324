"""The compacted zone of a CT map in the likelihood: simulated dust seen through the scan, in the frame of the tip.

Codes of scan runs are (ln D, filling factor on the scan's cells), the simulated dust moved so that its deepest tip lies where the
scan's bead ends: the zone under the tip changes slowly with speed and p_m, the depth that it lies at does not. The bead rebounds
by some tens of micrometres after the dust has stopped moving, so both are compared up to a common LIFT. Further nuisances:
impact speed (stated, moved to its best value), grey level (GREY), sample scatter. Noise: the map's own, correlated between
neighbouring cells as measured in undisturbed dust, and the solver's error of the compaction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...ct.project import project
from ...ct.reduce import ReducedScan
from ...effects import Instrument
from ...records import FillingMap, FloatArray, Scan
from ...sph import DropRun
from ..blocks import Block
from ..forward import ResponseTable
from ..run_parts import Compaction
from . import RunFeatures
from .drop_terms import Probe, Terms
from .undisturbed import GREY, observe_undisturbed

LIFT = 60e-6  # m, of the bead at rest over its lowest point
NUMERICAL_DEPTH = 0.03  # of the depth: slow, shallow drops differ by up to 4 % between two codes
# (share of φ - φ0, length in tip radii) of the solver's error: what two spacings and the interpolation between runs leave
# beside the tip, and the overshoot of a compaction front, which is alike over the whole zone
NUMERICAL = ((0.04, 0.25), (0.06, 0.8))
NUMERICAL_FLOOR = 0.0015
STRENGTH = 0.15  # of ln p_m by which the zones of two codes differ, most under shallow drops
CONTRAST = 0.10  # of φ - φ0 as a whole: docs/numerics.md, compacted volumes of two codes
# of φ - φ0 where it is small against its largest: how far the compaction reaches. Two codes approach each other from both sides
# as they are refined, and differ by 15 to 35 % there under deep beads (docs/numerics.md)
REACH = 0.2


@dataclass(frozen=True)
class ObservedScan:
    """Cells of a map that are compared. cells : (nz, nr) which; filling_factor, sigma : (n,); undisturbed : of the whole
    scan; beside : (n,) filling factor of the undisturbed dust at the depth of each cell, which crusts and gradients change."""

    scan: Scan
    reduced: ReducedScan
    cells: np.ndarray  # (nz, nr) bool
    filling_factor: FloatArray
    sigma: FloatArray
    undisturbed: float
    beside: FloatArray

    @property
    def name(self) -> str:
        return self.scan.name

    @property
    def radius(self) -> float:
        return self.scan.projectile.tip_radius

    @cached_property
    def noise(self) -> FloatArray:
        """(n, n) covariance of the map's own noise, correlated between neighbours."""
        errors = self.reduced.errors
        near_r, near_z = (np.clip(c, 0.0, 0.95) for c in (errors.correlation_r, errors.correlation_z))
        apart_r, apart_z = self._apart()
        return np.asarray(np.outer(self.sigma, self.sigma) * near_r**apart_r * near_z**apart_z)

    @cached_property
    def likeness(self) -> list[FloatArray]:
        """(n, n) correlations of each of the solver's errors in NUMERICAL."""
        apart_r, apart_z = self._apart()
        cell = float(np.mean(np.diff(self.reduced.map.r)))
        distance2 = (apart_r**2 + apart_z**2) * (cell / self.radius) ** 2
        return [np.exp(-0.5 * distance2 / length**2) for _share, length in NUMERICAL]

    def _apart(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, n) distances between the cells, in cells."""
        rows, columns = np.nonzero(self.cells)
        return np.abs(np.subtract.outer(columns, columns)), np.abs(np.subtract.outer(rows, rows))


def observe_scan(reduced: ReducedScan) -> ObservedScan:
    """Choose the cells: within three tip radii of the axis, from two below the tip to a third above it."""
    found, radius = reduced.map, reduced.scan.projectile.tip_radius
    r, z = np.meshgrid(found.r, found.z)
    inside = (r < 3 * radius) & (z < -0.25 * radius)
    cells = reduced.usable & inside & (np.abs(z + found.tip_depth + 0.85 * radius) < 1.15 * radius)
    level = float(reduced.undisturbed.value)
    dust = observe_undisturbed(reduced)
    beside = np.full(r.shape, level) if dust is None else np.interp(-z, dust.depth, dust.filling_factor)
    return ObservedScan(
        reduced.scan,
        reduced,
        cells,
        found.filling_factor[cells],
        np.maximum(found.sigma[cells], 1e-4),
        level,
        beside[cells],
    )


def see_dust(
    run: DropRun | Compaction,
    frame: FillingMap,
    blur: float,
    *,
    scale: float = 1.0,
    masked: np.ndarray | None = None,
) -> FloatArray:
    """Filling factor of a run's dust on a map's cells, (nz, nr), moved so that its deepest tip lies where the map's bead ends."""
    dust = run.particles
    return project(
        dust.r,
        dust.z,
        dust.volume,
        dust.filling_factor,
        frame,
        blur=blur,
        scale=scale,
        shift=run.penetration_depth - frame.tip_depth,
        masked=masked,
        of_particles=True,
    )


def encode_scan_run(run: DropRun | Compaction, observed: ObservedScan) -> FloatArray:
    """(1 + n,): ln D and the filling factor on the compared cells, through the point spread that the scan itself shows."""
    reduced = observed.reduced
    seen = see_dust(run, reduced.map, reduced.point_spread, masked=~observed.cells)
    return np.concatenate([[math.log(run.penetration_depth)], seen[observed.cells]])


@dataclass(frozen=True)
class CompactedZone:
    """The zone of one scan that is compared, an Observation. Nuisances : (1,) ln of the impact speed."""

    observed: ObservedScan
    features: tuple[RunFeatures, ...]
    kind: str = "map"

    @property
    def name(self) -> str:
        return f"map {self.observed.name}"

    @property
    def table(self) -> ResponseTable:
        return self.features[0].table

    def begin(self) -> FloatArray:
        return np.array([math.log(self.observed.scan.speed.value)])

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Probe,
        terms: Terms,
        probes: Mapping[str, Probe],
    ) -> Block:
        observed, log_speed = self.observed, float(nuisances[0])
        found = observed.reduced.map
        amplitudes, instrument = nominal.amplitudes, nominal.instruments[observed.name]
        response = self.table.at(log_p_m, log_speed)

        def see(code: FloatArray, inst: Instrument) -> FloatArray:
            return np.concatenate([code[1:] * inst.ct_scale, [math.exp(code[0])]])

        def predict(lp: float, ls: float) -> FloatArray:
            return see(self.table.code(lp, ls, amplitudes), instrument)

        here = see(response.code(amplitudes), instrument)
        changed = np.zeros(here.size - 1)  # of the compaction, not of the dust that it began with
        if amplitudes:
            plain = see(response.code({}), instrument)[:-1] - observed.undisturbed
            changed = here[:-1] - observed.beside - plain
        data = np.concatenate([observed.filling_factor, [found.tip_depth]])
        n = data.size - 1
        covariance = np.zeros((n + 1, n + 1))
        covariance[:n, :n] = observed.noise
        contrast = np.abs(here[:n] - observed.beside)
        for (share, _length), alike in zip(NUMERICAL, observed.likeness, strict=True):
            error = share * contrast + NUMERICAL_FLOOR / math.sqrt(len(NUMERICAL))
            covariance[:n, :n] += np.outer(error, error) * alike
        covariance[n, n] = (NUMERICAL_DEPTH * here[n]) ** 2
        speed = observed.scan.speed
        spread = speed.sigma / speed.value
        reach = REACH * contrast * (1.0 - np.minimum(contrast / max(float(np.max(contrast)), 1e-12), 1.0))
        by_strength = (predict(log_p_m + 0.02, log_speed) - here) / 0.02
        local = [
            (predict(log_p_m, log_speed + 0.02) - here) / 0.02 * spread,
            by_strength * math.hypot(terms.scatter, STRENGTH),
            np.append(here[:n] * GREY, 0.0),
            np.append((here[:n] - observed.beside) * CONTRAST, 0.0),
            np.append(reach, 0.0),
            np.append(changed * terms.zone_change, 0.0),
            np.append(_slope_along_z(observed, here[:n]), -1.0) * LIFT,
        ]
        pull = (log_speed - float(self.begin()[0])) / spread
        columns = np.stack(local, axis=1)
        covariance += columns @ columns.T
        covariance[np.diag_indices(n + 1)] += 1e-12
        tangents = {"ln_p_m": by_strength}
        for name, point in probes.items():
            moved = see(response.code(point.amplitudes), point.instruments[observed.name])
            tangents[name] = (moved - here) / point.step
        residual = data - here + local[0] * pull  # the speed is zero-mean about what is stated
        # what an unknown cause changes is alike in all cells of like contrast
        size = np.append(contrast, 0.0)
        like = np.exp(-0.5 * (np.subtract.outer(size, size) / (0.3 * max(float(size.max()), 1e-12))) ** 2)
        return Block(residual, covariance, tangents, np.outer(size, size) * like, columns[:, :1])

    def follow(self, nuisances: FloatArray, block: Block, weighted: FloatArray) -> tuple[FloatArray, float]:
        """The move in two stated uncertainties of the speed."""
        assert block.nuisances is not None
        spread = self.observed.scan.speed.sigma / self.observed.scan.speed.value
        best = np.clip(block.nuisances.T @ weighted, -3.0, 3.0)
        moved = self.begin() + best * spread
        return moved, 0.5 * float(np.abs(moved - nuisances).max()) / spread


def _slope_along_z(observed: ObservedScan, cells: FloatArray) -> FloatArray:
    full = np.full(observed.cells.shape, np.nan)
    full[observed.cells] = cells
    slope = np.gradient(full, observed.reduced.map.z, axis=0)
    return np.nan_to_num(slope[observed.cells])
