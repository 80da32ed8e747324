"""How much the dust differs from sample to sample is not known beforehand: drops that scatter are no cause.

A campaign is judged with the least scatter of ln p_m that any dust has (Terms.scatter) or, where the nominal model with a
larger one explains more than anything may with the least, with that (restricted maximum likelihood, Patterson & Thompson 1971).
Both have the prior probability of what they stand for, half of a normal distribution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.stats import halfnorm

from ..inference.calibrate import estimate_scatter
from ..inference.fitting import Fit
from ..inference.workbench import Workbench

WIDTH = 0.05  # of the prior of the scatter of ln p_m, half-normal: sieved dust of one batch 2 %, poured soils 10 %
APART = 1.5  # ratio of two scatters that are told apart


@dataclass(frozen=True)
class Scatter:
    """One value of the scatter of ln p_m, and ln of the prior probability of what it stands for."""

    value: float
    log_prior: float


def weigh_least(value: float) -> Scatter:
    """The least scatter: stands for all up to where another is told apart from it."""
    return Scatter(value, float(halfnorm.logcdf(APART * value, scale=WIDTH)))


def find_scatter(bench: Workbench, fit: Fit) -> Scatter:
    """What the residuals of a fit ask for. The prior's density times the width of what the drops leave open of it."""
    mean, sigma = estimate_scatter(bench, fit)
    width = math.sqrt(2.0 * math.pi) * sigma
    return Scatter(mean, float(halfnorm.logpdf(mean, scale=WIDTH)) + math.log(width))


def find_larger(least: Scatter, bench: Workbench, fit: Fit) -> Scatter | None:
    """The scatter that a fit asks for, where it is told apart from the least one."""
    asked = find_scatter(bench, fit)
    return asked if asked.value > APART * least.value else None
