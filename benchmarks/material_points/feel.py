"""Record a drop with an accelerometer on the projectile: samples with noise, a zero and a scale that are off, a clock of its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from drop import GRAVITY, Result
from scipy.interpolate import LSQUnivariateSpline

REST = 20e-3  # s on the record before release
AFTER = 1.0  # stopping times on the record after the stop
OFFSET_SIGMA, SCALE_SIGMA = 0.05, 0.01  # g; relative
KNOTS = 12  # of the speed up to the stop
SPEED_SIGMA = 0.005  # relative, as stated


@dataclass(frozen=True)
class Sensing:
    """What the sensor is. noise : of a sample, over the largest reading; scale : true reading over what it should be, one for a
    campaign, for it is one sensor."""

    rate: float  # Hz
    noise: float
    scale: float


def smooth_speed(result: Result, clock: np.ndarray) -> np.ndarray:
    """Speed (m/s) at ``clock`` (s from contact): at rest, free fall, the dust, at rest again.

    A run's force is rough by 4 % of its peak over a fortieth of the stop, as points cross cells; dust is not. So a cubic spline
    is laid through the speed from contact to the stop, and another after it, for the force breaks off there.
    """
    stop, fall = result.stopping_time, float(result.speed[0] - GRAVITY * result.time[0])
    inside = (result.time > 0.0) & (result.time < stop)
    times = np.concatenate([[0.0], result.time[inside], [stop]])
    speeds = np.concatenate([[fall], result.speed[inside], [0.0]])
    weights = np.ones_like(times)
    weights[[0, -1]] = 100.0
    knots = np.linspace(0.0, stop, KNOTS + 1)[1:-1]
    into = LSQUnivariateSpline(times, speeds, knots, w=weights)
    late = result.time >= stop
    rebound = float(result.speed[late].min()) if late.any() else 0.0
    back = rebound * np.sin(np.pi * np.clip((clock - stop) / (0.2 * stop), 0.0, 1.0))
    free = np.where(clock < -fall / GRAVITY, 0.0, fall + GRAVITY * clock)
    return np.where(clock < 0.0, free, np.where(clock < stop, into(np.clip(clock, 0.0, stop)), back))


def feel(result: Result, sensing: Sensing, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """Times (s) and readings (g, upwards, 1 at rest) of the samples, and the noise of one. A sample is the mean over its interval."""
    fall = float(result.speed[0] - GRAVITY * result.time[0])
    contact = REST + fall / GRAVITY + rng.uniform(0.0, 1.0 / sensing.rate)
    edges = np.arange(0.0, contact + (1.0 + AFTER) * result.stopping_time, 1.0 / sensing.rate)
    speed = smooth_speed(result, edges - contact)
    felt = 1.0 - np.diff(speed) * sensing.rate / GRAVITY
    sigma = sensing.noise * float(felt.max())
    felt = sensing.scale * felt + OFFSET_SIGMA * rng.normal() + sigma * rng.normal(size=felt.size)
    return edges[1:] - 0.5 / sensing.rate, felt, sigma


def write_felt(
    folder: Path, result: Result, sensing: Sensing, rng: np.random.Generator, *, radius, mass, sequence, speed
) -> None:
    times, felt, sigma = feel(result, sensing, rng)
    folder.mkdir(parents=True)
    lines = [f"{t:.7f},{a:.4f}" for t, a in zip(times, felt, strict=True)]
    (folder / "acceleration.csv").write_text("time_s,a_g\n" + "\n".join(lines) + "\n")
    stated = speed * (1.0 + SPEED_SIGMA * rng.normal())
    (folder / "drop.toml").write_text(
        f"""[projectile]
tip = "hemisphere"
tip_radius_mm = {radius * 1e3:.3f}
length_mm = {9.0:.2f}
mass_mg = {mass * 1e6:.4f}
mass_sigma_mg = {mass * 5e3:.4f}

[drop]
sequence = {sequence}
impact_speed_m_s = {stated:.4f}
impact_speed_sigma_m_s = {SPEED_SIGMA * speed:.4f}

[record]
kind = "acceleration"
file = "acceleration.csv"
time_column = "time_s"
acceleration_column = "a_g"
unit = "g"
reads_at_rest = 1.0
sigma = {sigma:.4f}
offset_sigma = {OFFSET_SIGMA}
scale_sigma = {SCALE_SIGMA}
"""
    )
