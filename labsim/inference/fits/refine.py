"""Large effects bend with p_m and with their own amplitude: a fit of one is made once more among runs about itself."""

from __future__ import annotations

import math

import numpy as np

from ..emulation.nodes import nodes_around
from ..problem import Problem
from .fitting import Fit, fit_hypothesis

LARGE = 0.5  # of an effect's step
LARGE_CHANGE = 0.1  # of the largest datum of a drop, where accelerometers are and steps are long
MOST_MOVED = 2  # times that runs are made at the amplitude itself
MOVED = 0.5  # of its standard deviation, that asks for them once more


def list_large_effects(problem: Problem, fit: Fit) -> list[str]:
    """Effects of a fit that change runs and are larger than LARGE, or change more of a record than LARGE_CHANGE where runs are
    rough; not those of the numerics, whose runs cost too much, nor laws on the projectile, whose bend takes no runs."""
    if problem.pushed:
        return []  # what a rate changes of a push is smooth, and runs of amplitudes near each other differ by noise
    return [
        name
        for name, value in fit.values.items()
        if problem.affects_simulation(name)
        and not problem.follows_trend(name)
        and problem.effects[name].kind != "numerics"
        and (
            abs(value) > LARGE * abs(problem.effects[name].amplitudes[0].step)
            or _change(problem, fit, name) > LARGE_CHANGE
        )
    ]


def _change(problem: Problem, fit: Fit, name: str) -> float:
    """What an effect changes, over the largest datum of a drop, the largest over all; nought where no accelerometer is."""
    if not problem.felt:
        return 0.0
    changed = fit.drops.tangents[name] * fit.values[name]
    return max(
        float(np.max(np.abs(changed[fit.drops.sections[model.observed.name]][: model.data.size])))
        / float(np.max(np.abs(model.data)))
        for model in problem.tracks.models
    )


def refine(problem: Problem, fit: Fit) -> Fit:
    """The fit among runs about it, then among runs at its own large amplitudes too, until these move it no more."""
    text = " and ".join(fit.hypothesis)
    for turn in range(1 + MOST_MOVED):
        if turn > 0:
            own = {name: float(f"{fit.values[name]:.2g}") for name in list_large_effects(problem, fit)}
            indices = nodes_around(fit.log_p_m)
            problem.require_changes([(name, own[name], index) for name in own for index in indices], text)
        before = fit
        fit = fit_hypothesis(problem, fit.hypothesis, (fit.log_p_m, fit.values), around=True, nuisances=fit)
        moved = [
            abs(fit.values[name] - before.values[name]) / math.sqrt(before.covariance[k, k])
            for k, name in enumerate(fit.hypothesis, start=1)
        ]
        if turn > 0 and max(moved) < MOVED:
            break
    return fit
