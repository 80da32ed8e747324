"""An accelerometer's record as the likelihood sees it: stretches of time with the mean acceleration in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...acceleration import LOST, Acceleration, Impact, find_impact, read_acceleration
from ...errors import MeasurementError
from ...records import Drop, FloatArray, Measured

BINS = 40  # to the stop; a run's own table has as many
# of the stop, compared: at it the force breaks off, and no straight line in ln p_m follows a break that moves
COMPARED = 0.85
BEFORE_FLIGHT = 2.0  # stretches that free flight ends before contact
FEWEST = 4  # stretches in the dust


@dataclass(frozen=True)
class ObservedImpact:
    """One record in stretches. begin, end (s), felt, sigma (m/s²) : (n,); sensors : (n, sensors) share of each sensor;
    speeds : m/s, measured beside the integral."""

    drop: Drop
    begin: FloatArray
    end: FloatArray
    felt: FloatArray
    noise: FloatArray
    sensors: FloatArray
    speeds: tuple[Measured, ...]
    rejected: int
    impact: Impact
    curve: None = None

    @property
    def name(self) -> str:
        return self.drop.name

    @property
    def time(self) -> FloatArray:
        """s, of the middle of each stretch."""
        return 0.5 * (self.begin + self.end)

    @property
    def contact_time(self) -> float:
        """s, a starting value."""
        return self.impact.contact_time

    @property
    def impact_speed(self) -> float:
        """m/s, a starting value."""
        return self.impact.impact_speed.value


def observe_impact(drop: Drop) -> ObservedImpact:
    """Free flight and impact up to the stop, or to the end of a record that ends before. Raises MeasurementError."""
    assert drop.record.path is not None and drop.accelerometer is not None
    record = read_acceleration(drop.record.path, drop.accelerometer)
    impact = find_impact(record, drop)
    stop = impact.stopping_time if math.isfinite(impact.stopping_time) else float(impact.time[-1])
    width = max(stop / BINS, record.step)
    # the stop is known to a sample, and one is a mean over its interval
    last = impact.contact_time + min(COMPARED * stop, stop - 1.5 * record.step)
    start = impact.contact_time - BEFORE_FLIGHT * width
    free = record.time < start
    if math.isfinite(impact.released):
        free &= record.time > impact.released + 2 * record.step
    groups = [np.nonzero(free)[0]] if free.any() else []
    groups += _divide(record, start, last, width)
    begin = np.array([record.time[g[0]] - 0.5 * record.step for g in groups])
    end = np.array([record.time[g[-1]] + 0.5 * record.step for g in groups])
    inside = int(np.sum(begin > impact.contact_time))
    if inside < FEWEST:
        raise MeasurementError(
            drop.record.path,
            drop.accelerometer.time_column or "time",
            f"has {inside} stretches of {width * 1e3:.3g} ms in the dust, too few to compare; sample faster or widen range",
        )
    shares = np.array(
        [[np.mean(record.sensor[g] == k) for k in range(len(drop.accelerometer.sensors))] for g in groups]
    )
    speeds = tuple(speed for speed in (drop.impact_speed, impact.flight_speed) if speed is not None)
    return ObservedImpact(
        drop,
        begin,
        end,
        np.array([np.mean(record.felt[g]) for g in groups]),
        np.array([math.sqrt(np.sum(record.sigma[g] ** 2)) / g.size for g in groups]),
        shares,
        speeds,
        record.saturated + record.lost,
        impact,
    )


def _divide(record: Acceleration, start: float, last: float, width: float) -> list[np.ndarray]:
    """Samples of each stretch of about ``width`` between two times; none reaches over a gap."""
    chosen = np.nonzero((record.time >= start) & (record.time <= last))[0]
    if not chosen.size:
        return []
    number = np.floor((record.time[chosen] - start) / width).astype(int)
    breaks = (np.diff(number) > 0) | (np.diff(record.time[chosen]) > LOST * record.step)
    return np.split(chosen, np.nonzero(breaks)[0] + 1)
