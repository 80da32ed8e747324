"""How large the errors of an accelerometer's force are: campaigns of another code, with nothing hidden, have the most evidence.

    python -m benchmarks.lagrangian_mesh.make_campaigns FOLDER --plan benchmarks/lagrangian_mesh/fresh.toml --only f01,f02,…
    python -m benchmarks.acceleration.sizes FOLDER [FOLDER …] [--factors 0.7 1.4]

FOLDER holds campaigns of benchmarks/lagrangian_mesh/make_campaigns.py. Printed of those with nothing hidden are the sizes with
which the nominal fits of all have the most evidence together (Nelder and Mead); what ln evidence the sizes in use and each of
them times a factor have less than that; with the sizes in use the largest gain of a law without a name and of the screening's
best cause in ln evidence, the campaigns that the screening doubts (p below 0.05), how far ln p_m is off. Of those in which one
cause is hidden, fitted from its true size: what ln evidence they have less if a share of what the cause changes is an error
too, as it is of depths that a camera sees.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from benchmarks.accuracy.blind import read_hidden
from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.diagnosis.shapes import lay_out_shapes
from labsim.diagnosis.unlisted.unknown import fit_unknown
from labsim.inference.calibrate import prepare
from labsim.inference.fits.blocks import solve_globals
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.fits.tangents import linearise_at
from labsim.inference.observations import acceleration_model
from labsim.inference.problem import Problem
from labsim.inference.scatter import set_error_budget
from labsim.runs.store import RunStore

SHARES = (0.01, 0.03, 0.1)  # of what a cause changes
SIZES = ("FORCE_ROUGHNESS", "FORCE_SHAPE", "SHAPE_LENGTH", "FORCE_REACH")
MOST = 150  # evaluations of the sum


def list_nulls(folders: list[Path]) -> Iterator[tuple[Path, float]]:
    """Campaigns with their true p_m (Pa)."""
    for folder in folders:
        for name, truth in json.loads((folder / "truth.json").read_text()).items():
            if truth["cause"] == "none":
                yield folder / name, truth["pm"]


def add_evidence(fits: Sequence[tuple[Problem, Fit]], sizes: Sequence[float]) -> float:
    """ln evidence of all nominal fits with these sizes, but for a constant; p_m and nuisances go to their best by one step."""
    for name, size in zip(SIZES, sizes, strict=True):
        setattr(acceleration_model, name, size)
    total = 0.0
    for problem, fit in fits:
        blocks = linearise_at(problem, fit.nuisances, fit.log_p_m, {})
        _, covariance, chi_square, log_determinant, _ = solve_globals(blocks, ("ln_p_m",), {})
        total += 0.5 * (math.log(covariance[0, 0]) - chi_square - log_determinant)
    return total


def list_causes(folders: list[Path]) -> Iterator[tuple[Path, str, tuple[float, float]]]:
    """Campaigns in which one cause is hidden: its name, and (ln p_m, value of its first parameter)."""
    for folder in folders:
        for name, truth in json.loads((folder / "truth.json").read_text()).items():
            hidden = read_hidden(truth) if truth["cause"] != "none" else {}
            if len(hidden) == 1:
                ((cause, (value, _)),) = hidden.items()
                yield folder / name, cause, (math.log(truth["pm"]), value)


def show_changes(folders: list[Path]) -> None:
    """ln evidence that is lost with an error that is a share of what a cause changes."""
    less = []
    for path, cause, (log_p_m, value) in list_causes(folders):
        campaign = read_campaign(path)
        problem, _ = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
        if cause not in problem.effects:
            continue
        start = {cause: value - problem.effects[cause].amplitudes[0].null}
        fit = fit_hypothesis(problem, (cause,), (log_p_m, start), around=True)
        acceleration_model.AccelerationModel.changes_differ = True
        row = []
        for share in SHARES:
            problem.budget = replace(problem.budget, numerical_change=share)
            again = fit_hypothesis(problem, (cause,), (fit.log_p_m, fit.values), around=True, nuisances=fit)
            row.append(fit.evidence - again.evidence)
        acceleration_model.AccelerationModel.changes_differ = False
        less.append(row)
        print(f"{path.name} {cause}: " + ", ".join(f"{each:.1f}" for each in row), flush=True)
    if less:
        shares = ", ".join(f"{each:g}" for each in SHARES)
        total = ", ".join(f"{each:.1f}" for each in np.sum(less, axis=0))
        print(
            f"\n{len(less)} campaigns, ln evidence less with {shares} of what a cause changes as an error: {total}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--factors", type=float, nargs="+", default=[0.7, 1.4])
    asked = parser.parse_args()
    usual = [getattr(acceleration_model, name) for name in SIZES]
    fits, laws, causes, p_values, off = [], [], [], [], []
    for path, p_m in list_nulls(asked.folders):
        campaign = read_campaign(path)
        problem, nominal = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
        fits.append((problem, nominal))
        off.append(nominal.log_p_m - math.log(p_m))
        lay_out_shapes(problem)
        screening = screen(problem, nominal, np.random.default_rng(1))
        causes.append(max(score.log_bayes for score in screening.scores))
        p_values.append(screening.p_value)
        laws.append(fit_unknown(problem, nominal).evidence - nominal.evidence)

    show_changes(asked.folders)
    if not fits:
        return
    here = add_evidence(fits, usual)
    best = minimize(
        lambda logs: -add_evidence(fits, np.exp(logs)),
        np.log(usual),
        method="Nelder-Mead",
        options={"maxfev": MOST},
    )
    print(f"{len(fits)} campaigns\n\n| size | in use | most evidence | less ln evidence: in use | "
          + " | ".join(f"× {factor:g}" for factor in asked.factors) + " |")  # fmt: skip
    print("|---" * (4 + len(asked.factors)) + "|")
    for k, name in enumerate(SIZES):
        row = []
        for factor in asked.factors:
            sizes = list(usual)
            sizes[k] *= factor
            row.append(add_evidence(fits, sizes))
        less = " | ".join(f"{-best.fun - each:.1f}" for each in (here, *row))
        print(f"| {name} | {usual[k]:g} | {math.exp(best.x[k]):.3g} | {less} |")
    doubted = sum(p < 0.05 for p in p_values)
    print(
        f"\nlargest gain of a law without a name {max(laws):.1f}, of a cause {max(causes):.1f}; "
        f"doubted {doubted} of {len(fits)}; "
        f"ln p_m off by {np.mean(off):+.3f} ± {np.std(off):.3f}"
    )


if __name__ == "__main__":
    main()
