"""Record a drop with an accelerometer on the projectile: samples with noise, and a zero and a scale that are off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.lagrangian_mesh.mesh import Result

REST = 20e-3  # s on the record before release
AFTER = 1.0  # stopping times on the record after the stop
OFFSET_SIGMA, SCALE_SIGMA = 0.05, 0.01  # g; relative
GRAVITY = 9.81  # m/s^2
SPEED_SIGMA = 0.005  # relative, as stated


@dataclass(frozen=True)
class Sensing:
    """What the sensor is. noise : of a sample, over the largest reading; scale : true reading over what it should be, one for a
    campaign, for it is one sensor."""

    rate: float  # Hz
    noise: float
    scale: float
    quiet: bool = False  # no noise is drawn and the zero is right, stated as they would be


def speed_at(result: Result, clock: np.ndarray) -> np.ndarray:
    """Speed (m/s) at ``clock`` (s from contact): at rest, free fall, the dust, at rest again."""
    fall = float(result.speed[0])
    free = np.where(clock < -fall / GRAVITY, 0.0, fall + GRAVITY * clock)
    inside = np.interp(clock, result.time, result.speed, right=0.0)
    return np.where(clock < 0.0, free, np.where(clock < result.stopping_time, inside, 0.0))


def feel(result: Result, sensing: Sensing, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """Times (s) and readings (g, upwards, 1 at rest) of the samples, means over their intervals, and the noise of one."""
    fall = float(result.speed[0])
    contact = REST + fall / GRAVITY + rng.uniform(0.0, 1.0 / sensing.rate)
    edges = np.arange(0.0, contact + (1.0 + AFTER) * result.stopping_time, 1.0 / sensing.rate)
    speed = speed_at(result, edges - contact)
    felt = 1.0 - np.diff(speed) * sensing.rate / GRAVITY
    sigma = sensing.noise * float(felt.max())
    off = OFFSET_SIGMA * rng.normal() + sigma * rng.normal(size=felt.size)
    felt = sensing.scale * felt + (0.0 if sensing.quiet else off)
    return edges[1:] - 0.5 / sensing.rate, felt, sigma


def write_felt(
    folder: Path, result: Result, sensing: Sensing, rng: np.random.Generator, *, radius, mass, sequence, speed
) -> None:
    times, felt, sigma = feel(result, sensing, rng)
    folder.mkdir(parents=True)
    lines = [f"{t:.7f},{a:.4f}" for t, a in zip(times, felt, strict=True)]
    (folder / "acceleration.csv").write_text("time_s,a_g\n" + "\n".join(lines) + "\n")
    stated = speed * (1.0 + (0.0 if sensing.quiet else SPEED_SIGMA * rng.normal()))
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
