"""Causes that a campaign could not see were they there, and the p_m that each of them would imply.

An effect changes the data by ``trace`` standard deviations of their errors once ln p_m and what is fitted beside it have
followed. What leaves less than SEEN passes for nothing, and p_m takes its place: so each effect is taken with the amplitude that
leaves that much, or with one standard deviation of its prior where that is less. All to first order about one fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..calibrated import show_parameter
from ..inference.fits.blocks import whiten_all
from ..inference.fits.fitting import Fit, with_perturbations
from ..inference.problem import Problem
from .screen import has_runs
from .shapes import cause

SEEN = 2.0  # standard deviations that a trace has to leave: the score of one effect exceeds that by chance one time in twenty
HALF = 1.645  # standard deviations, half of an interval of 90 %: what leaves p_m inside its own is not worth a line


@dataclass(frozen=True)
class Untestable:
    """One cause, with the largest amplitude that passes for nothing.

    trace : what it leaves, in standard deviations of the data's errors; traded : ln p_m that a unit of amplitude takes from the
    dust; values : of the cause's parameter, on either side of null as far as its limits go; p_m : lowest and highest, Pa, of dust
    with so much of it.
    """

    name: str
    trace: float
    traded: float
    values: tuple[float, float]
    p_m: tuple[float, float]

    @property
    def width(self) -> float:
        """ln of highest over lowest p_m."""
        return math.log(self.p_m[1] / self.p_m[0])


@dataclass(frozen=True)
class Combination:
    """What is measured although p_m alone is not. expression : in words of parameters; value : Pa; sigma : of its ln."""

    expression: str
    value: float
    sigma: float


def list_untestable(problem: Problem, fit: Fit) -> list[Untestable]:
    """Every effect beside those of the fit that moves p_m, unseen, out of its 90 % interval; the widest p_m first. Of one with a
    shape, the stated shape stands for all."""
    names = [
        name
        for name, effect in problem.effects.items()
        if effect.amplitudes
        and name not in fit.hypothesis
        and effect.kind != "numerics"
        and cause(name) == name
    ]
    names = [name for name in names if not problem.affects_simulation(name) or has_runs(problem, name)]
    known = ["ln_p_m", *fit.hypothesis]
    tangents = whiten_all(with_perturbations(problem, fit, names), [*known, *names])[:, 1:]
    scales = np.array([problem.effects[name].amplitudes[0].scale for name in fit.hypothesis])
    priors = np.hstack(
        [np.zeros((len(scales), 1)), np.diag(1.0 / scales), np.zeros((len(scales), len(names)))]
    )
    rows = np.vstack([tangents, priors])
    followed = np.linalg.lstsq(rows[:, : len(known)], rows[:, len(known) :], rcond=None)[0]
    left = np.linalg.norm(rows[:, len(known) :] - rows[:, : len(known)] @ followed, axis=0)
    found = []
    for name, length, traded in zip(names, left, followed[0], strict=True):
        parameter = problem.effects[name].amplitudes[0]
        size = min(parameter.scale, SEEN / max(length, 1e-300))
        values = [parameter.hold(side * size) for side in (-1.0, 0.0, 1.0)]
        implied = np.exp(fit.log_p_m - traded * (np.array(values) - parameter.null))
        implied = np.clip(implied, *problem.campaign.p_m_range)
        each = Untestable(
            name,
            float(length * size),
            float(traded),
            (values[0], values[2]),
            (float(implied.min()), float(implied.max())),
        )
        if max(abs(math.log(p_m) - fit.log_p_m) for p_m in each.p_m) > HALF * math.sqrt(fit.covariance[0, 0]):
            found.append(each)
    return sorted(found, key=lambda each: -each.width)


def find_combination(problem: Problem, fit: Fit, untestable: list[Untestable]) -> Combination | None:
    """p_m with what the first of the untestable causes takes; None where everything is testable."""
    if not untestable:
        return None
    name, power = untestable[0].name, untestable[0].traded
    parameter = problem.effects[name].amplitudes[0]
    full = f"{name}.{parameter.name}"
    # about a null of one the amplitude is the ln of a factor
    amplitude = full if parameter.null == 0.0 else f"({full} - {parameter.null:g})"
    factor = f"{full}^{power:.2f}" if parameter.null == 1.0 else f"exp({power:.3g} * {amplitude})"
    return Combination(
        f"{show_parameter(problem.campaign.material.law)[0]} * {factor}",
        math.exp(fit.log_p_m),
        math.sqrt(fit.covariance[0, 0]),
    )
