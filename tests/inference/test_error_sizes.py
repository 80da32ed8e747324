"""The size of the solver's error integrated over: against an independent integral."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from labsim.effects import Normal, Parameter
from labsim.inference.fits import error_sizes
from labsim.inference.fits.blocks import Block
from labsim.inference.observations.linearised_drop import ErrorBudget

MIDDLE, NOISE, POINTS = math.log(1200.0), 0.01, 40
PARAMETER = Parameter("amount", "1", 0.0, (-10.0, 10.0), Normal(0.0, 2.0), 1.0, "of a test")


@dataclass
class Bench:
    budget: ErrorBudget


def residual(log_p_m, amplitude):
    """One mode that p_m and the effect share, another that only the effect moves."""
    x = np.linspace(-1, 1, POINTS)
    return 0.02 * np.cos(9 * x) - 0.3 * (log_p_m - MIDDLE + amplitude - 0.5) - 0.05 * (amplitude - 0.5) * x


def covariance(budget, amplitude):
    x = np.linspace(-1, 1, POINTS)
    alike = np.exp(-0.5 * (np.subtract.outer(x, x) / 0.3) ** 2)
    return NOISE**2 * np.eye(POINTS) + (budget.numerical_change * amplitude) ** 2 * alike


def misfit(theta):
    """The covariance held at an amplitude of 0.5, as about a fit."""
    lower = np.linalg.cholesky(covariance(ErrorBudget(), 0.5))
    return np.array([0.5 * np.sum(np.linalg.solve(lower, residual(*point)) ** 2) for point in theta])


def surrogate(theta):
    return PARAMETER.log_prior(theta[:, 1]) - misfit(theta)


def by_quadrature(log_p_m, amplitude):
    def density(size):
        c = covariance(
            ErrorBudget(numerical_change=ErrorBudget().numerical_change * math.exp(size)), amplitude
        )
        r = residual(log_p_m, amplitude)
        value = -0.5 * (r @ np.linalg.solve(c, r) + np.linalg.slogdet(c)[1])
        return math.exp(value - 150.0 - 0.5 * (size / math.log(2.0)) ** 2)

    return math.log(quad(density, -1.5, 1.5, epsrel=1e-8)[0]) + float(PARAMETER.log_prior(amplitude))


def test_the_gain_is_that_of_the_integral_over_sizes(monkeypatch):
    def linearise(problem, nuisances, log_p_m, values, further=()):
        amplitude = values["effect"]
        return (Block(residual(log_p_m, amplitude), covariance(problem.budget, amplitude), {}),)

    monkeypatch.setattr(error_sizes, "linearise_at", linearise)
    monkeypatch.setattr(error_sizes, "keep_strengths", lambda problem, fit, log_p_m: ())
    fit = SimpleNamespace(
        hypothesis=("effect",),
        log_p_m=MIDDLE,
        values={"effect": 0.5},
        covariance=np.array([[0.05**2, -0.9 * 0.05 * 0.06], [-0.9 * 0.05 * 0.06, 0.06**2]]),
        nuisances=(),
    )
    bounds = np.array([np.log([300.0, 6000.0]), PARAMETER.limits])
    target = SimpleNamespace(log_probability=surrogate, misfit=misfit, bounds=bounds)
    gained = error_sizes.integrate_sizes(Bench(ErrorBudget()), fit, target)
    assert float(gained(np.array([MIDDLE]))[0]) == pytest.approx(0.0, abs=1e-9)
    near = np.linspace(0.1, 0.9, 8001)

    def best(log_p_m):
        points = np.column_stack([np.full(near.size, log_p_m), near])
        lost = np.array([float(v) for v in surrogate(points[::2])])
        amplitude = points[::2][int(np.argmax(lost)), 1]
        return amplitude, float(lost.max())

    base, lost = best(MIDDLE)
    at_fit = by_quadrature(MIDDLE, base) - lost
    largest = 0.0
    for away in (-0.1, 0.1, 0.2):
        amplitude, lost = best(MIDDLE + away)
        expected = by_quadrature(MIDDLE + away, amplitude) - lost - at_fit
        assert float(gained(np.array([MIDDLE + away]))[0]) == pytest.approx(expected, abs=0.1)
        largest = max(largest, abs(expected))
    assert largest > 0.5  # there is something to gain
