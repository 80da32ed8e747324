"""The three files of a small campaign of tracks and scans, as a laboratory writes them, and other values put into them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.truths.phantom import Phantom
    from labsim.records import Scan

CAMPAIGN = """format = 1
name = "t"
description = "a test"
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
tip_radius_mm = 0.500
length_mm = 4.00
mass_mg = 1.3299
mass_sigma_mg = 0.0066
[drop]
sequence = 3
height_mm = 0.98
height_sigma_mm = 0.15
[camera]
frame_rate_Hz = 10000.0
pixel_size_um = 20.00
surface_row_px = 296.15
surface_row_sigma_px = 0.15
[record]
file = "track.csv"
kind = "track"
row_sigma_px = 0.08
"""
SCAN = """[projectile]
shape = "sphere"
radius_mm = 0.500
mass_mg = 1.3299
[drop]
speed_m_s = 0.777
speed_sigma_m_s = 0.039
[scan]
slices = "slices"
voxel_um = 40.0
first_slice = "top"
bits = 8
[calibration]
grey_air = 12.0
grey_per_density = 0.16
density_solid_kg_m3 = 2000.0
"""


def fill_in(text: str, **values: float | str) -> str:
    """The text with other values behind these keys; each key stands in it once."""
    for key, value in values.items():
        written = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
        line = f"{key} = {written}".replace("\\", "\\\\")
        text, count = re.subn(rf"^{key} = .*$", line, text, flags=re.MULTILINE)
        assert count == 1, key
    return text


def write_scan_of(phantom: Phantom, folder: Path) -> Scan:
    """A scan folder of a phantom: its slices and a scan.toml that states its bead at 0.8 m/s; the scan as it was written."""
    scan = phantom.write(folder / "slices")
    bead, grey = scan.projectile, scan.calibration
    text = fill_in(
        SCAN,
        radius_mm=bead.tip_radius * 1e3,
        mass_mg=bead.mass * 1e6,
        speed_m_s=0.8,
        speed_sigma_m_s=0.04,
        voxel_um=scan.voxel * 1e6,
        bits=scan.bits,
        grey_air=grey.grey_air,
        grey_per_density=grey.grey_per_density,
        density_solid_kg_m3=grey.density_solid,
    )
    (folder / "scan.toml").write_text(text)
    return scan
