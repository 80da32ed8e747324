"""What the friction sleeve behind a pushed tip feels, as a share of the tip's own resistance: the friction ratio R_f = f_s / q.

Coulomb's friction on a shaft under the normal stress σ_n is f_s = μ σ_n (at most what the matter bears in shear). A run's shaft
grows with the way L; with an even f_s on what the tip has passed its work is W_s = π R f_s L², that of the tip W = π R² q L, so

    R_f = f_s / q = (R / L) W_s / W

q is net, without the weight of the ground (Robertson 1990). A ratio knows no strength, so it says what contact friction is, which
the tip's resistance alone does not. The ratio of one record is the same in all windows but for what the records show.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...effects import Instrument
from ...records import FloatArray
from ...runs.parts import Push
from ...sph import DropRun
from ..fits.blocks import Block, add_errors, lay_out
from . import RunFeatures, WithoutNuisances
from .linearised_drop import ErrorBudget, Perturbation
from .observe_push import ObservedPush

SOLVER = 0.20  # of the simulated ratio: spacing, a shaft shorter than a sleeve (benchmarks/solver/sleeve.py)
USUAL = 0.10  # of the ratio, along the depth and from record to record: where too few records say it
FEWEST = 4  # records, and windows that they share, which say it
LEAST = 1e-4  # ratio that errors are shares of where a gauge's zero hides all of it


@dataclass(frozen=True)
class Spread:
    """How ratios differ, relative to their middle, ``level``. records : from record to record; profile : with depth, in all
    records alike; rest : from window to window."""

    level: float
    records: float
    profile: float
    rest: float


def extract_sleeve(run: DropRun | Push) -> FloatArray:
    """(1,): the friction ratio of a run's own shaft."""
    radius, shaft = run.setting.projectile.tip_radius, float(run.shaft_work[-1])
    way = float(run.depth[-1] - run.depth[0])
    return np.array([radius / way * shaft / (run.energies["driver"] - shaft)])


def measure_spread(pushes: Sequence[ObservedPush]) -> Spread:
    """How ratios differ, from the windows that all records have: means of rows and columns, and what they leave."""
    numbers = [set(map(int, push.windows[np.isfinite(push.friction_ratio)])) for push in pushes]
    common = sorted(set.intersection(*numbers))
    middle = float(np.nanmedian(np.concatenate([push.friction_ratio for push in pushes])))
    level = max(abs(middle), LEAST)
    if len(pushes) < FEWEST or len(common) < FEWEST:
        return Spread(level, USUAL, USUAL, USUAL)
    ratio = np.array([[push.friction_ratio[list(push.windows).index(n)] for n in common] for push in pushes])
    ratio /= level  # no logarithm: a gauge's zero can take a ratio below nought
    left = ratio - ratio.mean(axis=1, keepdims=True) - ratio.mean(axis=0) + ratio.mean()
    own = left.size / ((len(pushes) - 1) * (len(common) - 1))
    return Spread(
        level,
        float(np.std(ratio.mean(axis=1), ddof=1)),
        float(np.std(ratio.mean(axis=0), ddof=1)),
        float(math.sqrt(np.mean(left**2) * own)),
    )


@dataclass(frozen=True)
class SleevePart:
    """One record about one point. residual, white (variance) : (n,); tangents : name -> (n,); shared : name -> (n,), errors with
    one value for several records, per standard uncertainty; local : (n, k) those of this record alone."""

    residual: FloatArray
    white: FloatArray
    tangents: Mapping[str, FloatArray]
    shared: Mapping[str, FloatArray]
    local: FloatArray


