"""Does an effect do in SPH what it does in an independent solver? Labelled campaigns in, a table out.

    python -m benchmarks.solver.effects_against_truth FOLDER [--drops 4]

FOLDER holds campaigns and a truth.json with the hidden cause and each drop's true speed and depth, made by another
method (material points). Every drop is simulated at its true speed and p_m, with and without the effect, at eight
spacings a tip radius. What is left with the effect is numerical error (compare the nominal campaigns) and the scatter
of p_m from sample to sample, 2 % or 0.6 % in depth.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from labsim.campaign import read_campaign
from labsim.effects import list_effects, list_places
from labsim.sph import DropSetting, simulate

# the values of an effect's parameters in the words of truth.json
VALUES = {
    "none": lambda truth: {},
    "strength_rate": lambda truth: {"eta": truth["mat"]["eta"], "n": truth["mat"]["raten"]},
    "strength_slope": lambda truth: {"delta": truth["mat"]["delta"]},
    "shear_strength": lambda truth: {"factor": truth["mat"]["yf"]},
    "pore_gas": lambda truth: {"P0": truth["mat"]["pgas"]},
    "surface_crust": lambda truth: {"excess": truth["profile"]["df"], "length": truth["profile"]["l"]},
    "contact_friction": lambda truth: {"mu": truth["dyn"]["mu_f"]},
    "side_friction": lambda truth: {"force_per_length": float(truth["note"].split()[0])},
}


def compare(folder: Path, truth: dict, count: int) -> list[tuple[float, float, float, float]]:
    """Tip radius (m), speed (m/s), and error of the depth with and without the effect, of some drops of a campaign."""
    campaign = read_campaign(folder)
    effects, places = list_effects(campaign), list_places(campaign)
    cause, values = truth["cause"], VALUES[truth["cause"]](truth)
    drops = sorted(
        campaign.drops, key=lambda drop: (drop.projectile.tip_radius, truth["drops"][drop.name]["true_v0"])
    )
    chosen = [drops[round(k * (len(drops) - 1) / (count - 1))] for k in range(count)]
    rows = []
    for drop in chosen:
        known = truth["drops"][drop.name]
        radius = drop.projectile.tip_radius
        plain = DropSetting(
            projectile=drop.projectile,
            impact_speed=known["true_v0"],
            material=campaign.material.replace(p_m=float(truth["pm"])),
            filling_factor=campaign.sample.filling_factor,
            monomer_density=campaign.sample.monomer_density,
            gravity=campaign.gravity,
            spacing=radius / 8,
            after_stop=0.0,
        )
        without = simulate(plain).penetration_depth
        with_it = without
        if cause != "none":
            with_it = simulate(effects[cause].apply(plain, values, places[drop.name])).penetration_depth
        depth = known["true_depth"]
        rows.append((radius, known["true_v0"], with_it / depth - 1, without / depth - 1))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--drops", type=int, default=4, help="drops of each campaign, at least 2")
    options = parser.parse_args()
    print(
        "| campaign | effect | R mm, v m/s | depth with the effect, % | without, % |\n|---|---|---|---|---|"
    )
    for name, truth in json.loads((options.folder / "truth.json").read_text()).items():
        if truth["cause"] in VALUES:
            for radius, speed, with_it, without in compare(options.folder / name, truth, options.drops):
                print(
                    f"| {name} | {truth['cause']} | {radius * 1e3:.1f}, {speed:.2f} | {with_it * 100:+.1f} "
                    f"| {without * 100:+.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
