"""What a hidden effect changes of the depth, by labsim's solver and by the material points: by how much do two codes differ?

    OMP_NUM_THREADS=1 python benchmarks/material_points/compare_changes.py FOLDER [--cells 5]

FOLDER holds campaigns of make_campaigns.py and their truth.json. Every drop is run by labsim at its true speed and its sample's
own p_m, with what is hidden and without. On the campaigns with nothing hidden the two codes differ by a smooth function of speed,
size, mass and p_m, which is fitted; what the others differ by beyond it is the error of what the effect changes.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd

from labsim.campaign import read_campaign
from labsim.effects import Effect, list_effects
from labsim.inference.grid import DEFAULT_CELLS, set_nominal_drop
from labsim.sph import DropSetting, simulate

# word of truth.json -> the effect whose amplitude it is
HIDDEN = {
    "yf": "shear_strength",
    "pgas": "pore_gas",
    "delta": "strength_slope",
    "bulk_modulus": "bulk_modulus",
    "tensile_factor": "tensile_strength",
    "phi_2": "strength_ceiling",
    "filling_factor": "filling_factor",
    "eta": "strength_rate",
    "mu_f": "contact_friction",
}


def read_hidden(truth: dict) -> dict[str, float] | None:
    """Effects that are hidden, with their amplitudes; None where one of them changes drops and is not in HIDDEN."""
    terms = {**truth["mat"], **truth["dyn"]}
    if truth["drift"] or truth["profile"] or truth.get("small_strength") or "mass" in truth["measure"]:
        return None
    if terms.pop("raten", 0.5) != 0.5 or any(word not in HIDDEN for word in terms):
        return None
    return {HIDDEN[word]: value for word, value in terms.items()}


def hide(setting: DropSetting, hidden: dict[str, float], effects: dict[str, Effect]) -> DropSetting:
    for name, value in hidden.items():
        setting = effects[name].apply(setting, {effects[name].amplitudes[0].name: value}, None)
    return setting


def run_campaign(folder: Path, truth: dict, hidden: dict[str, float], cells: float) -> list[dict]:
    """One row a drop. off : ln of labsim's depth over the true one, with what is hidden; change : ln of what that does here."""
    campaign = read_campaign(folder)
    effects = {name: list_effects()[name].for_campaign(campaign) for name in hidden}
    rows = []
    for drop in campaign.drops:
        true = truth["drops"][drop.name]
        plain = set_nominal_drop(campaign, drop.projectile, true["true_v0"], true["p_m"], cells)
        depth = simulate(hide(plain, hidden, effects)).penetration_depth
        change = math.log(depth / simulate(plain).penetration_depth) if hidden else 0.0
        rows.append(
            {
                "campaign": folder.name,
                "hidden": " + ".join(f"{name} {value:g}" for name, value in hidden.items()) or "nothing",
                "off": math.log(depth / true["true_depth"]),
                "change": change,
                "froude": math.log(true["true_v0"] / math.sqrt(drop.projectile.tip_radius / 0.5e-3)),
                "size": math.log(drop.projectile.tip_radius / 0.5e-3),
                "mass": math.log(drop.projectile.mass / drop.projectile.tip_radius**3 / 1.064e4),
                "strength": math.log(true["p_m"] / 1300.0),
            }
        )
    return rows


def fit_nominal(rows: pd.DataFrame) -> np.ndarray:
    """How far the two codes differ with nothing hidden, at all rows."""
    f, z = rows.froude, rows.strength
    design = np.column_stack([np.ones(len(rows)), f, f**2, rows["size"], rows.mass, z, f * z, f * rows.mass])
    plain = (rows.hidden == "nothing").to_numpy()
    best = np.linalg.lstsq(design[plain], rows.off[plain], rcond=None)[0]
    return design @ best


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--cells", type=float, default=DEFAULT_CELLS)
    chosen = options.parse_args()
    rows = []
    for name, truth in json.loads((chosen.folder / "truth.json").read_text()).items():
        hidden = read_hidden(truth)
        if hidden is not None:
            rows += run_campaign(chosen.folder / name, truth, hidden, chosen.cells)
    table = pd.DataFrame(rows)
    table["left"] = 100 * (table.off - fit_nominal(table))
    table["change"] *= 100
    grouped = table.groupby(["hidden", "campaign"])
    result = grouped.agg(
        drops=("left", "size"),
        least=("change", "min"),
        most=("change", "max"),
        mean=("left", "mean"),
        rms=("left", lambda left: float(np.sqrt(np.mean(left**2)))),
    )
    change = grouped.change.agg(lambda change: float(np.sqrt(np.mean(change**2))))
    result["share"] = (result.rms / change.where(change > 0.0)).round(3)
    print(result.round(2).to_string())


if __name__ == "__main__":
    main()
