"""The compacted zones of CT maps in the likelihood: simulated dust seen through each scan, in the frame of the tip.

Features of scan runs are (ln D, filling factor on the scan's cells), the simulated dust moved so that its deepest tip lies
where the scan's bead ends: the zone under the tip changes slowly with speed and p_m, the depth that it lies at does not. The
bead rebounds by some tens of micrometres after the dust has stopped moving, so both are compared up to a LIFT. Each scan has
noise of its own, correlated between neighbouring cells as measured in undisturbed dust, its speed and its sample's strength.
The solver errs alike in drops that are alike, so its errors are common to scans as they are to drops, and the grey level is the
scanner's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import block_diag
from scipy.spatial.distance import cdist

from ...ct.project import project
from ...ct.reduce import ReducedScan
from ...effects import Instrument
from ...records import FillingMap, FloatArray, Scan
from ...runs.parts import Compaction
from ...sph import DropRun
from ..emulation.forward import ResponseTable
from ..fits.blocks import Block, lay_out
from . import RunFeatures
from .linearised_drop import ErrorBudget, Perturbation, measure_distances
from .undisturbed import GREY, observe_undisturbed

LIFT = 60e-6  # m, of the bead at rest over its lowest point
NUMERICAL_DEPTH = 0.03  # of the depth: slow, shallow drops differ by up to 4 % between two codes
# (share of φ - φ0, length in tip radii) of the solver's error: what two spacings and the interpolation between runs leave
# beside the tip, and the overshoot of a compaction front, which is alike over the whole zone
NUMERICAL = ((0.04, 0.25), (0.06, 0.8))
NUMERICAL_FLOOR = 0.0015
STRENGTH = 0.15  # of ln p_m by which the zones of two codes differ, most under shallow drops
CONTRAST = 0.10  # of φ - φ0 as a whole: docs/other-methods.md, compacted volumes
# error of an exponent on (φ - φ0) over its largest: how far the compaction reaches. Two codes approach each other from both
# sides as they are refined; where φ - φ0 is a twentieth of its largest they differ by half of it (docs/dust-at-the-tip.md)
REACH = 0.2


@dataclass(frozen=True)
class ObservedScan:
    """Cells of a map that are compared. point_spread : m, that the scan itself shows; correlation : of noise between cells that
    are neighbours along r and along z; cells : (nz, nr) which; filling_factor, sigma : (n,); undisturbed : of the whole scan;
    beside : (n,) filling factor of the undisturbed dust at the depth of each cell, which crusts and gradients change."""

    scan: Scan
    map: FillingMap
    point_spread: float
    correlation: tuple[float, float]
    cells: Bool[np.ndarray, "nz nr"]
    filling_factor: Float[np.ndarray, " n"]
    sigma: Float[np.ndarray, " n"]
    undisturbed: float
    beside: Float[np.ndarray, " n"]

    @property
    def name(self) -> str:
        return self.scan.name

    @property
    def radius(self) -> float:
        return self.scan.projectile.tip_radius

    @cached_property
    def noise(self) -> FloatArray:
        """(n, n) covariance of the map's own noise, correlated between neighbours."""
        near_r, near_z = (np.clip(c, 0.0, 0.95) for c in self.correlation)
        apart_r, apart_z = self._apart()
        return np.asarray(np.outer(self.sigma, self.sigma) * near_r**apart_r * near_z**apart_z)

    @cached_property
    def about_tip(self) -> FloatArray:
        """(n, 2) places of the cells from the lowest point of the bead, in tip radii."""
        found = self.map
        r, z = (grid[self.cells] for grid in np.meshgrid(found.r, found.z))
        return np.stack([r, z + found.tip_depth], axis=1) / self.radius

    def _apart(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, n) distances between the cells, in cells."""
        rows, columns = np.nonzero(self.cells)
        return np.abs(np.subtract.outer(columns, columns)), np.abs(np.subtract.outer(rows, rows))


def observe_scan(reduced: ReducedScan) -> ObservedScan:
    """Choose the cells: within three tip radii of the axis, from two below the tip to a third above it, none with air in it."""
    found, radius = reduced.map, reduced.scan.projectile.tip_radius
    r, z = np.meshgrid(found.r, found.z)
    inside = (r < 3 * radius) & (z < -max(0.25 * radius, reduced.edge))
    cells = reduced.usable & inside & (np.abs(z + found.tip_depth + 0.85 * radius) < 1.15 * radius)
    level = float(reduced.undisturbed.value)
    dust = observe_undisturbed(reduced)
    beside = np.full(r.shape, level) if dust is None else np.interp(-z, dust.depth, dust.filling_factor)
    return ObservedScan(
        reduced.scan,
        found,
        reduced.point_spread,
        (reduced.errors.correlation_r, reduced.errors.correlation_z),
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


def extract_map(run: DropRun | Compaction, observed: ObservedScan) -> FloatArray:
    """(1 + n,): ln D and the filling factor on the compared cells, through the point spread that the scan itself shows."""
    seen = see_dust(run, observed.map, observed.point_spread, masked=~observed.cells)
    return np.concatenate([[math.log(run.penetration_depth)], seen[observed.cells]])


@dataclass(frozen=True)
class LinearisedZone:
    """One scan about one point. residual : (n + 1,) of the cells and the tip's depth; own : (n + 1, n + 1) covariance of what no
    other scan shares; tangents : name -> (n + 1,); speed : (n + 1,) per standard uncertainty of the stated speed; grey : (n + 1,)
    what its error changes; solver : (n + 1, errors) those of the solver that go through the whole zone; contrast : (n,) |φ - φ0|;
    reach : ln of the simulated depth over the tip radius."""

    residual: Float[np.ndarray, " m"]
    own: Float[np.ndarray, "m m"]
    tangents: Mapping[str, Float[np.ndarray, " m"]]
    speed: Float[np.ndarray, " m"]
    grey: Float[np.ndarray, " m"]
    solver: Float[np.ndarray, "m errors"]
    contrast: Float[np.ndarray, " n"]
    reach: float


@dataclass(frozen=True)
class CompactedZone:
    """The zone of one scan that is compared."""

    observed: ObservedScan
    features: RunFeatures

    @property
    def name(self) -> str:
        return self.observed.name

    @property
    def table(self) -> ResponseTable:
        return self.features.table

    @property
    def spread(self) -> float:
        """Standard uncertainty of ln of the stated speed."""
        speed = self.observed.scan.speed
        return speed.sigma / speed.value

    def linearise(
        self,
        log_speed: float,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> LinearisedZone:
        """Residual, errors and tangents."""
        observed = self.observed
        found = observed.map
        amplitudes, instrument = nominal.amplitudes, nominal.instruments[observed.name]
        response = self.table.at(log_p_m, log_speed)

        def see(features: FloatArray, inst: Instrument) -> FloatArray:
            return np.concatenate([features[1:] * inst.ct_scale, [math.exp(features[0])]])

        def predict(lp: float, ls: float) -> FloatArray:
            return see(self.table.features(lp, ls, amplitudes), instrument)

        here = see(response.features(amplitudes), instrument)
        changed = np.zeros(here.size - 1)  # of the compaction, not of the dust that it began with
        if amplitudes:
            plain = see(response.features({}), instrument)[:-1] - observed.undisturbed
            changed = here[:-1] - observed.beside - plain
        data = np.concatenate([observed.filling_factor, [found.tip_depth]])
        n = data.size - 1
        contrast = np.abs(here[:n] - observed.beside)
        share = np.clip(contrast / max(float(np.max(contrast)), 1e-12), 1e-6, 1.0)
        reach = -REACH * contrast * np.log(share)
        by_speed = (predict(log_p_m, log_speed + 0.02) - here) / 0.02 * self.spread
        by_strength = (predict(log_p_m + 0.02, log_speed) - here) / 0.02
        local = [
            by_speed,
            by_strength * budget.scatter,
            np.append(_slope_along_z(observed, here[:n]), -1.0) * LIFT,
        ]
        own = np.zeros((n + 1, n + 1))
        own[:n, :n] = observed.noise
        columns = np.stack(local, axis=1)
        own += columns @ columns.T
        own[np.diag_indices(n + 1)] += 1e-12
        solver = [
            by_strength * STRENGTH,
            np.append((here[:n] - observed.beside) * CONTRAST, 0.0),
            np.append(reach, 0.0),
            np.append(changed * budget.zone_change, 0.0),
            np.append(np.zeros(n), NUMERICAL_DEPTH * here[n]),
        ]
        tangents = {"ln_p_m": by_strength}
        for name, point in perturbations.items():
            moved = see(response.features(point.amplitudes), point.instruments[observed.name])
            tangents[name] = (moved - here) / point.step
        pull = (log_speed - math.log(observed.scan.speed.value)) / self.spread
        return LinearisedZone(
            data - here + by_speed * pull,  # the speed is zero-mean about what is stated
            own,
            tangents,
            by_speed,
            np.append(here[:n] * GREY, 0.0),
            np.stack(solver, axis=1),
            contrast,
            math.log(float(here[n]) / observed.radius),
        )


@dataclass(frozen=True)
class CompactedZones:
    """The zones of all scans that are compared, an Observation. Nuisances : (scans,) ln of the impact speeds."""

    zones: tuple[CompactedZone, ...]
    kind: str = "map"

    @property
    def name(self) -> str:
        return f"map {self.zones[0].name}" if len(self.zones) == 1 else "maps"

    @property
    def features(self) -> tuple[RunFeatures, ...]:
        return tuple(zone.features for zone in self.zones)

    @cached_property
    def likeness(self) -> list[FloatArray]:
        """(n, n) correlations of each of the solver's errors in NUMERICAL by the places of the cells; none of the depths."""
        each = [zone.observed.about_tip for zone in self.zones]
        places = np.concatenate(each)
        cells = np.concatenate([np.append(np.ones(len(one), bool), False) for one in each])
        found: list[FloatArray] = []
        for _share, length in NUMERICAL:
            alike = np.zeros((cells.size,) * 2)
            alike[np.ix_(cells, cells)] = np.exp(-0.5 * cdist(places, places, "sqeuclidean") / length**2)
            found.append(alike)
        return found

    def begin(self) -> FloatArray:
        return np.array([math.log(zone.observed.scan.speed.value) for zone in self.zones])

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> Block:
        parts = [
            zone.linearise(float(log_speed), log_p_m, nominal, budget, perturbations)
            for zone, log_speed in zip(self.zones, nuisances, strict=True)
        ]
        sections = lay_out(part.residual.size for part in parts)
        own = np.concatenate([np.full(part.residual.size, k) for k, part in enumerate(parts)])
        alike = self._find_alike(parts)[np.ix_(own, own)]
        contrasts = [np.append(part.contrast, 0.0) for part in parts]
        contrast = np.concatenate(contrasts)
        covariance = np.zeros(alike.shape)
        for (share, _length), places in zip(NUMERICAL, self.likeness, strict=True):
            error = share * contrast + NUMERICAL_FLOOR / math.sqrt(len(NUMERICAL))
            covariance += np.outer(error, error) * places
        solver = np.concatenate([part.solver for part in parts])
        covariance = (covariance + solver @ solver.T) * alike
        grey = np.concatenate([part.grey for part in parts])
        covariance += np.outer(grey, grey)
        speeds = np.zeros((own.size, len(parts)))
        for k, (part, section) in enumerate(zip(parts, sections, strict=True)):
            covariance[section, section] += part.own
            speeds[section, k] = part.speed
        return Block(
            np.concatenate([part.residual for part in parts]),
            covariance,
            {
                name: np.concatenate([part.tangents[name] for part in parts])
                for name in ("ln_p_m", *perturbations)
            },
            partial(_let_contrasts_change, contrasts),
            speeds,
            {zone.name: section for zone, section in zip(self.zones, sections, strict=True)},
        )

    def _find_alike(self, parts: Sequence[LinearisedZone]) -> FloatArray:
        """(scans, scans) correlations of the solver's errors."""
        drops = []
        for zone, part in zip(self.zones, parts, strict=True):
            radius, mass = zone.observed.radius, zone.observed.scan.projectile.mass
            drops.append((part.reach, math.log(radius), math.log(mass / radius**3)))
        return np.asarray(np.exp(-0.5 * measure_distances(drops)))

    def follow(self, nuisances: FloatArray, block: Block, weighted: FloatArray) -> tuple[FloatArray, float]:
        """The move in two stated uncertainties of the speed."""
        assert block.nuisances is not None
        spread = np.array([zone.spread for zone in self.zones])
        best = np.clip(block.nuisances.T @ weighted, -3.0, 3.0)
        moved = self.begin() + best * spread
        return moved, 0.5 * float((np.abs(moved - nuisances) / spread).max())


def _let_contrasts_change(contrasts: Sequence[FloatArray]) -> FloatArray:
    """(n, n) covariance of what an unknown cause changes: alike in all cells of like contrast of one scan."""
    free = []
    for size in contrasts:
        apart = np.subtract.outer(size, size) / (0.3 * max(float(size.max()), 1e-12))
        free.append(np.outer(size, size) * np.exp(-0.5 * apart**2))
    return np.asarray(block_diag(*free))


def _slope_along_z(observed: ObservedScan, cells: FloatArray) -> FloatArray:
    full = np.full(observed.cells.shape, np.nan)
    full[observed.cells] = cells
    slope = np.gradient(full, observed.map.z, axis=0)
    return np.nan_to_num(slope[observed.cells])
