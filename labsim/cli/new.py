"""``labsim new``: an empty campaign to fill in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import LabsimError
from . import options

CAMPAIGN = """# One series of drops into one kind of sample. Units stand in the key names; KEY_sigma is a standard uncertainty.
# Every value below is an example: write your own, then run  labsim check {folder}
format = 1
name = "{name}"
description = ""

[sample]                            # the dust as prepared
filling_factor = 0.15               # volume of grains / volume
filling_factor_sigma = 0.001
monomer_density_kg_m3 = 2000.0      # of the solid grains
diameter_mm = 25.0
depth_mm = 20.0
gas_pressure_Pa = 10.0

[material]                          # the nominal model; p_m is what calibration finds
p_m_range_Pa = [300.0, 6000.0]      # limits of the prior
phi_1 = 0.12                        # Sigma = p_m ((phi - phi_1)/(phi_2 - phi))^(delta ln 10)
phi_2 = 0.58
delta = 0.58
tensile_log10_a = 2.8               # T = -10^(a + b phi) Pa
tensile_log10_b = 1.48
shear_factor = 1.0                  # Y = shear_factor sqrt(Sigma |T|)
bulk_modulus_Pa = 45000.0           # K = bulk_modulus (phi/0.15)^bulk_exponent
bulk_exponent = 4.0
shear_to_bulk = 0.5                 # mu = shear_to_bulk K
contact_friction = 0.0              # between tip and dust, 0 = free slip

# [model]                           # what the nominal simulation contains
# gravity_m_s2 = 9.81
# geometry = "axisymmetric"
"""

DROP = """# One drop; the name of this folder is its name. Copy the folder for the next one.
[projectile]
tip = "hemisphere"                  # or "sphere"; a hemisphere is the end of a rod of the same radius
tip_radius_mm = 0.5
length_mm = 4.0                     # of the whole rod
mass_mg = 1.33
mass_sigma_mg = 0.01

[drop]
sequence = 1                        # order in which the drops were made
height_mm = 20.0                    # free fall of the tip above the surface
height_sigma_mm = 0.2

[camera]
frame_rate_Hz = 10000.0
pixel_size_um = 20.0
surface_row_px = 300.0              # of the undisturbed surface; rows grow downwards
surface_row_sigma_px = 0.2

[record]
kind = "track"                      # "track", "video" (a file or a folder of images), or "summary" (published figures)
file = "track.csv"
row_sigma_px = 0.1
"""

SCAN = """# One CT scan of an embedded bead and its grey calibration. Remove the folder ct where there is none.
[projectile]
shape = "sphere"
radius_mm = 0.5
mass_mg = 1.33

[drop]
speed_m_s = 0.8                     # at contact
speed_sigma_m_s = 0.05

[scan]
slices = "slices"                   # folder of horizontal slices: TIFF, PNG or BMP, 8 or 16 bit
voxel_um = 40.0
first_slice = "top"                 # or "bottom"
bits = 8

[calibration]                       # grey = grey_air + grey_per_density * density
grey_air = 12.0
grey_per_density = 0.16             # per kg/m^3
density_solid_kg_m3 = 2000.0
"""


def new(
    folder: Annotated[Path, typer.Argument(help="Folder to make.")],
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Write an empty campaign to fill in."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LabsimError(folder, "", "is there already and not empty; name a new folder")
    files = {
        "campaign.toml": CAMPAIGN.format(folder=folder, name=folder.resolve().name),
        "drops/D01/drop.toml": DROP,
        "drops/D01/track.csv": "frame,tip_row_px\n",
        "ct/C01/scan.toml": SCAN,
    }
    try:
        for name, text in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        (folder / "ct" / "C01" / "slices").mkdir()
    except OSError as trouble:
        raise LabsimError(
            folder, "", f"cannot be written ({trouble.strerror}); name a folder you may write to"
        ) from None
    options.finish(
        {"campaign": folder, "files": list(files)},
        f"{folder}: fill in campaign.toml, drops/D01 and ct/C01 (or remove ct), then run labsim check {folder}",
        as_json=as_json,
        quiet=quiet,
    )
