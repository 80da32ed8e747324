"""The posterior about a fit as a function that is quick to evaluate."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...calibrated import name_column
from ...effects import Parameter
from ...records import FloatArray
from ..observations.acceleration_model import AccelerationModel
from ..problem import Problem
from .blocks import whiten_all
from .fitting import Fit, is_stopped, keep_strengths
from .posterior import QuadraticResidual, measure_residual
from .tangents import linearise_at


@dataclass(frozen=True)
class Target:
    """The posterior about a fit, up to a constant. names : p_m_Pa (of another law what is calibrated of it) and
    EFFECT.PARAMETER; a point is (ln p_m, amplitudes).

    misfit : (m, d) -> (m,) half the squared whitened residual; log_prior : the same shapes; bounds : (d, 2) of the prior;
    sizes : of ln p_m, what is gained on it by not knowing how large the solver's error is.
    """

    names: tuple[str, ...]
    nulls: tuple[float, ...]
    parameters: tuple[Parameter, ...]
    misfit: QuadraticResidual
    bounds: FloatArray
    sizes: Callable[[FloatArray], FloatArray] | None = None

    def log_prior(self, theta: FloatArray) -> FloatArray:
        low, high = self.bounds[0]
        inside = (theta[:, 0] >= low) & (theta[:, 0] <= high)
        total = np.where(inside, -math.log(high - low), -np.inf)
        for k, parameter in enumerate(self.parameters, start=1):
            total = total + parameter.log_prior(parameter.null + theta[:, k])
        return total

    def log_probability(self, theta: FloatArray) -> FloatArray:
        found = self.log_prior(theta) - self.misfit(theta)
        return found if self.sizes is None else found + self.sizes(theta[:, 0])

    def transform(self, name: str, values: FloatArray) -> FloatArray:
        """Points as they are reported."""
        k = self.names.index(name)
        return np.exp(values) if k == 0 else self.nulls[k - 1] + values


def make_target(problem: Problem, fit: Fit) -> Target:
    """Flat prior in ln p_m, the effects' own priors, the covariance of the fit."""
    parameters = tuple(problem.effects[name].amplitudes[0] for name in fit.hypothesis)
    names = (
        name_column(problem.campaign.material.law),
        *(f"{n}.{p.name}" for n, p in zip(fit.hypothesis, parameters, strict=True)),
    )
    centre = np.array([fit.log_p_m, *(fit.values[name] for name in fit.hypothesis)])

    def miss(theta: FloatArray) -> FloatArray:
        values = dict(zip(fit.hypothesis, theta[1:], strict=True))
        blocks = linearise_at(problem, keep_strengths(problem, fit, float(theta[0])), float(theta[0]), values)
        return np.concatenate(
            [fitted.whiten(block.residual) for fitted, block in zip(fit.blocks, blocks, strict=True)]
        )

    bounds = [[math.log(p) for p in problem.campaign.p_m_range]]
    bounds += [[limit - parameter.null for limit in parameter.limits] for parameter in parameters]
    nulls = tuple(parameter.null for parameter in parameters)
    # accelerations of runs at two p_m differ by the noise of their particles too, which a secant takes for what p_m changes and
    # the solver's error of p_m, which lies along the tangent at the fit, does not cover. And where a prior's end stops a fit,
    # chains run along that end far from where the residual is small, and a parabola would turn round there
    if is_stopped(problem, fit) or any(
        isinstance(model, AccelerationModel) for model in problem.tracks.models
    ):
        white = whiten_all(fit.blocks, ["ln_p_m", *fit.hypothesis])
        misfit = measure_residual(
            lambda theta: white[:, 0] - white[:, 1:] @ (theta - centre), centre, fit.covariance
        )
    else:
        misfit = measure_residual(miss, centre, fit.covariance)
    return Target(names, nulls, parameters, misfit, np.array(bounds))
