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

    def predict(
        self, log_p_m: float, point: Perturbation, amplitudes: Mapping[str, float]
    ) -> tuple[float, float]:
        """The way (m, on the stated scale) that a film should show, and ln of the depth in m."""
        at = log_p_m + point.log_offsets.get(self.name, 0.0)
        features = self.features.table.features(at, math.log(self.drop.impact_speed), amplitudes)
        seen = math.exp(features[0]) / point.instruments[self.name].pixel_factor
        return features[1] * seen, float(features[0])


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

    def _predict(
        self, log_p_m: float, point: Perturbation, amplitudes: Mapping[str, float] | None = None
    ) -> FloatArray:
        """(drops, 2) ways (m) and ln of depths, with the amplitudes of the point or others."""
        amplitudes = point.amplitudes if amplitudes is None else amplitudes
        return np.array([each.predict(log_p_m, point, amplitudes) for each in self.drops])

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> Block:
        here, depths = self._predict(log_p_m, nominal).T
        tangents = {"ln_p_m": (self._predict(log_p_m + 1e-2, nominal)[:, 0] - here) / 1e-2}
        for name, point in perturbations.items():
            tangents[name] = (self._predict(log_p_m, point)[:, 0] - here) / point.step
        projectiles = [each.drop.drop.projectile for each in self.drops]
        alike = measure_distances(
            [
                (depth - math.log(p.tip_radius), math.log(p.tip_radius), math.log(p.mass / p.tip_radius**3))
                for depth, p in zip(depths, projectiles, strict=True)
            ]
        )
        plain = self._predict(log_p_m, nominal, {})[:, 0]
        white = [each.sigma**2 for each in self.drops] + (OWN * here) ** 2 + (CHANGE * (here - plain)) ** 2
        covariance = np.outer(COMMON * here, COMMON * here) * np.exp(-0.5 * alike) + np.diag(white)
        ways = np.array([each.way for each in self.drops])
        sections = {each.name: slice(k, k + 1) for k, each in enumerate(self.drops)}
        return Block(ways - here, covariance, tangents, sections=sections)
