"""One drop as the likelihood compares it: what its camera recorded, the runs behind it, its own nuisances."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...effects import Instrument
from ...records import Camera, FloatArray
from ..emulation.forward import Instant, ResponseTable, predict_depth, predict_speed
from .observe import FilmedDrop, ObservedDrop

BIN = 8  # frames of free fall averaged into one point
ALONG = 0.4  # of the stopping time, over which the solver's error of the depth changes
REACH = 0.8  # e-folds of the final depth over the tip radius, over which it does
FREE = 1.0e-3  # s, prior width of the contact time: as good as free
SPEED_WIDTH = 0.05  # of ln speed, prior width
LEAST_SURFACE = 1e-9  # m
WIDTHS = (FREE, SPEED_WIDTH)


@dataclass(frozen=True)
class DropModel:
    """One drop with its response table. start : its nuisances by its own free fall; matrix : (points, frames) averages that."""

    observed: FilmedDrop
    table: ResponseTable
    start: Instant
    matrix: FloatArray
    changes_differ: ClassVar[bool] = True
    numerics: ClassVar[Mapping[str, tuple[float, float]]] = {}

    @property
    def radius(self) -> float:
        return self.observed.drop.projectile.tip_radius

    @property
    def camera(self) -> Camera:
        camera = self.observed.drop.camera
        assert camera is not None
        return camera

    @property
    def surface_sigma(self) -> float:
        """m, on the stated scale."""
        return max(self.camera.surface_row_sigma * self.observed.pixel, LEAST_SURFACE)

    def predict(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Stated depth (m) at the compared points, (points,), from the features of a run."""
        offset = instrument.row_offset_px * self.observed.pixel
        return self.matrix @ predict_depth(features, self.observed.time, instant, instrument, offset)

    def predict_speed(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Stated speed (m/s) at the compared points, (points,), from the features of a run."""
        return self.matrix @ predict_speed(features, self.observed.time, instant, instrument)

    @property
    def data(self) -> FloatArray:
        """What is compared, m."""
        return self.matrix @ self.observed.depth

    @property
    def data_variance(self) -> FloatArray:
        flying = self.observed.time < self.start.contact_time
        variance = np.where(flying, self.observed.flight_sigma**2, self.observed.sigma**2)
        return np.asarray(self.matrix**2 @ variance)

    @property
    def below(self) -> np.ndarray:
        """Which of the data were taken in the dust."""
        return self.data > 3 * self.observed.sigma

    @property
    def held(self) -> np.ndarray:
        """What the other drops are asked to predict; free fall above says when contact is, and how fast."""
        return self.below

    def size(self, predicted: FloatArray) -> FloatArray:
        """What a law that is off by a share changes by that share, m."""
        return np.maximum(predicted, 0.0)

    @property
    def way(self) -> FloatArray:
        """Share of the way at each of the data."""
        depth = np.maximum(self.data, 0.0)
        return depth / depth.max()

    @property
    def deepest(self) -> float:
        """m"""
        return float(np.max(self.observed.depth))

    @property
    def lengths(self) -> FloatArray:
        """(n, n) that turns errors of the data into m."""
        return np.eye(self.matrix.shape[0])

    def by_contact(self, features: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Derivative of ``predict`` by the contact time, m/s."""
        return -self.predict_speed(features, instrument, instant)

    @property
    def own_errors(self) -> FloatArray:
        """(n, 1): the surface row at its stated error."""
        return np.full((self.matrix.shape[0], 1), self.surface_sigma)

    def share(
        self,
        here: FloatArray,
        differ: Callable[[str], FloatArray],
        sizes: tuple[float, float, float],
    ) -> dict[str, FloatArray]:
        """Errors with one value for several drops; sizes : of pixel size, frame rate and the offset of the contact."""
        camera = f"{self.observed.pixel:.6g} {self.camera.frame_rate:.6g}"
        pixel, rate, contact = sizes
        return {
            f"pixel {camera}": differ("pixel_factor") * pixel,
            f"frame {camera}": differ("rate_factor") * rate,
            "contact offset": np.full(self.data.size, contact * self.radius),
        }

    unit = "m"

    def slope(
        self, features: FloatArray, instrument: Instrument, instant: Instant, here: FloatArray
    ) -> FloatArray:
        """What the solver may be off by a share of from shallow to deep drops, m."""
        return np.maximum(here, 0.0)

    def find_solver_error(
        self, here: FloatArray, clock: FloatArray, final: float, instrument: Instrument, share: float
    ) -> tuple[FloatArray, float, float]:
        """What the solver is off by in drops that go alike deep, m; over which share of the stopping time, and over how many
        e-folds of depth over tip radius, that changes."""
        return share * np.clip(here * instrument.pixel_factor, 0.0, final) * (clock > 0), ALONG, REACH

    def mean_time(self, instrument: Instrument) -> FloatArray:
        """True times (s) of the data."""
        return self.matrix @ (instrument.true_time(self.observed.time))

    def move(self, before: Instant, best: FloatArray, widths: tuple[float, float]) -> tuple[Instant, float]:
        """Nuisances after the best step (contact time, ln speed, surface row; in prior widths), and how far that was.

        The largest move in prior widths; contact time in units of a frame, speed in per cent.
        """
        free, speed_width = widths
        after = Instant(
            before.contact_time + best[0] * free,
            before.log_speed + best[1] * speed_width,
            best[2] * self.surface_sigma,
        )
        return after, max(
            abs(best[0] * free) * self.camera.frame_rate,
            abs(best[1] * speed_width) * 100,
            abs(after.surface - before.surface) / self.surface_sigma,
        )


def make_drop_model(observed: ObservedDrop, table: ResponseTable) -> DropModel:
    """Average the free fall in bins; start the nuisances from the track's own free-fall fit."""
    before = int(np.sum(observed.time < observed.contact_time - 2e-4))
    groups = [np.arange(k, min(k + BIN, before)) for k in range(0, before, BIN)]
    groups += [np.array([k]) for k in range(before, observed.time.size)]
    matrix = np.zeros((len(groups), observed.time.size))
    for row, members in enumerate(groups):
        matrix[row, members] = 1.0 / len(members)
    start = Instant(observed.contact_time, math.log(observed.impact_speed), 0.0)
    return DropModel(observed, table, start, matrix)
