"""What it helps that the solver's own settings are errors of a felt force: campaigns with nothing hidden, without and with that.

    python -m benchmarks.acceleration.settings_as_errors FOLDER f201,f202 [--workers 1]

Settings are the viscosity and the spacing of the particles. Of each campaign: ln evidence of the nominal model, χ² and the
largest score of a cause (standard normal where the errors are right), without these errors and with them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.campaigns.labelled import measure_campaigns
from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.observations.acceleration_model import AccelerationModel
from labsim.inference.problem import Problem
from labsim.inference.scatter import set_error_budget
from labsim.runs.store import RunStore


def describe(problem: Problem, nominal: Fit) -> tuple[float, float, str, float]:
    found = screen(problem, nominal, np.random.default_rng(1))
    largest = max(found.scores, key=lambda score: abs(score.score))
    return nominal.evidence, nominal.chi_square, largest.name, largest.score


def compare(folder: Path) -> tuple[tuple[float, float, str, float], tuple[float, float, str, float]]:
    campaign = read_campaign(folder)
    problem, nominal = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
    models = tuple(
        replace(model, numerics={}) if isinstance(model, AccelerationModel) else model
        for model in problem.tracks.models
    )
    tracks = replace(problem.tracks, models=models)
    bare = replace(problem, observations=(tracks, *problem.observations[1:]))
    return describe(bare, fit_hypothesis(bare, (), (nominal.log_p_m, {}))), describe(problem, nominal)


if __name__ == "__main__":
    print("| campaign | ln evidence: without, with | χ² | largest score |\n|---|---|---|---|")
    gains, sizes = [], []
    for name, _, (bare, full) in measure_campaigns(compare, __doc__):
        gains.append(full[0] - bare[0])
        sizes.append((abs(bare[3]), abs(full[3])))
        print(
            f"| {name} | {bare[0]:.1f}, {full[0]:.1f} | {bare[1]:.0f}, {full[1]:.0f} | "
            f"{bare[2]} {bare[3]:+.1f}, {full[2]} {full[3]:+.1f} |"
        )
    print(f"gain in ln evidence {sum(gains):+.1f}; mean of the largest score " + ", ".join(
        f"{each:.1f}" for each in np.mean(sizes, axis=0)))  # fmt: skip
