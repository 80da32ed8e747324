"""One drop as an accelerometer on the projectile records it, compared as acceleration against time.

A sample is the mean over its interval, and the mean acceleration of a stretch of time is the change of speed in it: what a run
is expected to show follows from the speeds at the ends of each stretch, without a second derivative of a table. Stretches are
1/BINS of the stopping time, or single samples where these are longer, and the free flight is one, which shows the zero.

Errors: noise; zero of each sensor (stated, one a drop); scale of each sensor (stated, one for all drops); contact time and
speed (free); noise of the particles' force; the solver's viscosity and spacing. docs/acceleration-errors.md has the figures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from ...effects import Instrument
from ...records import STANDARD_GRAVITY, FloatArray
from ...sph.profile import is_blunt
from ...sph.tips import make_profile
from ..emulation.curves import interpolate_speed
from ..emulation.forward import Instant, ResponseTable
from .observe_acceleration import BINS, ObservedImpact

# Of the largest deceleration, of a mean over 1/BINS of the stop, where the tip goes USUAL_DEPTH tip radii deep: how far the
# simulated force is off from another code's. The fewer particles a tip passes the rougher its force: both grow as the depth to
# the power -ROUGHER. The first is without memory; the second, over SHAPE_LENGTH of the stop, is alike in drops that go alike
# deep. With the most evidence over campaigns of a Lagrangian mesh (benchmarks/acceleration/sizes.py) the first is 0.0032 and the
# second 0.0075, but then a law without a name gains from what is rough in single campaigns.
FORCE_ROUGHNESS, FORCE_SHAPE, SHAPE_LENGTH = 0.0045, 0.010, 0.125
FORCE_REACH = 0.28  # e-folds of depth over tip radius in which the second changes
USUAL_DEPTH, ROUGHER = 0.8, 1.0
SHORT = 0.05  # of a stretch, over which a slope is taken
SHOWS_CONTACT = 0.15  # of the stop, after which contact is known
KNOWN = 1.5  # stretches, at least, in which contact lies


@dataclass(frozen=True)
class AccelerationModel:
    """One record with its response table. start : its nuisances by the record alone; its zero is among the errors, not there."""

    observed: ObservedImpact
    table: ResponseTable
    start: Instant
    blunt: bool  # the tip has a face
    # of the solver's own settings, which no dust has: the amplitude that is simulated, and the standard deviation of their error
    numerics: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # with an error of what a cause changes, of any size, its own campaigns of another code have less evidence
    # (benchmarks/acceleration/sizes.py)
    changes_differ: ClassVar[bool] = False
    camera: None = None
    unit: str = "m/s^2"

    @property
    def radius(self) -> float:
        return self.observed.drop.projectile.tip_radius

    @property
    def data(self) -> FloatArray:
        """What is compared, m/s²."""
        return self.observed.felt

    @property
    def data_variance(self) -> FloatArray:
        """Of noise, and of what is rough in the simulated force, (m/s²)²."""
        observed = self.observed
        stop = float(observed.impact.time[-1])
        shares = stop / BINS / np.minimum(observed.end - observed.begin, stop)
        inside = observed.end > observed.contact_time - 0.5 * stop / BINS
        return observed.noise**2 + np.where(inside, (FORCE_ROUGHNESS * self._scale) ** 2 * shares, 0.0)

    @property
    def below(self) -> np.ndarray:
        """Which of the data were taken in the dust."""
        return self.observed.begin > self.observed.contact_time

    @property
    def held(self) -> np.ndarray:
        """What the other drops are asked to predict. Free flight does not say when contact is: the first blow does."""
        impact = self.observed.impact
        return self.observed.begin > impact.contact_time + SHOWS_CONTACT * float(impact.time[-1])

    def size(self, predicted: FloatArray) -> FloatArray:
        """What a law that is off by a share changes by that share, m/s². Not of the data: with p_m in balance a share of them
        takes as large a share of their noise away."""
        return np.where(self.below, np.maximum(predicted, 0.0), 0.0)

    @property
    def way(self) -> FloatArray:
        """Share of the way at each of the data, by the record's own integral."""
        impact = self.observed.impact
        clock = self.observed.time - impact.contact_time
        return np.interp(clock, impact.time, np.maximum(impact.depth, 0.0) / max(self.deepest, 1e-9))

    @property
    def deepest(self) -> float:
        """m"""
        return self.observed.impact.penetration_depth.value

    @property
    def lengths(self) -> FloatArray:
        """(n, n) that turns errors of the data into m: the depth that they integrate to at the end of each stretch."""
        begin, end = self.observed.begin, self.observed.end
        width, middle = end - begin, 0.5 * (begin + end)
        apart = np.tril(end[:, None] - middle[None, :])
        return np.asarray(-apart * width[None, :] * self.below[None, :])

    def predict(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Mean specific force (m/s²) over each stretch, (n,), from the features of a run."""
        begin, end = self.observed.begin, self.observed.end
        before, after = (_find_speed(features, t - instant.contact_time, instant) for t in (begin, end))
        return STANDARD_GRAVITY - (after - before) / (end - begin)

    def by_contact(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Derivative of ``predict`` by the contact time, m/s³. A blunt tip's force begins with a jump inside a stretch: a slope
        taken there alone would point a contact that is late away from the data, and is taken over a stretch to either side."""
        step = self._stretch if self.blunt else SHORT * self._stretch
        late = instant._replace(contact_time=instant.contact_time + step)
        early = instant._replace(contact_time=instant.contact_time - step)
        return (self.predict(features, instrument, late) - self.predict(features, instrument, early)) / (
            2 * step
        )

    @property
    def surface_sigma(self) -> float:
        return 1.0

    @property
    def own_errors(self) -> FloatArray:
        """(n, 1 + sensors): nothing in the place of a camera's surface row, then the zero of each sensor at its stated error."""
        accelerometer = self.observed.drop.accelerometer
        assert accelerometer is not None
        sigma = np.array([each.offset_sigma for each in accelerometer.sensors])
        return np.column_stack([np.zeros(self.data.size), self.observed.sensors * sigma])

    def share(
        self,
        here: FloatArray,
        differ: Callable[[str], FloatArray],
        sizes: tuple[float, float, float],
    ) -> dict[str, FloatArray]:
        """Errors with one value for all drops: the scale of each sensor. It acts on what the sensor puts out, as predicted
        (``here``): of the data it would take a hundredth of χ² of every error that they have for itself, always upwards."""
        accelerometer = self.observed.drop.accelerometer
        assert accelerometer is not None
        output = here - STANDARD_GRAVITY + accelerometer.reads_at_rest
        return {
            f"scale {each.column} {each.range:g}": output * self.observed.sensors[:, k] * each.scale_sigma
            for k, each in enumerate(accelerometer.sensors)
        }

    def _share_inside(self, clock: FloatArray) -> FloatArray:
        """(n,) of each stretch that lies after contact: errors that come all at once would let no fit settle."""
        return np.clip(0.5 + clock / (self.observed.end - self.observed.begin), 0.0, 1.0)

    def slope(
        self, features: FloatArray, instrument: Instrument, instant: Instant, here: FloatArray
    ) -> FloatArray:
        """What the solver may be off by a share of from shallow to deep drops, m/s²: one too deep takes as much too long."""
        longer = features.copy()
        longer[:2] += 1e-3
        return (self.predict(longer, instrument, instant) - here) / 1e-3

    @property
    def _scale(self) -> float:
        """What the errors of the force are shares of, m/s². By the record, not by the run: errors that shrink with the simulated
        force would be a reason for softer dust."""
        return self._peak * (USUAL_DEPTH * self.radius / self.deepest) ** ROUGHER

    @cached_property
    def _stretch(self) -> float:
        """s, usual."""
        return float(np.median(self.observed.end - self.observed.begin))

    @property
    def _peak(self) -> float:
        return float(np.max(np.abs(self.data)))

    def find_solver_error(
        self, here: FloatArray, clock: FloatArray, final: float, instrument: Instrument, share: float
    ) -> tuple[FloatArray, float, float]:
        """What the solver is off by in drops that go alike deep, m/s²; over which share of the stopping time, and over how many
        e-folds of depth over tip radius, that changes."""
        size = np.hypot(share * np.maximum(self.data, 0.0), FORCE_SHAPE * self._scale)
        return self._share_inside(clock) * size, SHAPE_LENGTH, FORCE_REACH

    def mean_time(self, instrument: Instrument) -> FloatArray:
        return self.observed.time

    def move(self, before: Instant, best: FloatArray, widths: tuple[float, float]) -> tuple[Instant, float]:
        """Nuisances after the best step (contact time, ln speed), and how far that was: in stretches, in per cent."""
        free, speed_width = widths
        seen = self.observed.contact_time
        # the record shows it: a far model must not run off
        reach = max(SHOWS_CONTACT * (float(self.observed.end[-1]) - seen), KNOWN * self._stretch)
        contact = float(np.clip(before.contact_time + best[0] * free, seen - reach, seen + reach))
        after = Instant(contact, before.log_speed + best[1] * speed_width, 0.0)
        return after, max(
            abs(contact - before.contact_time) / self._stretch, abs(best[1] * speed_width) * 100
        )


def _find_speed(features: FloatArray, clock: FloatArray, instant: Instant) -> FloatArray:
    """m/s, free fall before contact. In the dust the run's speed over its first: between nodes that is not quite the impact's,
    and a jump of a thousandth within one stretch is a blow."""
    impact = math.exp(instant.log_speed)
    inside = interpolate_speed(features, np.append(np.maximum(clock, 0.0), 0.0))
    return np.where(clock < 0.0, impact + STANDARD_GRAVITY * clock, impact * (inside[:-1] / inside[-1]))


def make_acceleration_model(
    observed: ObservedImpact, table: ResponseTable, numerics: Mapping[str, tuple[float, float]]
) -> AccelerationModel:
    start = Instant(observed.contact_time, math.log(observed.impact_speed), 0.0)
    return AccelerationModel(
        observed, table, start, is_blunt(make_profile(observed.drop.projectile)), numerics
    )
