"""Make labelled campaigns with the material-point solver: 15 drops as tracks and two CT scans each.

    python benchmarks/material_points/make_campaigns.py OUT [--plan PLAN.toml] [--only c01,c02] [--workers 1]

Writes OUT/c01, OUT/c02, … (campaign folders, format 1) and OUT/truth.json; a folder appears when it is complete, and a
second call makes what is missing. The plan says what is hidden in each (plan.toml beside this file).
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
from drop import GRAVITY, Body, Dust, Numerics, extrapolate_drop, run_drop
from film import HEIGHT_SIGMA, Filming, film, write_drop
from scan import write_scan

BEAD = 2540.0 * 4.0 / 3.0 * np.pi  # kg/m^3: mass of a glass bead over the cube of its radius
SMALL, LARGE = 0.5e-3, 1.5e-3
NUMERICS = Numerics(cells=8.0)  # and half as many again, for the limit of no cell size
# a map has no limit of two runs: one run whose projectile is felt a sixth of a cell around it, as deep as the limit to 0.6 %
MAPPED = Numerics(cells=12.0, width=5.0, height=5.0, near=3.0, gap=0.17)
SCATTER = 0.02  # of p_m from sample to sample, where the plan says no other
FILLING = 0.150  # as stated
# radius (m), mass over a bead's, nominal speed (m/s), film after contact (s)
SERIES = (
    *((SMALL, 1.0, speed, 4.85e-3) for speed in (0.15, 0.30, 0.45, 0.65, 0.65, 0.90, 1.10)),
    *((SMALL, 2.5, speed, 7.35e-3) for speed in (0.30, 0.50, 0.75)),
    *((LARGE, 1.0, speed, 10.7e-3) for speed in (0.20, 0.40, 0.40, 0.70)),
    (LARGE, 2.5, 0.30, 16.3e-3),
)
SCANS = (0.75, 0.37)  # m/s
REST = 2.0  # of the stopping time: a bead is scanned after it has come to rest, some of its depth above the deepest point


def dust_of(hidden: dict, p_m: float) -> Dust:
    values = {key: tuple(v) if isinstance(v, list) else v for key, v in hidden.get("dust", {}).items()}
    return Dust(p_m=p_m, **{"filling_factor": FILLING, **values})


def body_of(hidden: dict, radius: float, mass: float, sphere: bool = False) -> Body:
    """Side forces and the pull grow with the radius; what the plan gives holds for 0.5 mm."""
    terms = dict(hidden.get("body", {}))
    for name in ("side", "shaft_drag", "pull"):
        if name in terms:
            terms[name] *= radius / SMALL
    if sphere:  # no shaft
        terms.pop("side", None)
        terms.pop("shaft_drag", None)
    return Body(radius=radius, mass=mass, sphere=sphere, **terms)


def name_hidden(hidden: dict) -> dict:
    """What is hidden, in the words of the labelled campaigns' truth.json; words of its own where those have none."""
    words = {"rate_n": "raten", "shear_factor": "yf", "gas_pressure": "pgas", "friction": "mu_f"}
    dust = {words.get(key, key): value for key, value in hidden.get("dust", {}).items()}
    profile = None
    if "crust" in dust:
        excess, length = dust.pop("crust")
        profile = {"kind": "crust", "df": excess, "l": length}
    elif "gradient" in dust:
        profile = {"kind": "gradient", "slope": dust.pop("gradient")}
    elif "layers" in dust:
        amplitude, period = dust.pop("layers")
        profile = {"kind": "layers", "df": amplitude, "period": period}
    sample = {key: hidden[key] for key in ("small_strength",) if key in hidden}
    return {
        "cause": hidden["cause"],
        "pm": float(hidden["pm"]),
        "note": hidden.get("note", ""),
        "seed": hidden["seed"],
        "mat": dust,
        "dyn": {words.get(key, key): value for key, value in hidden.get("body", {}).items()},
        "measure": hidden.get("measure", {}),
        "ct": hidden.get("ct", {}),
        "drift": hidden.get("drift", 0.0),
        "profile": profile,
        **sample,
    }


