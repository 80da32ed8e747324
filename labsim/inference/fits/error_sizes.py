"""How large the solver's error of what an effect changes is, is not known: it is integrated over.

Codes differ by some share of what an effect changes (ErrorBudget.numerical_change, zone_change), in some campaigns by half of
it, in others by twice. Held at one size, that error tells of the parameters: where p_m and an effect make up for each other the
change grows along them, so does the error, and the data ask for as much change as brings the error that they show. With ln of
the size normal about the stated one, SPREAD wide, the same likelihood asks for another size instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize
from scipy.special import logsumexp

from ...records import FloatArray
from ..problem import Problem
from .blocks import Block
from .fitting import Fit, keep_strengths
from .tangents import linearise_at
from .target import Target

SPREAD = math.log(2.0)
SIZES = np.linspace(-1.5, 1.5, 7)  # ln of sizes over the stated ones
PLACES = np.linspace(-6.0, 6.0, 7)  # of ln p_m, in standard deviations of the fit


def integrate_sizes(problem: Problem, fit: Fit, target: Target) -> Callable[[FloatArray], FloatArray]:
    """What the posterior over sizes gains on ``target``, as a function of ln p_m, (m,) -> (m,).

    Measured where the amplitudes are at their best at each p_m, nought at the fit.
    """
    (low, high), *limits = target.bounds
    places = np.unique(np.clip(fit.log_p_m + PLACES * math.sqrt(fit.covariance[0, 0]), low, high))
    if len(places) < 2:
        return np.zeros_like
    best = np.array([fit.values[name] for name in fit.hypothesis])
    along = fit.covariance[1:, 0] / fit.covariance[0, 0]
    sigma = np.sqrt(np.diag(fit.covariance)[1:])
    options = {
        "xatol": 1e-2,
        "fatol": 1e-2,
        "initial_simplex": np.vstack([np.zeros(best.size), np.eye(best.size)]),
    }
    gained = []
    for place in places:
        near = np.clip(best + along * (place - fit.log_p_m), *np.transpose(limits))

        def lost(u: FloatArray, place: float = place, near: FloatArray = near) -> float:
            value = float(target.log_probability(np.array([[place, *(near + sigma * u)]]))[0])
            return -value if math.isfinite(value) else 1e30

        found = minimize(lost, np.zeros(best.size), method="Nelder-Mead", options=options)
        amplitudes = near + sigma * found.x
        kept = -float(target.misfit(np.array([[place, *amplitudes]]))[0])
        values = dict(zip(fit.hypothesis, amplitudes, strict=True))
        gained.append(_integrate_likelihood(problem, fit, float(place), values) - kept)
    curve = CubicSpline(places, gained)
    here = float(curve(np.clip(fit.log_p_m, low, high)))
    return lambda at: np.asarray(curve(np.clip(at, places[0], places[-1])) - here)


def _integrate_likelihood(problem: Problem, fit: Fit, log_p_m: float, amplitudes: dict[str, float]) -> float:
    """ln likelihood, over all sizes of the drops' error and, on its own, of the maps'; up to a constant."""
    drops, maps, nuisances = [], [], keep_strengths(problem, fit, log_p_m)
    for size in SIZES:
        budget = replace(
            problem.budget,
            numerical_change=problem.budget.numerical_change * math.exp(size),
            zone_change=problem.budget.zone_change * math.exp(size),
        )
        blocks = linearise_at(replace(problem, budget=budget), nuisances, log_p_m, amplitudes)
        drops.append(_log_likelihood(blocks[:1]))
        maps.append(_log_likelihood(blocks[1:]))
    return _over_sizes(drops) + _over_sizes(maps)


def _over_sizes(log_likelihood: Sequence[float]) -> float:
    """ln of the integral over sizes, up to a constant; between those tried the ln likelihood is smooth."""
    fine = np.linspace(SIZES[0], SIZES[-1], 121)
    return float(logsumexp(CubicSpline(SIZES, log_likelihood)(fine) - 0.5 * (fine / SPREAD) ** 2))


def _log_likelihood(blocks: Sequence[Block]) -> float:
    """Up to a constant."""
    return -0.5 * sum(block.chi_square + block.log_determinant for block in blocks)
