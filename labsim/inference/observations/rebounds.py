"""How far the dust lifts each drop after its stop: one datum a drop, which says how stiff the dust is.

    way = mean depth at the stop - mean depth after it,  errors: the film's noise, OWN and COMMON of the simulated way, and
    CHANGE of what effects change of it

The windows count in measured stopping times, in simulations in their own: around the stop nothing moves, and after it the way is
complete. Codes differ in it by far more than in a depth, so it is no further row of the motion; its errors are measured beside a
Lagrangian mesh (docs/other-methods.md). Only drops on film that no accelerometer rides on: their runs go on for long enough.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...records import FloatArray
from ...runs.parts import Motion
from ...sph import DropRun
from ..fits.blocks import Block
from . import RunFeatures, WithoutNuisances
from .linearised_drop import ErrorBudget, Perturbation, measure_distances
from .observe import ObservedDrop

AT_STOP, AFTER = (0.95, 1.05), (1.2, 1.33)  # of the stopping time
FEWEST = 2  # frames in each
OWN, COMMON = 0.15, 0.08  # of the way: of each drop alone, and of drops that are alike
# of what effects change of it, of each drop alone: friction on the shaft takes half of the way or more; the mesh says 10 % less,
# material points up to 50 % more or less (p11)
CHANGE = 0.3


class LinearisedWay(NamedTuple):
    """One way about one point. way : m; change : m of it by effects; tangents : name -> by that global; alike : what says which
    drops are alike (measure_distances)."""

    way: float
    change: float
    tangents: Mapping[str, float]
    alike: tuple[float, float, float]


@dataclass(frozen=True)
class Rebound:
    """One drop that was lifted. way, sigma : m on the stated scale, and the film's noise; features : of its projectile's runs."""

    drop: ObservedDrop
    way: float
    sigma: float
    features: RunFeatures

    @property
    def name(self) -> str:
        return self.drop.name

    def linearise(
        self, log_p_m: float, nominal: Perturbation, perturbations: Mapping[str, Perturbation]
    ) -> LinearisedWay:
        """What a film should show about a point."""
        table, log_speed = self.features.table, math.log(self.drop.impact_speed)

        def see(features: FloatArray, point: Perturbation) -> float:
            return float(features[1] * (math.exp(features[0]) / point.instruments[self.name].pixel_factor))

        own = log_p_m + nominal.log_offsets.get(self.name, 0.0)
        response = table.at(own, log_speed)
        features = response.features(nominal.amplitudes)
        here = see(features, nominal)
        stronger = table.features(
            log_p_m + 1e-2 + nominal.log_offsets.get(self.name, 0.0), log_speed, nominal.amplitudes
        )
        tangents = {"ln_p_m": (see(stronger, nominal) - here) / 1e-2}
        for name, point in perturbations.items():
            there = log_p_m + point.log_offsets.get(self.name, 0.0)
            at = response if there == own else table.at(there, log_speed)
            tangents[name] = (see(at.features(point.amplitudes), point) - here) / point.step
        projectile = self.drop.drop.projectile
        radius = projectile.tip_radius
        alike = (
            float(features[0]) - math.log(radius),
            math.log(radius),
            math.log(projectile.mass / radius**3),
        )
        return LinearisedWay(here, here - see(response.plain, nominal), tangents, alike)


def measure_rebound(drop: ObservedDrop) -> tuple[float, float] | None:
    """The way (m) of one drop and its error by the film's noise; None where the film ends before."""
    curve, track = drop.curve, drop.track
    assert curve.used is not None and curve.clock is not None and drop.drop.camera is not None
    fraction = (curve.clock - curve.contact_time.value) / curve.stopping_time.value
    use = track.valid & np.isfinite(track.tip_row) & curve.used
    before, after = (use & (fraction >= low) & (fraction <= high) for low, high in (AT_STOP, AFTER))
    if min(before.sum(), after.sum()) < FEWEST:
        return None
    way = (track.tip_row[before].mean() - track.tip_row[after].mean()) * drop.pixel
    return float(way), drop.sigma * math.hypot(before.sum() ** -0.5, after.sum() ** -0.5)


def extract_rebound(run: DropRun | Motion) -> FloatArray:
    """(2,): ln D and the way of one run over D."""
    stop = run.stopping_time
    at_stop, after = (run.depth_at(np.linspace(*window, 27) * stop).mean() for window in (AT_STOP, AFTER))
    return np.array([math.log(run.penetration_depth), (at_stop - after) / run.penetration_depth])


@dataclass(frozen=True)
class Rebounds(WithoutNuisances):
    """All drops whose way back up is compared, an Observation. Speeds as filmed: 1 % in speed is 1 % in a way."""

    drops: tuple[Rebound, ...]
    kind: str = "rebounds"
    name: str = "rebounds"

    @property
    def features(self) -> Sequence[RunFeatures]:
        return tuple({each.features.group: each.features for each in self.drops}.values())

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> Block:
        parts = [each.linearise(log_p_m, nominal, perturbations) for each in self.drops]
        here = np.array([part.way for part in parts])
        changed = np.array([part.change for part in parts])
        apart = measure_distances([part.alike for part in parts])
        white = [each.sigma**2 for each in self.drops] + (OWN * here) ** 2 + (CHANGE * changed) ** 2
        return Block(
            np.array([each.way for each in self.drops]) - here,
            np.outer(COMMON * here, COMMON * here) * np.exp(-0.5 * apart) + np.diag(white),
            {name: np.array([part.tangents[name] for part in parts]) for name in ("ln_p_m", *perturbations)},
            sections={each.name: slice(k, k + 1) for k, each in enumerate(self.drops)},
        )
