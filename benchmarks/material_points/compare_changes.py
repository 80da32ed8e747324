"""What a hidden effect changes of the depth, by labsim's solver and by the material points: by how much do two codes differ?

    OMP_NUM_THREADS=1 python -m benchmarks.material_points.compare_changes FOLDER [--cells 5] [--rows ROWS.csv]

FOLDER holds campaigns of make_campaigns.py and their truth.json, or others labelled alike. Every drop is run by labsim at its
true speed and its sample's own p_m (where told), with what is hidden and without; ROWS.csv keeps that. On the campaigns with
nothing hidden the two codes differ by a parabola in ln(depth over tip radius), which is fitted; what others differ by beyond it
is the error of what the effect changes. Then the ln likelihood of all differences, with the solver's errors that labsim's
likelihood has, for several sizes of these.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from labsim.campaign import read_campaign
from labsim.effects import Effect, list_effects
from labsim.inference.emulation.grid import DEFAULT_CELLS, set_nominal_drop
from labsim.inference.fits.blocks import Block
from labsim.inference.observations.linearised_drop import USUAL_DEPTH, ErrorBudget, NumericalError
from labsim.inference.observations.tracks import numerical_covariance
from labsim.sph import DropSetting, simulate

DEPTH_BY_STRENGTH = -0.3  # d ln D / d ln p_m
LEFT = 0.002  # of the depth: lattice, interpolation of the stop
TRIED = {
    "as they are": {},
    "numerical 0.4 %": {"numerical": 0.004},
    "numerical 0.8 %": {"numerical": 0.008},
    "slope 0.5 %": {"numerical_slope": 0.005},
    "slope 2 %": {"numerical_slope": 0.02},
    "change 1.5 %": {"numerical_change": 0.015},
    "change 5 %": {"numerical_change": 0.05},
    "contact 0.75 %": {"contact_offset": 0.0075},
    "contact 3 %": {"contact_offset": 0.03},
}

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
        p_m = true.get("p_m", truth["pm"])
        plain = set_nominal_drop(campaign, drop.projectile, true["true_v0"], p_m, cells)
        depth = simulate(hide(plain, hidden, effects)).penetration_depth
        change = math.log(depth / simulate(plain).penetration_depth) if hidden else 0.0
        rows.append(
            {
                "campaign": folder.name,
                "hidden": " + ".join(f"{name} {value:g}" for name, value in hidden.items()) or "nothing",
                "off": math.log(depth / true["true_depth"]),
                "change": change,
                "reach": math.log(true["true_depth"] / drop.projectile.tip_radius),
                "froude": math.log(true["true_v0"] / math.sqrt(drop.projectile.tip_radius / 0.5e-3)),
                "size": math.log(drop.projectile.tip_radius / 0.5e-3),
                "mass": math.log(drop.projectile.mass / drop.projectile.tip_radius**3 / 1.064e4),
                # of samples whose own p_m is not told
                "sigma": LEFT
                if "p_m" in true
                else math.hypot(LEFT, DEPTH_BY_STRENGTH * ErrorBudget().scatter),
            }
        )
    return rows


def fit_nominal(rows: pd.DataFrame, by: str = "reach") -> np.ndarray:
    """How far the two codes differ with nothing hidden, at all rows: a parabola."""
    design = np.vander(rows[by], 3)
    plain = (rows.hidden == "nothing").to_numpy()
    best = np.linalg.lstsq(design[plain], rows.off[plain], rcond=None)[0]
    return np.asarray(design @ best)


def log_likelihood(rows: pd.DataFrame, budget: ErrorBudget, by: str) -> float:
    """Of the differences of the depths, of all campaigns together; by : what drops are alike by, reach or froude."""
    total = 0.0
    for _, drops in rows.sort_values("reach", kind="stable").groupby("campaign"):
        changed = 1.0 - np.exp(-drops.change.to_numpy())
        size = np.hypot(budget.numerical, budget.numerical_change * changed)
        parts = [
            NumericalError(np.array([s]), np.ones(1), x, r, m)
            for s, x, r, m in zip(size, drops[by], drops["size"], drops.mass, strict=True)
        ]
        usual = np.interp(USUAL_DEPTH, drops.reach, drops[by])
        shared = np.column_stack(
            [
                (drops[by] - usual) * budget.numerical_slope,
                np.exp(-drops.reach) * budget.contact_offset,
                np.full(len(drops), DEPTH_BY_STRENGTH * budget.numerical_strength),
            ]
        )
        covariance = numerical_covariance(parts) + shared @ shared.T + np.diag(drops.sigma**2)
        block = Block(drops.off.to_numpy(), covariance, {})
        total -= 0.5 * (block.chi_square + block.log_determinant)
    return total


def find_rms(values: pd.Series) -> float:
    return float(np.sqrt(np.mean(values**2)))


def tabulate(rows: pd.DataFrame) -> pd.DataFrame:
    """One row a campaign, in % of the depth."""
    table = rows.assign(left=100 * (rows.off - fit_nominal(rows)), change=100 * rows.change)
    grouped = table.groupby(["hidden", "campaign"])
    result = grouped.agg(
        drops=("left", "size"),
        least=("change", "min"),
        most=("change", "max"),
        mean=("left", "mean"),
        rms=("left", find_rms),
    )
    change = grouped.change.agg(find_rms)
    result["share"] = (result.rms / change.where(change > 0.0)).round(3)
    return result


def compare_sizes(rows: pd.DataFrame) -> str:
    """ln likelihood less that of the sizes as they are."""
    without_gas = rows[~rows.hidden.str.contains("pore_gas")]
    found = {"alike by speed over root of radius": log_likelihood(without_gas, ErrorBudget(), "froude")}
    for name, sizes in TRIED.items():
        found[name] = log_likelihood(without_gas, replace(ErrorBudget(), **sizes), "reach")
    return "\n".join(f"{name:36s}{each - found['as they are']:+9.1f}" for name, each in found.items())


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("folder", type=Path)
    options.add_argument("--cells", type=float, default=DEFAULT_CELLS)
    options.add_argument("--rows", type=Path, help="kept here; taken from here where it exists")
    chosen = options.parse_args()
    if chosen.rows and chosen.rows.exists():
        rows = pd.read_csv(chosen.rows)
    else:
        found = []
        for name, truth in json.loads((chosen.folder / "truth.json").read_text()).items():
            hidden = read_hidden(truth)
            if hidden is not None:
                found += run_campaign(chosen.folder / name, truth, hidden, chosen.cells)
        rows = pd.DataFrame(found)
        if chosen.rows:
            rows.to_csv(chosen.rows, index=False)
    print(tabulate(rows).round(2).to_string())
    plain = rows[rows.hidden == "nothing"]
    for by in ("reach", "froude"):
        left = 100 * find_rms(plain.off - fit_nominal(plain, by))
        print(f"nothing hidden, left by a parabola in {by}: {left:.2f} % rms")
    print(compare_sizes(rows))


if __name__ == "__main__":
    main()