def make_campaign(job: tuple[dict, Path]) -> tuple[str, dict]:
    hidden, out = job
    name = hidden["name"]
    rng = np.random.default_rng(hidden["seed"])
    folder = out / f".{name}.part"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    p_m, scatter = float(hidden["pm"]), hidden.get("scatter", SCATTER)
    measure = hidden.get("measure", {})
    sequence = rng.permutation(len(SERIES)) + 1
    drops = {}
    for k, (radius, heavier, nominal, after) in enumerate(SERIES):
        mass = BEAD * radius**3 * heavier
        speed = nominal * rng.uniform(0.94, 1.06)
        own = p_m * (1.0 + scatter * rng.normal())
        own *= 1.0 + hidden.get("drift", 0.0) * ((sequence[k] - 1) / (len(SERIES) - 1) - 0.5)
        if radius < 1e-3:
            own *= hidden.get("small_strength", 1.0)
        body = body_of(hidden, radius, mass * measure.get("mass", 1.0))
        result = extrapolate_drop(dust_of(hidden, own), body, speed, NUMERICS, stop_factor=1.12)
        assert result.stopping_time > 0.0, f"{name} drop {k + 1} did not stop"
        label = f"D{k + 1:02d}"
        drops[label] = {
            "true_v0": speed,
            "true_depth": result.stopping_depth,
            "true_stopping_time": result.stopping_time,
            "p_m": float(own),
        }
        filming = Filming(
            frame_rate=10000.0 if radius < 1e-3 else 5000.0,
            pixel_size=20e-6 if radius < 1e-3 else 40e-6,
            after=after,
            pixel_factor=measure.get("pixel", 1.0),
            frame_factor=measure.get("frame", 1.0),
            surface_error=measure.get("surface_row", 0.0),
            wobble=tuple(measure.get("wobble", (0.0, 1.0))),
        )
        frames, rows, surface = film(result, speed, filming, rng)
        height = speed**2 / (2.0 * GRAVITY) + HEIGHT_SIGMA * rng.normal()
        write_drop(
            folder / "drops" / label, frames, rows, surface,
            radius=radius, mass=mass, sequence=int(sequence[k]), height=max(height, 1e-5), filming=filming,
        )  # fmt: skip
    scans = {}
    ct = hidden.get("ct", {})
    for k, nominal in enumerate(SCANS):
        speed = nominal * rng.uniform(0.94, 1.06)
        own = p_m * (1.0 + scatter * rng.normal()) * hidden.get("small_strength", 1.0)
        mass = BEAD * SMALL**3
        dust = dust_of(hidden, own)
        body = body_of(hidden, SMALL, mass * measure.get("mass", 1.0), sphere=True)
        result = run_drop(dust, body, speed, MAPPED, stop_factor=REST)
        blur = ct["blur_mm"] * 1e-3 if "blur_mm" in ct else None
        scans[f"C{k + 1:02d}"] = write_scan(
            folder / "ct" / f"C{k + 1:02d}", result, dust, SMALL, mass, speed, SMALL / MAPPED.cells, rng,
            ct.get("scale", 1.0), blur,
        )  # fmt: skip
    (folder / "campaign.toml").write_text(campaign_toml(name))
    if (out / name).exists():
        shutil.rmtree(out / name)
    os.replace(folder, out / name)
    return name, {
        **name_hidden(hidden),
        "name": name,
        "drops": drops,
        "scans": scans,
    }


def campaign_toml(name: str) -> str:
    nominal = Dust()
    return f"""format = 1
name = "{name}"
description = "Drops of rods and glass beads into dust, by a material-point solver"

[sample]
filling_factor = {FILLING:.3f}
filling_factor_sigma = 0.001
monomer_density_kg_m3 = 2000.0
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
    parser.add_argument("--plan", type=Path, default=Path(__file__).parent / "plan.toml")
    parser.add_argument("--only", default="")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    plan = tomllib.loads(arguments.plan.read_text())["campaign"]
    for k, hidden in enumerate(plan):
        hidden.setdefault("name", f"c{k + 1:02d}")
    chosen = [h for h in plan if not arguments.only or h["name"] in arguments.only.split(",")]
    arguments.out.mkdir(parents=True, exist_ok=True)
    truth_file = arguments.out / "truth.json"
    truth = json.loads(truth_file.read_text()) if truth_file.exists() else {}
    for h in chosen:
        if h["name"] in truth:
            truth[h["name"]].update(name_hidden(h))
    jobs = [(h, arguments.out) for h in chosen if h["name"] not in truth]
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
