"""Labelled campaigns of another solver than labsim's: from a plan of what is hidden to folders and a truth.json.

The solvers are in folders of their own (material_points, lagrangian_mesh), each with a make_campaigns.py that records drops.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import time
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.campaigns import film

Found = TypeVar("Found")
SMALL = 0.5e-3  # m, the radius that forces on the side of a rod are stated for
SCATTER = 0.02  # of p_m from sample to sample, where the plan says no other
# the words of the labelled campaigns' truth.json
WORDS = {"rate_n": "raten", "shear_factor": "yf", "gas_pressure": "pgas", "friction": "mu_f"}


def format_toml(value: object) -> str:
    """A value of a plan; numbers with four digits."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {format_toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(format_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def name_hidden(hidden: dict) -> dict:
    """What is hidden, in the words of the labelled campaigns' truth.json; words of its own where those have none."""
    dust = {WORDS.get(key, key): value for key, value in hidden.get("dust", {}).items()}
    profile = None
    if "crust" in dust:
        excess, length = dust.pop("crust")
        profile = {"kind": "crust", "df": excess, "l": length}
    elif "gradient" in dust:
        profile = {"kind": "gradient", "slope": dust.pop("gradient")}
    elif "layers" in dust:
        amplitude, period = dust.pop("layers")
        profile = {"kind": "layers", "df": amplitude, "period": period}
    sample = {key: hidden[key] for key in ("small_strength", "floor") if key in hidden}
    return {
        "cause": hidden["cause"],
        "pm": float(hidden["pm"]),
        "note": hidden.get("note", ""),
        "seed": hidden["seed"],
        "mat": dust,
        "dyn": {WORDS.get(key, key): value for key, value in hidden.get("body", {}).items()},
        "measure": hidden.get("measure", {}),
        "ct": hidden.get("ct", {}),
        "drift": hidden.get("drift", 0.0),
        "scatter": hidden.get("scatter", SCATTER),
        "profile": profile,
        **sample,
    }


def set_dust(hidden: dict) -> dict:
    """What is hidden in the dust, as fields of a solver's ``Dust``."""
    return {key: tuple(v) if isinstance(v, list) else v for key, v in hidden.get("dust", {}).items()}


def draw_strength(hidden: dict, normal: float, order: float = 0.5) -> float:
    """p_m (Pa) of one sample. normal : drawn with unit variance; order : of its drop, from 0, the first, to 1."""
    own = float(hidden["pm"]) * (1.0 + hidden.get("scatter", SCATTER) * normal)
    return own * (1.0 + hidden.get("drift", 0.0) * (order - 0.5))


def name_drop(result: film.Result, speed: float, p_m: float) -> dict:
    """The truth of one drop, in the words of the labelled campaigns' truth.json."""
    return {
        "true_v0": speed,
        "true_depth": result.stopping_depth,
        "true_stopping_time": result.stopping_time,
        "p_m": p_m,
    }


@contextmanager
def write_folder(out: Path, name: str):
    """A folder to write a campaign into, which takes its name when it is complete."""
    folder = out / f".{name}.part"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    yield folder
    if (out / name).exists():
        shutil.rmtree(out / name)
    os.replace(folder, out / name)


def write_sample(folder: Path, name: str, description: str, nominal, filling: float, solid: float) -> None:
    """campaign.toml. nominal : a solver's ``Dust`` with nothing hidden."""
    (folder / "campaign.toml").write_text(f"""format = 1
name = "{name}"
description = "{description}"

[sample]
filling_factor = {filling:.3f}
filling_factor_sigma = 0.001
monomer_density_kg_m3 = {solid:.1f}
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
""")


def write_test(folder: Path, kind: str, filling, stress, sigma: float, rng: np.random.Generator) -> None:
    """A static test beside the drops. filling, stress (Pa) : rows of the true curve; sigma : relative error of each row."""
    folder.mkdir(parents=True)
    rows = stress * np.exp(sigma * rng.normal(size=len(stress)))
    lines = [f"{phi:.4f},{each:.2f}" for phi, each in zip(filling, rows, strict=True)]
    (folder / "curve.csv").write_text("phi,pressure\n" + "\n".join(lines) + "\n")
    (folder / "strength.toml").write_text(f"""[test]
kind = "{kind}"
file = "curve.csv"
filling_factor_column = "phi"
pressure_column = "pressure"
pressure_unit = "Pa"
relative_sigma = {sigma:g}
""")


def make_campaigns(
    make: Callable[[tuple[dict, Path]], tuple[str, dict]],
    description: str | None,
    plan: Path | None,
    letter: str,
) -> None:
    """The command: every campaign of a plan that is missing in OUT. make : from what is hidden and OUT to name and truth; plan :
    the one to take where none is given (None: one has to be), its campaigns named after ``letter``."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--plan", type=Path, default=plan, required=plan is None)
    parser.add_argument("--only", default="")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    planned = tomllib.loads(arguments.plan.read_text())["campaign"]
    for k, hidden in enumerate(planned):
        hidden.setdefault("name", f"{letter}{k + 1:02d}")
    asked = {name for name in arguments.only.split(",") if name}
    unplanned = asked - {h["name"] for h in planned}
    if unplanned:
        parser.error(f"{arguments.plan} plans no {', '.join(sorted(unplanned))}")
    chosen = [h for h in planned if not asked or h["name"] in asked]
    arguments.out.mkdir(parents=True, exist_ok=True)
    truth_file = arguments.out / "truth.json"
    truth = _read_truth(truth_file)
    for h in chosen:
        if h["name"] in truth:
            truth[h["name"]].update(name_hidden(h))
    jobs = [(h, arguments.out) for h in chosen if h["name"] not in truth]
    began = time.perf_counter()
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        for future in [pool.submit(make, job) for job in jobs]:
            name, found = future.result()
            # others may have made theirs since
            truth = {**_read_truth(truth_file), **truth, name: found}
            partly = truth_file.with_suffix(f".{os.getpid()}.part")
            partly.write_text(json.dumps(truth, indent=1))
            os.replace(partly, truth_file)
            print(
                f"{name}: {found['cause']} ({found['note']}), {time.perf_counter() - began:.0f} s", flush=True
            )


def _read_truth(file: Path) -> dict:
    return json.loads(file.read_text()) if file.exists() else {}


def measure_campaigns(
    measure: Callable[[Path], Found], description: str | None
) -> Iterator[tuple[str, dict, Found]]:
    """The command of a study: name, truth and what is found of every campaign that is named, in their order. measure : of a
    campaign's folder."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", help="g01,g02 …")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    names = asked.names.split(",")
    truth = json.loads((asked.folder / "truth.json").read_text())
    with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
        found = pool.map(measure, [asked.folder / name for name in names])
        yield from zip(names, [truth[name] for name in names], found, strict=True)
