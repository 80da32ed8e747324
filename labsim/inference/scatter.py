"""How much the dust differs from sample to sample is not known beforehand: drops that scatter are no cause.

The scatter of ln p_m is estimated by restricted maximum likelihood (Patterson & Thompson 1971). The likelihood holds the least
scatter that any dust has (ErrorBudget.scatter) or, where a model with a larger one has more evidence, that. Both have the prior
probability of what they stand for, half of a normal distribution. What campaign.toml states is taken as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular
from scipy.stats import halfnorm

from ..records import Campaign, FloatArray
from .fits.fitting import Fit, fit_hypothesis, is_stopped
from .observations.linearised_drop import ErrorBudget
from .problem import Problem

WIDTH = 0.05  # of the prior of the scatter of ln p_m, half-normal: sieved dust of one batch 2 %, poured soils 10 %
APART = 1.5  # ratio of two scatters that are told apart
LADDER = (0.0025, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.09, 0.13, 0.2, 0.3, 0.5)
QUANTILES = {"q05": 0.05, "q16": 0.16, "q50": 0.50, "q84": 0.84, "q95": 0.95}


@dataclass(frozen=True)
class Scatter:
    """One value of the scatter of ln p_m, and ln of the prior probability of what it stands for."""

    value: float
    log_prior: float


@dataclass(frozen=True)
class ScatterEstimate:
    """What residuals say of the scatter of ln p_m. values : (n,), rising and evenly spaced; weights : (n,), with sum one."""

    values: FloatArray
    weights: FloatArray

    @property
    def mean(self) -> float:
        return float(self.values @ self.weights)

    @property
    def sd(self) -> float:
        return float(np.sqrt((self.values - self.mean) ** 2 @ self.weights))

    def summarise(self) -> dict[str, float]:
        """Mean, standard deviation and quantiles, as of every parameter."""
        below = np.cumsum(self.weights)
        quantiles = {name: float(np.interp(q, below, self.values)) for name, q in QUANTILES.items()}
        return {"mean": self.mean, "sd": self.sd, **quantiles}


def estimate_scatter(problem: Problem, fit: Fit) -> ScatterEstimate:
    """Scatter of ln p_m between samples by restricted maximum likelihood, with a flat prior.

    The likelihood is evaluated on a ladder of scatters with everything else as fitted; the drops' offsets enter through the
    tangent of ln p_m.
    """
    drops = fit.drops
    tangent = drops.tangents["ln_p_m"]
    used = problem.budget.scatter
    offsets = np.zeros((len(tangent), len(problem.tracks.samples)))  # one sample's, by columns
    for column, records in zip(offsets.T, problem.tracks.samples.values(), strict=True):
        for name in records:
            column[drops.sections[name]] = tangent[drops.sections[name]]
    together = offsets @ offsets.T
    value = []
    for scatter in LADDER:
        covariance = drops.covariance + (scatter**2 - used**2) * together
        lower = np.linalg.cholesky(covariance)
        white = solve_triangular(lower, np.stack([drops.residual, tangent], axis=1), lower=True)
        information = white[:, 1] @ white[:, 1]
        left = white[:, 0] - white[:, 1] * (white[:, 1] @ white[:, 0]) / information
        value.append(-0.5 * (left @ left) - np.sum(np.log(np.diag(lower))) - 0.5 * math.log(information))
    fine = np.linspace(LADDER[0], LADDER[-1], 4000)
    log_density = CubicSpline(np.log(LADDER), value)(np.log(fine))
    density = np.exp(log_density - np.max(log_density))
    return ScatterEstimate(fine, density / np.sum(density))


def weigh_least(value: float) -> Scatter:
    """The least scatter: stands for all up to where another is told apart from it."""
    return Scatter(value, float(halfnorm.logcdf(APART * value, scale=WIDTH)))


def find_scatter(problem: Problem, fit: Fit) -> Scatter:
    """What the residuals of a fit ask for: their mean, which stands for every scatter, by prior and likelihood."""
    found = estimate_scatter(problem, fit)
    step = found.values[1] - found.values[0]
    likelihood = found.weights / np.interp(found.mean, found.values, found.weights)
    prior = halfnorm.pdf(found.values, scale=WIDTH)
    return Scatter(found.mean, math.log(step * (likelihood @ prior)))


def find_larger(least: Scatter, problem: Problem, fit: Fit) -> Scatter | None:
    """The scatter that a fit asks for, where it is told apart from the least one and no other is stated. Where its range stops
    p_m all samples ask for another, which is no scatter."""
    if problem.campaign.sample.scatter is not None or is_stopped(problem, fit):
        return None
    asked = find_scatter(problem, fit)
    return asked if asked.value > APART * least.value else None


def fit_with(scatter: Scatter, problem: Problem, fit: Fit) -> tuple[Problem, Fit]:
    """The same hypothesis with another scatter in the likelihood, and the problem with it."""
    other = replace(problem, budget=replace(problem.budget, scatter=scatter.value))
    start = fit.log_p_m, fit.values
    return other, fit_hypothesis(other, fit.hypothesis, start, nuisances=fit)


def allow_scatter(problem: Problem, fit: Fit) -> tuple[Problem, Fit, Scatter | None]:
    """The fit with the least scatter or, where it has more evidence so, with the larger one that it asks for: the third then."""
    least = weigh_least(problem.budget.scatter)
    asked = find_larger(least, problem, fit)
    if asked is not None:
        wider, loose = fit_with(asked, problem, fit)
        if asked.log_prior + loose.evidence > least.log_prior + fit.evidence:
            return wider, loose, asked
    return problem, fit, None


def set_error_budget(campaign: Campaign) -> ErrorBudget:
    """The error terms, with the scatter of ln p_m that the campaign states, or else the least."""
    stated = campaign.sample.scatter
    return ErrorBudget() if stated is None else replace(ErrorBudget(), scatter=stated)
