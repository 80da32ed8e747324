"""``labsim new``: an empty campaign to fill in, every key explained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import LabsimError
from . import options

CAMPAIGN = """# One series of drops into one kind of sample.
#
# Units stand in the key names: _mm, _um, _mg, _Pa, _Hz, _px, _kg_m3; a key without one is a plain number.
# KEY_sigma is the standard uncertainty of KEY, in the same unit. Leave out what is marked optional; every other key is needed.
# The values are examples: write your own, then run   labsim check {folder}
format = 1                          # of this folder; leave as it is
name = "{name}"                     # stands on every result
description = ""                    # one line, for the report

[sample]                            # the dust as prepared
filling_factor = 0.15               # volume of the grains / volume of the sample
filling_factor_sigma = 0.001        # from weighing several samples
monomer_density_kg_m3 = 2000.0      # of the solid grains, not of the dust
diameter_mm = 25.0                  # of the container
depth_mm = 20.0                     # of the dust in it
gas_pressure_Pa = 10.0              # in the chamber during the drop
# scatter = 0.05                    # optional: of the strength from sample to sample, relative; else estimated

[material]                          # the nominal model of the dust; its p_m is what labsim calibrate finds
p_m_range_Pa = [300.0, 6000.0]      # between what p_m is searched: the limits of the prior
phi_1 = 0.12                        # compressive strength: Sigma = p_m ((phi - phi_1)/(phi_2 - phi))^(delta ln 10);
phi_2 = 0.58                        #   phi_1 where it vanishes, phi_2 where it diverges (no denser dust),
delta = 0.58                        #   delta the width of the transition, in decades of pressure
tensile_log10_a = 2.8               # tensile strength: T = -10^(a + b phi) Pa
tensile_log10_b = 1.48              # b; both without unit
shear_factor = 1.0                  # shear strength: Y = shear_factor sqrt(Sigma |T|)
bulk_modulus_Pa = 45000.0           # K = bulk_modulus (phi/0.15)^bulk_exponent
bulk_exponent = 4.0                 # how fast K grows with the filling factor
shear_to_bulk = 0.5                 # shear modulus: mu = shear_to_bulk K
contact_friction = 0.0              # Coulomb coefficient between tip and dust; 0 = free slip

# [model]                           # optional: what the nominal simulation contains
# gravity_m_s2 = 9.81               # 0 switches it off
# geometry = "axisymmetric"         # or "planar": a cylinder in the plane instead of a round tip

# [source]                          # optional: where the figures come from, one text a key; "assumed" is counted by labsim check
# published = "thesis, table 4"      # what was read where
# assumed = "length of the rods"     # what nobody measured
"""

DROP = """# One drop; the name of this folder is its name. Copy the folder for the next one and count sequence up.
[projectile]                        # rigid
tip = "hemisphere"                  # the end of a rod of the same radius; or "sphere": a bead
tip_radius_mm = 0.5                 # half the diameter of tip and rod
# tip_radius_sigma_mm = 0.005       # optional: of the calliper
length_mm = 4.0                     # of the whole rod; of a bead its diameter
mass_mg = 1.33                      # of the projectile
mass_sigma_mg = 0.01                # of the balance

[drop]
sequence = 1                        # place in the order in which the drops were made; a drift of the sample shows by it
height_mm = 20.0                    # of free fall: tip above the undisturbed surface at release
height_sigma_mm = 0.2               # how well that height is known

[camera]
frame_rate_Hz = 10000.0             # frames a second, of the record, not of its replay
pixel_size_um = 20.0                # in the plane of the projectile
surface_row_px = 300.0              # row of the undisturbed surface, 0 is the top of the image; rows grow downwards
surface_row_sigma_px = 0.2          # how well that row is known

[record]
kind = "track"                      # "track": a table; "video": a file or a folder of images; "summary": published figures
file = "track.csv"                  # beside this file; a track has the columns frame,tip_row_px, one row a frame
row_sigma_px = 0.1                  # optional: standard error of a row
# frames_left_out = [118, 119]        # optional: numbers of frames whose rows are not used
# region_px = [20, 0, 110, 380]       # optional, of a video: left, top, right, bottom of where the projectile is looked for

