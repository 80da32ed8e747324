"""Integrals of Gaussians that limits cut."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear
from scipy.special import log_ndtr

from ...records import FloatArray
from ..problem import Problem
from .steps import Solved, stop_at_limits

MOST_CUT = 1.0 - 1e-12  # of a Gaussian, by two limits closer than rounding


def integrate_by_laplace(problem: Problem, here: Solved) -> float:
    """ln evidence by Laplace's formula, where a limit cuts the Gaussian, or its top, off too."""
    place, covariance = here.place, here.covariance
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    evidence = here.log_likelihood + 0.5 * len(covariance) * math.log(2 * math.pi)
    evidence += 0.5 * np.linalg.slogdet(covariance)[1] - math.log(high - low)
    limits = [(low - place.log_p_m, high - place.log_p_m)]
    for name, value in place.values.items():
        parameter = problem.effects[name].amplitudes[0]
        least, most = parameter.limits
        limits.append((least - parameter.null - value, most - parameter.null - value))
        evidence += float(parameter.log_prior(parameter.hold(value))) + problem.shape_evidence.get(name, 0.0)
    step, stopped = stop_at_limits(problem, here)
    for k, between in enumerate(limits):
        sigma = math.sqrt(covariance[k, k])
        if k in stopped:
            # the others are at their best with it: all that the top beyond gains is gained along this one
            step[k] = here.step[k]
            evidence += 0.5 * (step[k] / sigma) ** 2
        evidence += log_share_inside(*between, step[k], sigma)
    return float(evidence)


def log_share_inside(low: float, high: float, mean: float, sigma: float) -> float:
    """ln of the share of a Gaussian between two limits: what is left of an integral that a flat prior ends at."""
    below, above = (low - mean) / sigma, (high - mean) / sigma
    if below > 0.0:  # the other tail, where shares do not round to 1
        below, above = -above, -below
    return float(log_ndtr(above) + math.log1p(-min(math.exp(log_ndtr(below) - log_ndtr(above)), MOST_CUT)))


def cut_gaussian(low: float, high: float, mean: float, sigma: float) -> tuple[float, float, float]:
    """ln of the share of a Gaussian between two limits, and what lies there: (its mean - the whole one's)/σ, its variance/σ²."""
    below, above = (low - mean) / sigma, (high - mean) / sigma
    log_share = log_share_inside(low, high, mean, sigma)
    norm = log_share + 0.5 * math.log(2.0 * math.pi)
    left, right = (math.exp(-0.5 * limit * limit - norm) for limit in (below, above))
    first = left - right
    return log_share, first, max(1.0 + left * (below - first) - right * (above - first), 0.0)


def integrate_linear(design: FloatArray, data: FloatArray, limits: Sequence[tuple[float, float]]) -> float:
    """ln of the integral of exp(-χ²/2), χ² = |data - design x|², over x between limits, about its top there.

    What a limit stops falls off from it, the others at their best with it; exact where one limit cuts alone.
    """
    low, high = np.transpose(limits)
    found = lsq_linear(design, data, (low, high), method="bvls")
    top, held = found.x, found.active_mask != 0
    left = data - design @ top
    information, gradient = design.T @ design, design.T @ left
    covariance = np.linalg.inv(information[np.ix_(~held, ~held)])
    across = information[np.ix_(held, ~held)]
    precision = np.diag(information[np.ix_(held, held)] - across @ covariance @ across.T)
    sigma, mean = np.zeros(len(top)), np.zeros(len(top))
    sigma[~held] = np.sqrt(np.diag(covariance))
    sigma[held] = 1.0 / np.sqrt(precision)
    mean[held] = gradient[held] / precision
    total = 0.5 * (np.linalg.slogdet(covariance)[1] - np.sum(np.log(precision)) - left @ left)
    total += 0.5 * len(top) * math.log(2 * math.pi) + 0.5 * np.sum((mean / sigma) ** 2)
    return float(total + sum(map(log_share_inside, low - top, high - top, mean, sigma)))
