"""Drops into another law than the dust's: what its file calls calibrated takes the place of p_m."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.inference.calibrate import calibrate
from labsim.records import Material, Projectile
from labsim.report.campaign_tables import campaign_calibration_lines, campaign_calibration_summary
from labsim.runs.store import RunStore
from labsim.sph import DropSetting, simulate

COHESION = 2000.0  # Pa, hidden
PIXEL, RATE, ROW, NOISE = 2e-5, 2e4, 400.0, 0.08
CAMPAIGN = """format = 1
name = "wet clay"
[sample]
filling_factor = 0.5
filling_factor_sigma = 0.005
monomer_density_kg_m3 = 3000.0
diameter_mm = 60.0
depth_mm = 50.0
gas_pressure_Pa = 0.0
scatter = 0.01
[material]
law = "von_mises"
cohesion_range_Pa = [500.0, 8000.0]
shear_modulus_Pa = 2.0e5
bulk_modulus_Pa = 2.0e6
"""
DROP = """[drop]
sequence = {number}
height_mm = {height}
height_sigma_mm = 0.2
[projectile]
tip = "sphere"
tip_radius_mm = 2.0
mass_mg = 260.0
mass_sigma_mg = 0.5
[camera]
frame_rate_Hz = 20000.0
pixel_size_um = 20.0
surface_row_px = 400.0
surface_row_sigma_px = 0.2
[record]
kind = "track"
file = "track.csv"
row_sigma_px = 0.08
"""


def test_the_cohesion_that_is_hidden_is_found(tmp_path: Path) -> None:
    """Beads dropped into clay by labsim's solver at a finer spacing, filmed with noise."""
    folder, rng = tmp_path / "clay", np.random.default_rng(2)
    folder.mkdir()
    (folder / "campaign.toml").write_text(CAMPAIGN)
    law = (("cohesion", COHESION), ("shear_modulus", 2e5), ("bulk_modulus", 2e6))
    for number, height in enumerate((0.01, 0.04), start=1):
        speed = math.sqrt(2 * 9.81 * height)
        run = simulate(
            DropSetting(
                projectile=Projectile("sphere", 2e-3, 2.6e-4),
                impact_speed=speed,
                material=Material(law="von_mises", constants=law),
                filling_factor=0.5,
                monomer_density=3000.0,
                spacing=2e-3 / 7,
                after_stop=0.5,
            )
        )
        time = np.arange(-60, int(1.5 * run.stopping_time * RATE) + 40) / RATE
        fallen = np.where(
            time < 0, speed * time + 0.5 * 9.81 * time**2, run.depth_at(np.minimum(time, run.time[-1]))
        )
        rows = ROW + fallen / PIXEL + NOISE * rng.standard_normal(time.size)
        drop = folder / "drops" / f"D{number:02d}"
        drop.mkdir(parents=True)
        lines = [f"{frame},{row:.3f}" for frame, row in enumerate(rows)]
        (drop / "track.csv").write_text("frame,tip_row_px\n" + "\n".join(lines))
        (drop / "drop.toml").write_text(DROP.format(number=number, height=1e3 * height))
    found = calibrate(read_campaign(folder), store=RunStore(tmp_path / "store"), workers=1)
    values = found.posterior.calibrated
    assert found.posterior.names == ("cohesion_Pa",)
    assert abs(math.log(values.mean() / COHESION)) < 2.5 * values.std() / values.mean() < 0.2
    summary = campaign_calibration_summary(found)
    assert (
        summary["calibrated"]["name"] == "cohesion" and "p_m_Pa" not in summary and "cohesion_Pa" in summary
    )
    assert "wet clay: cohesion = " in campaign_calibration_lines(found)
