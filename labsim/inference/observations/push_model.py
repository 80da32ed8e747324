"""One push as a gauge logs it, compared as ln of the net resistance in each window of depth.

A run pushes the tip deep into even ground; its resistance there over the ground's strength holds at every depth. How the
strength grows with depth nobody states: the profile that all records share is free, one value a window. Beside it stand, for
each record, a factor (the scatter of samples) and what the ground differs by along the depth (observe_push.measure_ground).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from ...effects import Instrument
from ...records import FloatArray
from ...runs.parts import Push
from ...sph import DropRun
from ..emulation.forward import Instant, ResponseTable
from .drop_model import REACH
from .observe_push import Ground, ObservedPush

PROFILE = 3.0  # of ln strength in each window, prior width: as good as free


def extract_push(run: DropRun | Push, whole: bool) -> FloatArray:
    """(2,): ln of the resistance, Pa on the tip's section, mean over the way by the driver's work: forces of single steps are
    noisy. A nought where a drop has its stop. whole : with what holds the shaft."""
    radius = run.setting.projectile.tip_radius
    work = run.energies["driver"] - (0.0 if whole else float(run.shaft_work[-1]))
    force = work / float(run.depth[-1] - run.depth[0])
    return np.array([np.log(force / (np.pi * radius**2)), 0.0])


@dataclass(frozen=True)
class PushModel:
    """One record with its response table. ground : how it differs from record to record along the depth; first : the window that
    is the reference of the profile."""

    observed: ObservedPush
    table: ResponseTable
    ground: Ground
    first: int
    changes_differ: ClassVar[bool] = True
    numerics: ClassVar[Mapping[str, tuple[float, float]]] = {}
    camera: None = None
    unit: str = "1"
    surface_sigma: float = 1.0

    @property
    def start(self) -> Instant:
        return Instant(0.0, float(np.log(self.observed.impact_speed)), 0.0)

    @property
    def radius(self) -> float:
        return self.observed.drop.projectile.tip_radius

    @property
    def data(self) -> FloatArray:
        """What is compared: ln of net resistance over 1 Pa."""
        return self.observed.resistance

    @cached_property
    def data_variance(self) -> FloatArray:
        return self.observed.sigma**2

    @property
    def below(self) -> np.ndarray:
        """Which of the data were taken in the ground: all."""
        return np.ones(self.data.size, dtype=bool)

    held = below  # what the other records are asked to predict

    def size(self, predicted: FloatArray) -> FloatArray:
        """What a law that is off by a share changes by that share."""
        return np.ones(predicted.size)

    @property
    def way(self) -> FloatArray:
        """Share of the way at each of the data."""
        return self.observed.depth / self.deepest

    @property
    def deepest(self) -> float:
        """m"""
        return float(self.observed.depth[-1])

    @property
    def lengths(self) -> FloatArray:
        """(n, n): errors of the data are relative ones as they are."""
        return np.eye(self.data.size)

    def predict(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """ln of the resistance over 1 Pa where the profile has its reference, (n,)."""
        # the profile makes up for what differs with depth: the resistance is as large as it was measured
        measured = np.exp(self.data)
        read = instrument.stated_resistance(measured, self.observed.depth, float(np.exp(instant.log_speed)))
        return features[0] + np.log(np.maximum(read, 0.01 * measured) / measured)

    def by_contact(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Nothing depends on when it began."""
        return np.zeros(self.data.size)

    @cached_property
    def own_errors(self) -> FloatArray:
        """(n, 2 + n): nothing in the place of a camera's surface row, the zero of the gauge at its stated error, the ground."""
        gauge, section = self.observed.drop.gauge, np.pi * self.radius**2
        assert gauge is not None
        offset = gauge.offset_sigma / gauge.per_pressure(section)
        return np.column_stack([np.zeros(self.data.size), offset / np.exp(self.data), self.ground_noise])

    def share(
        self,
        here: FloatArray,
        differ: Callable[[str], FloatArray],
        sizes: tuple[float, float, float],
    ) -> dict[str, FloatArray]:
        """Errors with one value for all records."""
        return self.common_errors

    @cached_property
    def common_errors(self) -> dict[str, FloatArray]:
        """The profile, window by window, and the scale of the gauge."""
        gauge = self.observed.drop.gauge
        assert gauge is not None
        # the reference is what is calibrated; a window is off it by a step of its own
        profile = {
            f"profile {n}": PROFILE * (self.observed.windows == n)
            for n in self.observed.windows
            if n != self.first
        }
        return {**profile, "gauge": np.full(self.data.size, gauge.scale_sigma)}

    def slope(
        self, features: FloatArray, instrument: Instrument, instant: Instant, here: FloatArray
    ) -> FloatArray:
        """What the solver may be off by from shallow to deep drops: it is pushed to one depth."""
        return np.zeros(self.data.size)

    @cached_property
    def ground_noise(self) -> FloatArray:
        """(n, n) root of the covariance of the ground's own differences, by columns."""
        apart = np.abs(np.subtract.outer(self.observed.depth, self.observed.depth))
        alike = np.exp(-apart / self.ground.length) + 1e-9 * np.eye(self.data.size)
        return np.asarray(self.ground.size * np.linalg.cholesky(alike))

    def find_solver_error(
        self, here: FloatArray, clock: FloatArray, final: float, instrument: Instrument, share: float
    ) -> tuple[FloatArray, float, float]:
        """What the solver is off by in all such pushes alike: the same at all depths."""
        return np.full(self.data.size, share), 1.0, REACH

    def mean_time(self, instrument: Instrument) -> FloatArray:
        return np.zeros(self.data.size)

    def move(self, before: Instant, best: FloatArray, widths: tuple[float, float]) -> tuple[Instant, float]:
        """The speed after the best step (in prior widths), and how far that was in per cent."""
        _, speed_width = widths
        return before._replace(log_speed=before.log_speed + best[1] * speed_width), abs(
            best[1] * speed_width
        ) * 100
