"""Cone soundings as campaigns: data/campaigns/tiller, oysand and stjordal from the files of their source.

    python scripts/make_soundings.py FOLDER OUT

FOLDER holds soundings.csv, LICENSE, SOURCE.txt and one folder a site with its .cpt files and _coords.csv, unchanged as published
(DOI 10.5281/zenodo.14838136, MIT licence). OUT gets a campaign a site: the record of each sounding is the original file, its
place that of _coords.csv, its speed that of soundings.csv, its number the order of date and name. Soundings that do not hold
the depths that a site is compared over are left out and named on the screen.
"""

from __future__ import annotations

import argparse
import re
import shutil
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import pandas as pd


@dataclass(frozen=True)
class Site:
    folder: str
    name: str
    description: str
    window: tuple[float, float]  # m
    cohesion: tuple[float, float]  # Pa
    ground: str


SITES = (
    Site("0_tiller_flotten", "tiller", "Cone soundings at nine speeds in sensitive clay, Tiller-Flotten", (10.0, 18.0),
         (2e4, 3e5), "clay below a dry crust; below 10 m the resistance rises evenly with depth"),
    Site("1_oysand", "oysand", "Cone soundings at nine speeds in sand and silt, Øysand", (8.2, 15.2),
         (1e5, 4e6), "layered sand and silt: drainage and layers are not simulated"),
    Site("2_stjordal", "stjordal", "Cone soundings at five speeds in clayey silt, Stjørdal", (6.0, 18.0),
         (2e4, 6e5), "clayey silt with layers"),
)  # fmt: skip
RADIUS_MM = 17.84  # of a section of 10 cm²
SPEED_SIGMA = 0.03  # relative; the source states nominal speeds, rigs hold them to some percent
SCALE_SIGMA = 0.01  # relative, of a cone's calibration; class 1 of ISO 22476-1 allows 5 % at most
DENSITY = 1800.0  # kg/m³

CAMPAIGN = """format = 1
name = "{name}"
description = "{description}"

[sample]                       # the ground: solids and their water as one matter
filling_factor = 0.5           # times the next number is the density, {density:g} kg/m3
filling_factor_sigma = 0.02
monomer_density_kg_m3 = {double:g}
diameter_mm = 20000.0
depth_mm = 25000.0
gas_pressure_Pa = 0.0

[material]
law = "von_mises"              # undrained: flows at constant volume, strength by cohesion alone
cohesion_range_Pa = [{low:g}, {high:g}]
shear_modulus_Pa = 6.0e6
bulk_modulus_Pa = 6.0e7
rate_reference_per_s = 1.0e-3  # a thousandth of speed over radius at 20 mm/s: cohesion is the strength at the latter

[source]
soundings = "S. M. Valsson, repository penetration_rate_cptu, DOI 10.5281/zenodo.14838136, MIT licence; SOURCE.txt"
ground = "{ground}"
assumed = "density 1800 kg/m3; undrained, rate-independent strength; rigidity of about 75 to 100; speeds as stated with 3 %"
"""

DROP = """[drop]
sequence = {number}
position_m = [{east:.3f}, {north:.3f}]

[projectile]
tip = "cone"
half_angle_deg = 30.0
tip_radius_mm = {radius}

[motion]
kind = "pushed"
speed_m_s = {speed}
speed_sigma_m_s = {sigma:.6g}

[record]
kind = "force"
file = "{file}"
force_unit = "MPa"
sigma = 0.005
scale_sigma = {scale}
window_mm = [{low:g}, {high:g}]
"""


def find_date(path: Path) -> datetime:
    """Day of a sounding, as its heading says."""
    found = re.search(r"HD=(\d\d)\.(\d\d)\.(\d{4})", path.read_text(encoding="latin1"))
    return datetime(int(found[3]), int(found[2]), int(found[1])) if found else datetime.max


def make_site(site: Site, folder: Path, out: Path, soundings: pd.DataFrame) -> None:
    """One campaign."""
    places = pd.read_csv(folder / site.folder / "_coords.csv").set_index("ID")
    chosen = soundings[soundings.site == site.folder]
    whole = chosen[(chosen.from_m < site.window[0]) & (chosen.to_m > site.window[1])]
    left_out = sorted(set(chosen.sounding) - set(whole.sounding))
    rows = sorted(
        whole.itertuples(),
        key=lambda row: (find_date(folder / site.folder / f"{row.sounding}.cpt"), row.sounding),
    )
    target = out / site.name
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    low, high = site.cohesion
    (target / "campaign.toml").write_text(
        CAMPAIGN.format(
            name=site.name,
            description=site.description,
            density=DENSITY,
            double=2 * DENSITY,
            low=low,
            high=high,
            ground=site.ground,
        ),
        encoding="utf-8",
    )
    for name in ("LICENSE", "SOURCE.txt"):
        shutil.copyfile(folder / name, target / name)
    corner = places.loc[[row.sounding for row in rows], ["UTM32-E", "UTM32-N"]].min()
    for number, row in enumerate(rows, start=1):
        own = target / "drops" / row.sounding
        own.mkdir(parents=True)
        shutil.copyfile(folder / site.folder / f"{row.sounding}.cpt", own / f"{row.sounding}.cpt")
        place = places.loc[row.sounding]
        speed = row.speed_mm_s * 1e-3
        (own / "drop.toml").write_text(
            DROP.format(
                number=number, east=place["UTM32-E"] - corner["UTM32-E"], north=place["UTM32-N"] - corner["UTM32-N"],
                radius=RADIUS_MM, speed=speed, sigma=SPEED_SIGMA * speed, scale=SCALE_SIGMA, file=f"{row.sounding}.cpt",
                low=1e3 * site.window[0], high=1e3 * site.window[1],
            ),
            encoding="utf-8",
        )  # fmt: skip
    print(f"{target}: {len(rows)} soundings" + (f"; left out {', '.join(left_out)}" if left_out else ""))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    soundings = pd.read_csv(given.folder / "soundings.csv")
    for site in SITES:
        make_site(site, given.folder, given.out, soundings)


if __name__ == "__main__":
    main()
