"""p_m of campaigns of accelerometers whose truth is known: the solver at a finer spacing, hidden p_m, noise, zero and scale.

    python benchmarks/acceleration_hidden.py [CAMPAIGNS [SEED]]

Prints hidden p_m, its 90 % interval, and the p value; the last campaign hides a shear strength of 0.6 of the stated one.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.inference.calibrate import calibrate
from labsim.inference.runs import RunStore
from labsim.records import STANDARD_GRAVITY, Material, Projectile
from labsim.sph import DropSetting, simulate

CELLS, RATE = 10, 20e3  # of the truth; Hz
RADIUS, MASS, SPEEDS = 1.0e-3, 12.0e-6, (0.35, 0.6, 0.9)  # m, kg, m/s
SAMPLE = """format = 1
name = "hidden"
description = "accelerometers"
[sample]
filling_factor = 0.15
filling_factor_sigma = 0.001
monomer_density_kg_m3 = 2000.0
diameter_mm = 25.0
depth_mm = 20.0
gas_pressure_Pa = 10.0
[material]
p_m_range_Pa = [300.0, 6000.0]
phi_1 = 0.12
phi_2 = 0.58
delta = 0.58
tensile_log10_a = 2.8
tensile_log10_b = 1.48
shear_factor = 1.0
bulk_modulus_Pa = 45000.0
bulk_exponent = 4.0
shear_to_bulk = 0.5
contact_friction = 0.0
"""
DROP = """[projectile]
tip = "hemisphere"
tip_radius_mm = 1.0
length_mm = 6.0
mass_mg = 12.0
mass_sigma_mg = 0.03
[drop]
sequence = {number}
impact_speed_m_s = {speed:.4f}
impact_speed_sigma_m_s = {speed_sigma:.4f}
[record]
kind = "acceleration"
file = "acceleration.csv"
time_column = "time_s"
acceleration_column = "a_g"
unit = "g"
reads_at_rest = 1.0
sigma = {sigma:.4f}
offset_sigma = 0.05
scale_sigma = 0.01
"""


def write(folder: Path, p_m: float, noise: float, shear: float, rng: np.random.Generator) -> None:
    folder.mkdir()
    (folder / "campaign.toml").write_text(SAMPLE)
    scale = 1 + 0.01 * rng.standard_normal()
    for number, speed in enumerate(SPEEDS, start=1):
        true_speed = speed * (1 + 0.005 * rng.standard_normal())
        own = p_m * math.exp(0.02 * rng.standard_normal())
        material = Material(p_m=own, shear_factor=shear)
        run = simulate(
            DropSetting(Projectile("hemisphere", RADIUS, MASS), true_speed, material, spacing=RADIUS / CELLS)
        )
        contact = 0.02 + true_speed / STANDARD_GRAVITY + rng.uniform(0, 1 / RATE)
        edges = np.arange(0.0, contact + 3 * run.stopping_time, 1 / RATE)
        clock = edges - contact
        fall = np.where(clock < -true_speed / STANDARD_GRAVITY, 0.0, true_speed + STANDARD_GRAVITY * clock)
        inside = np.interp(clock, run.time, run.velocity) * (clock < run.stopping_time)
        felt = 1 - np.diff(np.where(clock < 0, fall, inside)) * RATE / STANDARD_GRAVITY
        sigma = noise * felt.max()
        felt = scale * felt + 0.05 * rng.standard_normal() + sigma * rng.standard_normal(felt.size)
        at = folder / "drops" / f"D{number:02d}"
        at.mkdir(parents=True)
        rows = zip(edges[1:] - 0.5 / RATE, felt, strict=True)
        (at / "acceleration.csv").write_text("time_s,a_g\n" + "".join(f"{t:.7f},{a:.4f}\n" for t, a in rows))
        text = DROP.format(number=number, speed=speed, speed_sigma=0.005 * speed, sigma=sigma)
        (at / "drop.toml").write_text(text)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    rng, inside = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 2), 0
    for k in range(count + 1):
        p_m, noise = math.exp(rng.uniform(math.log(900), math.log(2000))), rng.uniform(0.005, 0.02)
        shear = 0.6 if k == count else 1.0
        with tempfile.TemporaryDirectory() as place:
            write(Path(place) / "c", p_m, noise, shear, rng)
            found = calibrate(read_campaign(Path(place) / "c"), store=RunStore(), workers=1)
        low, middle, high = np.quantile(found.posterior.data.posterior["p_m_Pa"], [0.05, 0.5, 0.95])
        inside += (low < p_m < high) * (k < count)
        print(
            f"{k + 1:2d}  hidden {p_m:.0f} Pa, noise {100 * noise:.1f} %, shear {shear:g}: {middle:.0f} "
            f"({low:.0f} to {high:.0f}), "
            f"p = {found.p_value:.2g}, off {100 * (middle / p_m - 1):+.1f} %",
            flush=True,
        )
        for line in found.warnings:
            print("     ", line[:150])
    print(f"{inside} of {count} in their 90 % interval")


if __name__ == "__main__":
    main()
