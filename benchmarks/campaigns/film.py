"""Film a drop: rows of the tip in frames, with noise, missing frames, outliers and a surface row that was read off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

GRAVITY = 9.81  # m/s^2
ROW_SIGMA = 0.08  # px
SURFACE_SIGMA = 0.15  # px
HEIGHT_SIGMA = 0.15e-3  # m
MISSING = 0.0095  # share of the frames
OUTLIERS = 0.0017
READINGS = 30  # times that an instant is put right; each leaves speed x line_time / pixel_size of the last error, up to 0.5


@dataclass(frozen=True)
class Filming:
    """What the camera is, and what is wrong with it."""

    frame_rate: float  # Hz, as stated
    pixel_size: float  # m, as stated
    after: float  # s of film after contact
    pixel_factor: float = 1.0  # true over stated
    frame_factor: float = 1.0
    surface_error: float = 0.0  # px added to the stated row
    wobble: tuple[float, float] = (0.0, 1.0)  # px, Hz
    line_time: float = 0.0  # s from one row to the next below it, where rows are read one after another
    clock_drift: float = 0.0  # by which share the time between frames grows from contact to the end
    noise_slope: float = 0.0  # by which share the noise grows from the first frame to the last


class Result(Protocol):
    """A drop of either solver: its curve, (k,) in SI."""

    time: np.ndarray
    depth: np.ndarray
    speed: np.ndarray
    stopping_time: float
    stopping_depth: float


def depth_at(result: Result, time: np.ndarray) -> np.ndarray:
    """Depth of the tip (m): free fall to where the run begins, its curve, free flight after its end.

    A run begins some cells above the surface, where its grid first feels the dust, and is not without force at contact: free
    fall up to there instead would put a step of up to 12 µm into the track.
    """
    early = time - result.time[0]
    before = result.depth[0] + result.speed[0] * early + 0.5 * GRAVITY * early**2
    inside = np.interp(time, result.time, result.depth)
    late = time - result.time[-1]
    flight = result.depth[-1] + result.speed[-1] * late + 0.5 * GRAVITY * late**2
    flight = np.minimum(flight, result.stopping_depth)  # it comes back to where it lay
    return np.where(early < 0.0, before, np.where(late > 0.0, flight, inside))


def film(result: Result, speed: float, filming: Filming, rng: np.random.Generator):
    """Frames and rows of the track, and the row of the surface as stated."""
    rate = filming.frame_rate * filming.frame_factor
    before = min(120.0 / filming.frame_rate, 0.97 * speed / GRAVITY)
    first = int(before * rate)
    contact = first + rng.uniform(0.0, 1.0)
    frames = np.arange(first + int(filming.after * rate) + 1)
    time = (frames - contact) / rate
    surface = 300.0 + rng.uniform(-4.5, 3.5)
    time = time * (1.0 + 0.5 * filming.clock_drift * time / filming.after)
    pixel = filming.pixel_size * filming.pixel_factor
    below = depth_at(result, time) / pixel
    if filming.line_time:
        for _ in range(READINGS):  # the tip is where it is when its own row is read
            below = depth_at(result, time + filming.line_time * below) / pixel
    rows = surface + below
    amplitude, frequency = filming.wobble
    rows = rows + amplitude * np.sin(2.0 * np.pi * (frequency * time + rng.uniform()))
    rows = rows + rng.normal(0.0, ROW_SIGMA, rows.size) * (
        1.0 + filming.noise_slope * (frames / frames[-1] - 0.5)
    )
    stray = rng.uniform(size=rows.size) < OUTLIERS
    rows = rows + stray * rng.uniform(4.0, 9.0, rows.size) * rng.choice([-1.0, 1.0], rows.size)
    kept = rng.uniform(size=rows.size) >= MISSING
    kept[0] = True
    return frames[kept], rows[kept], surface + rng.normal(0.0, SURFACE_SIGMA) + filming.surface_error


def read_faults(measure: dict) -> dict:
    """What a plan hides in the camera, as fields of ``Filming``."""
    return {
        "pixel_factor": measure.get("pixel", 1.0),
        "frame_factor": measure.get("frame", 1.0),
        "surface_error": measure.get("surface_row", 0.0),
        "wobble": tuple(measure.get("wobble", (0.0, 1.0))),
        "line_time": measure.get("line_time", 0.0),
        "clock_drift": measure.get("clock_drift", 0.0),
    }


def film_drop(
    folder: Path,
    result: Result,
    speed: float,
    filming: Filming,
    rng: np.random.Generator,
    *,
    radius: float,
    mass: float,
    sequence: int,
    length: float,
    same_as: str = "",
) -> None:
    """A drop's folder with its film and the height that it is said to have fallen. radius, length : m; mass : kg, as stated;
    same_as : the drop of which this film is another record."""
    frames, rows, surface = film(result, speed, filming, rng)
    height = max(speed**2 / (2.0 * GRAVITY) + HEIGHT_SIGMA * rng.normal(), 1e-5)
    folder.mkdir(parents=True)
    lines = [f"{frame},{row:.3f}" for frame, row in zip(frames, rows, strict=True)]
    (folder / "track.csv").write_text("frame,tip_row_px\n" + "\n".join(lines) + "\n")
    (folder / "drop.toml").write_text(
        f"""[projectile]
tip = "hemisphere"
tip_radius_mm = {radius * 1e3:.3f}
length_mm = {length * 1e3:.2f}
mass_mg = {mass * 1e6:.4f}
mass_sigma_mg = {mass * 5e3:.4f}

[drop]
{f'same_as = "{same_as}"' if same_as else f"sequence = {sequence}"}
height_mm = {height * 1e3:.2f}
height_sigma_mm = {HEIGHT_SIGMA * 1e3:.2f}

[camera]
frame_rate_Hz = {filming.frame_rate:.1f}
pixel_size_um = {filming.pixel_size * 1e6:.2f}
surface_row_px = {surface:.2f}
surface_row_sigma_px = {SURFACE_SIGMA:.2f}

[record]
file = "track.csv"
kind = "track"
row_sigma_px = {ROW_SIGMA:.2f}
"""
    )
