"""Records of an accelerometer of drops that obey the law of laws.py: z'' = -turn² z, so that turn² z + g is felt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from campaign_files import CAMPAIGN, fill_in
from laws import DROPS, move

G = 9.81
HELD, RESTS = 0.02, 2.0  # s before the release; stopping times after the stop
DROP = """[projectile]
tip = "hemisphere"
tip_radius_mm = {radius}
length_mm = 6.0
mass_mg = {mass}
mass_sigma_mg = {mass_sigma}
[drop]
sequence = {number}
impact_speed_m_s = {speed}
impact_speed_sigma_m_s = {speed_sigma}
[record]
kind = "acceleration"
file = "acceleration.csv"
time_column = "time_s"
acceleration_column = "a_g"
unit = "g"
reads_at_rest = 1.0
sigma = {sigma}
offset_sigma = 0.05
scale_sigma = 0.01
"""


def make_pulse(
    radius: float, mass: float, speed: float, p_m: float = 1300.0, rate: float = 20e3, at_rest: float = 1.0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Time (s), reading (g), and when contact is (s). radius : mm; mass : mg."""
    depth, stop = move(radius * 1e-3, mass * 1e-6, speed, p_m)
    turn, flight = speed / depth, speed / G
    contact = HELD + flight
    edges = np.arange(0, int((contact + (1 + RESTS) * stop) * rate) + 1) / rate
    clock = edges - contact

    def go(t: np.ndarray) -> np.ndarray:
        """Speed without gravity's share before the release and after the stop: its change is what is felt less gravity."""
        before = np.where(t < -flight, 0.0, speed + G * t)
        return np.where(t < 0, before, speed * np.cos(turn * np.minimum(t, stop)))

    felt = 1.0 - np.diff(go(clock)) / np.diff(edges) / G
    return 0.5 * (edges[1:] + edges[:-1]), felt - 1.0 + at_rest, contact


def write_record(folder: Path, time: np.ndarray, *columns: np.ndarray, names: str = "a_g") -> None:
    rows = ["time_s," + names]
    rows += [
        ",".join([f"{t:.7f}", *(f"{a:.5f}" for a in row)]) for t, *row in zip(time, *columns, strict=True)
    ]
    (folder / "acceleration.csv").write_text("\n".join(rows) + "\n")


def write_campaign(
    folder: Path,
    *,
    p_m: float = 1300.0,
    noise: float = 0.01,
    scale: float = 1.0,
    seed: int = 3,
    rate: float = 20e3,
    drops: list[tuple[float, float, float]] = DROPS,
) -> Path:
    """noise : of a sample, of the largest reading; scale : of the sensor, over what is stated."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    (folder / "campaign.toml").write_text(fill_in(CAMPAIGN, name="felt"))
    for number, (radius, mass, speed) in enumerate(drops, start=1):
        at = folder / "drops" / f"D{number:02d}"
        at.mkdir(parents=True)
        time, felt, _ = make_pulse(radius, mass, speed, p_m, rate)
        sigma = noise * felt.max()
        seen = scale * felt + 0.05 * rng.standard_normal() + sigma * rng.standard_normal(felt.size)
        write_record(at, time, seen)
        (at / "drop.toml").write_text(
            DROP.format(
                radius=radius, mass=mass, mass_sigma=0.003 * mass, number=number, sigma=round(sigma, 5),
                speed=speed, speed_sigma=round(0.005 * speed, 5),
            )
        )  # fmt: skip
    return folder