# [record]                          # instead: an accelerometer on the projectile; then without [camera]
# kind = "acceleration"
# file = "acceleration.csv"           # beside this file; a heading, then one row a sample; or an .ide file
# time_column = "time_s"              # in seconds; not of an .ide file, which has a clock
# acceleration_column = "a_g"         # upwards positive; ["low_g", "high_g"] for several sensors; of an .ide file "-Z (40g)"
# unit = "g"                          # or "m/s^2", of the column and of the four keys below
# reads_at_rest = 1.0                 # 1.0: a sensor at rest reads 1 g upwards; 0.0: nothing
# sigma = 0.05                        # noise of a sample; like the next three a list where there are several sensors
# offset_sigma = 0.05                 # how well the zero is known; 5.0 where it is not: then the flight shows it
# scale_sigma = 0.01                  # how well the scale is known, relative
# range = 50.0                        # optional: largest reading
# window_s = [12.30, 12.80]           # optional: the seconds that are this drop's, where one file holds several
# [drop] then also takes impact_speed_m_s and impact_speed_sigma_m_s, and height_mm is optional

# [record]                          # instead: a tip pushed into the ground with a gauge; then without [camera] and height_mm
# kind = "force"
# file = "push.csv"                   # beside this file; a heading, then one row a depth; a .cpt sounding needs no column keys
# depth_column = "depth_mm"           # of the tip below the surface
# force_column = "force_N"            # against the motion positive; or pressure_column, on the tip's section
# depth_unit = "mm"                   # or "cm", "m"
# force_unit = "N"                    # or "mN", "kN"; of a pressure "Pa", "kPa", "MPa"
# sigma = 0.05                        # noise of a row, in force_unit
# offset_sigma = 0.1                  # optional: how well the zero is known
# scale_sigma = 0.01                  # optional: how well the scale is known, relative
# window_mm = [60.0, 300.0]           # optional: the depths that are compared
# [motion]                            # what a push needs beside it
# kind = "pushed"
# speed_m_s = 0.02
# speed_sigma_m_s = 0.001             # optional: how well the speed is known
# [drop] then also takes position_m = [3.2, 10.5], where it was made: east and north

# [published]                       # only with kind = "summary", which has no [camera]; at least depth or stopping time
# penetration_depth_mm = 0.85
# penetration_depth_sigma_mm = 0.03
# stopping_time_ms = 3.0
# stopping_time_sigma_ms = 0.1
# impact_speed_m_s = 0.65           # needed where no height is given
# impact_speed_sigma_m_s = 0.02
"""

SCAN = """# One CT scan of a bead that lies where it stopped, and its grey calibration. Remove the folder ct where there is none.
[projectile]
shape = "sphere"                    # beads only
radius_mm = 0.5                     # of the bead
mass_mg = 1.33                      # of the bead

[drop]
speed_m_s = 0.8                     # at contact
speed_sigma_m_s = 0.05              # how well that speed is known

[scan]
slices = "slices"                   # folder of slices (TIFF, PNG, BMP) in the order of their names, or a file: stack.tif, scan.h5
voxel_um = 40.0                     # edge of a voxel
first_slice = "top"                 # or "bottom": where the first file lies
bits = 8                            # of the images, 8 or 16
# axis_px = [52.5, 50.0]            # optional: column and row of the axis, where the middle of the bead is not to be taken

[calibration]                       # grey level = grey_air + grey_per_density * density
grey_air = 12.0                     # of empty space
grey_per_density = 0.16             # levels per kg/m^3
density_solid_kg_m3 = 2000.0        # of the solid grains: density / density_solid is the filling factor
"""


def new(
    folder: Annotated[Path, typer.Argument(help="Folder to make.")],
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Write an empty campaign to fill in."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise LabsimError(folder, "", "is there already and not empty; name a new folder")
    name = folder.resolve().name.replace("\\", "/").replace('"', "'")
    files = {
        "campaign.toml": CAMPAIGN.replace("{folder}", str(folder)).replace("{name}", name),
        "drops/D01/drop.toml": DROP,
        "drops/D01/track.csv": "frame,tip_row_px\n",
        "ct/C01/scan.toml": SCAN,
    }
    try:
        for file, text in files.items():
            path = folder / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        (folder / "ct" / "C01" / "slices").mkdir()
    except OSError as trouble:
        raise LabsimError(
            folder, "", f"cannot be written ({trouble.strerror}); name a folder you may write to"
        ) from None
    lines = [
        f"{folder}: an empty campaign. To fill in:",
        "  campaign.toml         the dust and the nominal model",
        "  drops/D01/drop.toml   projectile, height and camera of one drop; copy the folder for every further one",
        '  drops/D01/track.csv   its track, frame,tip_row_px; or a video, with kind = "video"',
        "  ct/C01                one CT scan; remove the folder ct where there is none",
        f"Then: labsim check {folder}",
    ]
    options.finish({"campaign": folder, "files": list(files)}, "\n".join(lines), as_json=as_json, quiet=quiet)
