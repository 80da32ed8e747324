"""Make labelled campaigns on the Lagrangian mesh: six drops each, which an accelerometer on the rod feels.

    python benchmarks/lagrangian_mesh/make_campaigns.py OUT [--plan PLAN.toml] [--only a01,a02] [--workers 1]

Writes OUT/a01, OUT/a02, … (campaign folders, format 1) and OUT/truth.json; a folder appears when it is complete, and a second
call makes what is missing. The plan says what is hidden in each (campaigns.toml beside this file). Drops are no deeper than the
1.5 radii that the mesh serves to; its force is smooth to 0.4 % of the peak.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from feel import SCALE_SIGMA, Sensing, write_felt
from mesh import BEAD_DENSITY, Dust, Numerics, run_drop

BEAD = BEAD_DENSITY * 4.0 / 3.0 * np.pi  # kg/m^3: mass of a glass bead over the cube of its radius
SMALL = 0.5e-3  # m, of the rod that the plan's side force is for
CELLS = 16.0
SCATTER = 0.02  # of p_m from sample to sample, where the plan says no other
# radius (m), mass over a bead's, nominal speed (m/s)
SERIES = (
    (0.75e-3, 1.0, 0.30),
    (0.75e-3, 1.0, 0.50),
    (0.75e-3, 2.5, 0.30),
    (1.5e-3, 1.0, 0.25),
    (1.5e-3, 1.0, 0.42),
    (1.5e-3, 2.5, 0.22),
)
RATES, NOISES = (2e3, 50e3), (0.001, 0.02)  # Hz; over the peak: drawn between, evenly in the logarithm
# the words of the labelled campaigns' truth.json
WORDS = {"eta": "eta", "rate_n": "raten", "shear_factor": "yf", "gas_pressure": "pgas"}


def name_hidden(hidden: dict) -> dict:
    dust = {WORDS.get(key, key): value for key, value in hidden.get("dust", {}).items()}
    profile = None
    if "crust" in dust:
        excess, length = dust.pop("crust")
        profile = {"kind": "crust", "df": excess, "l": length}
    elif "gradient" in dust:
        profile = {"kind": "gradient", "slope": dust.pop("gradient")}
    return {
        "cause": hidden["cause"],
        "pm": float(hidden["pm"]),
        "note": hidden.get("note", ""),
        "seed": hidden["seed"],
        "mat": dust,
        "dyn": {key: hidden[key] for key in ("side",) if key in hidden},
        "measure": {key: hidden[key] for key in ("mass",) if key in hidden},
        "ct": {},
        "drift": hidden.get("drift", 0.0),
        "profile": profile,
    }


def make_campaign(job: tuple[dict, Path]) -> tuple[str, dict]:
    hidden, out = job
    name = hidden["name"]
    rng = np.random.default_rng(hidden["seed"])
    folder = out / f".{name}.part"
    shutil.rmtree(folder, ignore_errors=True)
    rate, noise = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (RATES, NOISES))
    sensing = Sensing(rate, noise, 1.0 + SCALE_SIGMA * rng.normal())
    terms = {key: tuple(v) if isinstance(v, list) else v for key, v in hidden.get("dust", {}).items()}
    sequence = rng.permutation(len(SERIES)) + 1
    drops = {}
    for k, (radius, heavier, nominal) in enumerate(SERIES):
        mass = BEAD * radius**3 * heavier
        speed = nominal * rng.uniform(0.94, 1.06)
        own = float(hidden["pm"]) * (1.0 + hidden.get("scatter", SCATTER) * rng.normal())
        own *= 1.0 + hidden.get("drift", 0.0) * ((sequence[k] - 1) / (len(SERIES) - 1) - 0.5)
        dust = Dust(p_m=own, **terms)
        side = hidden.get("side", 0.0) * radius / SMALL
        numerics = Numerics(cells=CELLS)
        result = run_drop(dust, radius, speed, numerics, mass=mass * hidden.get("mass", 1.0), side=side)
        label = f"D{k + 1:02d}"
        write_felt(
            folder / "drops" / label, result, sensing, rng,
            radius=radius, mass=mass, sequence=int(sequence[k]), speed=speed,
        )  # fmt: skip
        drops[label] = {
            "true_v0": speed,
            "true_depth": result.stopping_depth,
            "true_stopping_time": result.stopping_time,
            "p_m": own,
        }
    (folder / "campaign.toml").write_text(campaign_toml(name))
    if (out / name).exists():
        shutil.rmtree(out / name)
    os.replace(folder, out / name)
    return name, {**name_hidden(hidden), "name": name, "drops": drops, "scans": {}}


def campaign_toml(name: str) -> str:
    nominal = Dust()
    return f"""format = 1
name = "{name}"
description = "Drops of rods with an accelerometer into dust, on a Lagrangian mesh"

[sample]
filling_factor = {nominal.filling_factor:.3f}
filling_factor_sigma = 0.001
monomer_density_kg_m3 = {nominal.solid}
diameter_mm = 25.0
depth_mm = 20.0
gas_pressure_Pa = 10.0

[material]          # nominal; p_m is what calibration finds
p_m_range_Pa = [300.0, 6000.0]
phi_1 = {nominal.phi_1}
phi_2 = {nominal.phi_2}
delta = {nominal.delta}
tensile_log10_a = 2.8
tensile_log10_b = 1.48
shear_factor = 1.0          # Y = shear_factor * sqrt(Sigma |T|)
bulk_modulus_Pa = {nominal.bulk_modulus:.1f}   # K(phi) = bulk_modulus * (phi/0.15)^gamma
bulk_exponent = 4.0
shear_to_bulk = {nominal.shear_to_bulk}         # mu = shear_to_bulk * K
contact_friction = 0.0
"""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--plan", type=Path, default=Path(__file__).parent / "campaigns.toml")
    parser.add_argument("--only", default="")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    plan = tomllib.loads(arguments.plan.read_text())["campaign"]
    for k, hidden in enumerate(plan):
        hidden.setdefault("name", f"a{k + 1:02d}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    truth_file = arguments.out / "truth.json"
    truth = json.loads(truth_file.read_text()) if truth_file.exists() else {}
    jobs = [
        (hidden, arguments.out)
        for hidden in plan
        if hidden["name"] not in truth and (not arguments.only or hidden["name"] in arguments.only.split(","))
    ]
    began = time.perf_counter()
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        for future in [pool.submit(make_campaign, job) for job in jobs]:
            name, found = future.result()
            truth[name] = found
            partly = truth_file.with_suffix(".part")
            partly.write_text(json.dumps(truth, indent=1))
            os.replace(partly, truth_file)
            print(
                f"{name}: {found['cause']} ({found['note']}), {time.perf_counter() - began:.0f} s", flush=True
            )


if __name__ == "__main__":
    main()
