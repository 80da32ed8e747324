"""One drop as the likelihood compares it: what its camera recorded, the runs behind it, its own nuisances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...effects import Instrument
from ...records import Camera, FloatArray
from ..forward import Instant, ResponseTable, predict_depth, predict_speed
from ..observe import ObservedDrop

BIN = 8  # frames of free fall averaged into one point
FREE = 1.0e-3  # s, prior width of the contact time: as good as free
SPEED_WIDTH = 0.05  # of ln speed, prior width
LEAST_SURFACE = 1e-9  # m


@dataclass(frozen=True)
class DropModel:
    """One drop with its response table. start : its nuisances by its own free fall; matrix : (points, frames) averages that."""

    observed: ObservedDrop
    table: ResponseTable
    start: Instant
    matrix: FloatArray

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

    def predict(self, code: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Stated depth (m) at the compared points, (points,), of an encoded curve."""
        offset = instrument.row_offset_px * self.observed.pixel
        return self.matrix @ predict_depth(
            code, self.observed.time, instant, instrument.pixel_factor, instrument.rate_factor, offset
        )

    def predict_speed(self, code: FloatArray, instrument: Instrument, instant: Instant) -> FloatArray:
        """Stated speed (m/s) at the compared points, (points,), of an encoded curve."""
        return self.matrix @ predict_speed(
            code, self.observed.time, instant, instrument.pixel_factor, instrument.rate_factor
        )

    def move(self, before: Instant, best: FloatArray) -> tuple[Instant, float]:
        """Nuisances after the best step (contact time, ln speed, surface row; in prior widths), and how far that was.

        The largest move in prior widths; contact time in units of a frame, speed in per cent.
        """
        after = Instant(
            before.contact_time + best[0] * FREE,
            before.log_speed + best[1] * SPEED_WIDTH,
            best[2] * self.surface_sigma,
        )
        return after, max(
            abs(best[0] * FREE) * self.camera.frame_rate,
            abs(best[1] * SPEED_WIDTH) * 100,
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