@dataclass(frozen=True)
class TipSleeves:
    """The sleeves of all records of one tip. features : the table of its runs; spread : how their ratios differ."""

    pushes: tuple[ObservedPush, ...]
    features: RunFeatures
    spread: Spread

    def predict(
        self, push: ObservedPush, log_p_m: float, point: Perturbation, amplitudes: Mapping[str, float]
    ) -> FloatArray:
        """The ratio that the gauges of one record should read, (windows,)."""
        at = log_p_m + point.log_offsets.get(push.name, 0.0)
        features = self.features.table.features(at, math.log(push.impact_speed), amplitudes)
        measured = np.exp(push.resistance)
        read = self._instrument(point, push).stated_resistance(measured, push.depth, push.impact_speed)
        return features[0] * measured / np.maximum(read, 0.01 * measured)

    def _instrument(self, point: Perturbation, push: ObservedPush) -> Instrument:
        return point.instruments[push.name]

    def linearise(
        self,
        push: ObservedPush,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> SleevePart:
        """Residual, errors and tangents of one record, in the windows that have a sleeve."""
        gauge, radius = push.drop.gauge, push.drop.projectile.tip_radius
        assert gauge is not None
        seen = np.isfinite(push.friction_ratio)
        ratio, net = push.friction_ratio[seen], np.exp(push.resistance[seen])
        here = self.predict(push, log_p_m, nominal, nominal.amplitudes)[seen]

        def move(log_step: float, point: Perturbation) -> FloatArray:
            return self.predict(push, log_p_m + log_step, point, point.amplitudes)[seen] - here

        tangents = {"ln_p_m": move(1e-2, nominal) / 1e-2}
        for name, point in perturbations.items():
            tangents[name] = move(0.0, point) / point.step
        # the same size in all of them: where errors go with single data, low ones would count for more
        size = np.full(ratio.size, self.spread.level)
        offset = gauge.offset_sigma / gauge.per_pressure(math.pi * radius**2)
        spread = self.spread
        shared = {
            # a smooth shaft has no friction in any simulation, so its error is a share of what is simulated
            "solver": SOLVER * here,
            "sleeve gauge": gauge.sleeve.scale_sigma * size,
            "gauge": -gauge.scale_sigma * size,
        }
        for number, at in zip(push.windows[seen], np.eye(int(seen.sum())), strict=True):
            shared[f"profile {number} of {radius:g}"] = spread.profile * size * at
        local = (
            gauge.sleeve.offset_sigma / net,
            -offset * size / net,
            spread.records * size,
            tangents["ln_p_m"] * budget.scatter,
        )
        white = push.friction_sigma[seen] ** 2 + (spread.rest * size) ** 2
        return SleevePart(ratio - here, white, tangents, shared, np.stack(local, axis=1))


@dataclass(frozen=True)
class SleeveFriction(WithoutNuisances):
    """All sleeves that are compared, an Observation without nuisances: a ratio hardly depends on the speed of a push.

    Scale and zero of the tip's gauge, which it shares with the resistance, count as errors of its own: they are small beside
    SOLVER.
    """

    sleeves: tuple[TipSleeves, ...]
    kind: str = "sleeves"
    name: str = "sleeves"

    @property
    def features(self) -> tuple[RunFeatures, ...]:
        return tuple(sleeve.features for sleeve in self.sleeves)

    @cached_property
    def _rows(self) -> tuple[tuple[TipSleeves, ObservedPush], ...]:
        return tuple((sleeve, push) for sleeve in self.sleeves for push in sleeve.pushes)

    @property
    def data(self) -> FloatArray:
        """All measured ratios, in the order of the block's residual."""
        found = [push.friction_ratio for _, push in self._rows]
        return np.concatenate([ratio[np.isfinite(ratio)] for ratio in found])

    def linearise(
        self,
        nuisances: FloatArray,
        log_p_m: float,
        nominal: Perturbation,
        budget: ErrorBudget,
        perturbations: Mapping[str, Perturbation],
    ) -> Block:
        parts = [
            sleeve.linearise(push, log_p_m, nominal, budget, perturbations) for sleeve, push in self._rows
        ]
        covariance = np.zeros((self.data.size, self.data.size))
        add_errors(covariance, parts, lay_out(part.residual.size for part in parts))
        return Block(
            np.concatenate([part.residual for part in parts]),
            covariance,
            {
                name: np.concatenate([part.tangents[name] for part in parts])
                for name in ("ln_p_m", *perturbations)
            },
        )
