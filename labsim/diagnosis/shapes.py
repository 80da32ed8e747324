"""Shape parameters of effects: numbers that do not matter while the amplitude is null, such as the length of a crust.

Where undisturbed dust in the scans shows the shape, it is taken from there before anything is simulated. Otherwise the effect
is tried at three quantiles of the shape's prior, as three variants of one cause: their evidences are averaged, and the best of
them stands for the cause.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from ..effects import Effect, Parameter
from ..inference.fits.blocks import solve_globals
from ..inference.fits.fitting import Fit
from ..inference.fits.tangents import linearise_alone
from ..inference.problem import Problem
from .screen import Screening

QUANTILES = (1 / 6, 5 / 6)  # with the stated value, the thirds of the prior
CLEAR = 16.0  # drop of χ² from which undisturbed dust decides a shape
MARK = "@"


def shape_parameter(effect: Effect) -> Parameter | None:
    return next((parameter for parameter in effect.parameters if parameter.shape), None)


def lay_out_shapes(problem: Problem) -> None:
    """Settle shapes from the undisturbed dust, add variants of the others to the problem's effects."""
    for name, effect in list(problem.effects.items()):
        parameter = shape_parameter(effect)
        if parameter is None or not effect.amplitudes:
            continue
        if _shows_in_dust(problem, name):
            _settle(problem, name, parameter)
            continue
        low, high = (float(parameter.prior.cdf(limit)) for limit in parameter.limits)
        for quantile in QUANTILES:
            value = float(f"{float(parameter.prior.ppf(low + (high - low) * quantile)):.2g}")
            problem.effects[f"{name}{MARK}{value:g}"] = effect.with_shape(value)


def cause(name: str) -> str:
    """The name of the cause that a variant stands for."""
    return name.split(MARK)[0]


def _shows_in_dust(problem: Problem, name: str) -> bool:
    dust = problem.layering
    if dust is None:
        return False
    block = linearise_alone(problem, dust, {}, {name: problem.effects[name].amplitudes[0].step})
    return bool(np.any(block.tangents[name] != 0.0))


def _settle(problem: Problem, name: str, parameter: Parameter) -> None:
    """Best shape by the undisturbed dust alone, with its amplitude free; its prior's price goes to shape_evidence."""
    effect, dust = problem.effects[name], problem.layering
    assert dust is not None
    width = effect.amplitudes[0].scale

    def cost(log_shape: float) -> float:
        problem.effects[name] = effect.with_shape(math.exp(log_shape))
        block = linearise_alone(problem, dust, {}, {name: 0.05 * effect.amplitudes[0].step})
        _step, _cov, chi, _det, _w = solve_globals([block], [name], {name: (0.0, width)})
        return chi - 2 * float(parameter.log_prior(math.exp(log_shape)))

    plain = linearise_alone(problem, dust, {}, {}).chi_square
    low, high = (math.log(max(limit, 1e-12)) for limit in parameter.limits)
    grid = np.linspace(low, high, 25)[1:-1]
    values = [cost(x) for x in grid]
    k = int(np.argmin(values))
    best = minimize_scalar(
        cost, bounds=(grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]), method="bounded"
    )
    drop = plain - (best.fun + 2 * float(parameter.log_prior(math.exp(best.x))))
    if drop < CLEAR:
        problem.effects[name] = effect
        return
    step = 0.02
    curvature = (cost(best.x + step) + cost(best.x - step) - 2 * best.fun) / step**2 / 2
    sigma = math.exp(best.x) / math.sqrt(max(curvature, 1.0))
    price = float(parameter.log_prior(math.exp(best.x))) + 0.5 * math.log(2 * math.pi) + math.log(sigma)
    problem.effects[name] = effect.with_shape(float(f"{math.exp(best.x):.3g}"))
    problem.shape_evidence[name] = min(price, 0.0)


def merge_variants(
    problem: Problem,
    nominal: Fit,
    fits: Sequence[Fit],
    screening: Screening,
    explored: Mapping[str, Fit],
) -> tuple[list[Fit], Screening]:
    """One fit and one score per cause. The best variant takes the cause's name in the problem; evidences are averaged."""
    fitted = {fit.hypothesis[0]: fit for fit in fits}
    scores = {score.name: score for score in screening.scores}
    groups: dict[str, list[str]] = {}
    for name in scores:
        groups.setdefault(cause(name), []).append(name)
    merged, kept = [], []
    for base, variants in groups.items():
        evidence = {
            name: _evidence(name, fitted, explored, nominal, scores[name].log_bayes) for name in variants
        }
        top = max(evidence.values())
        mean = top + math.log(sum(math.exp(e - top) for e in evidence.values()) / len(variants))
        candidates = [name for name in variants if name in fitted] or variants
        best = max(candidates, key=lambda name: evidence[name])
        kept.append((best, base, mean - nominal.evidence))
        if best != base:
            _take_name(problem, best, base)
        if best in fitted:
            over = weigh_shapes([fitted[name] for name in variants if name in fitted], fitted[best])
            merged.append(replace(_rename(fitted[best], best, base), evidence=mean, over_shapes=over))
        for name in variants:
            if name != base:
                problem.effects.pop(name, None)
    chosen = {best: (base, log_bayes) for best, base, log_bayes in kept}
    positions = [k for k, name in enumerate(screening.names) if name in chosen]
    return merged, replace(
        screening,
        scores=sorted(
            (
                replace(scores[best], name=base, log_bayes=log_bayes)
                for best, (base, log_bayes) in chosen.items()
            ),
            key=lambda score: -score.log_bayes,
        ),
        names=[chosen[screening.names[k]][0] for k in positions],
        cosines=screening.cosines[np.ix_(positions, positions)],
        fingerprints=screening.fingerprints[:, positions],
        traded=screening.traded[positions],
    )


def weigh_shapes(variants: Sequence[Fit], best: Fit) -> tuple[float, float]:
    """Of ln p_m over variants by their evidence: mean minus the best one's, and standard deviation."""
    log_p_m = np.array([fit.log_p_m for fit in variants])
    weight = np.exp([fit.evidence - best.evidence for fit in variants])
    mean = float(np.average(log_p_m, weights=weight))
    return mean - best.log_p_m, math.sqrt(float(np.average((log_p_m - mean) ** 2, weights=weight)))


def _evidence(
    name: str, fitted: Mapping[str, Fit], explored: Mapping[str, Fit], nominal: Fit, log_bayes: float
) -> float:
    """The best that is known: of a fit with its own runs, of one on fingerprints, of the tangent."""
    for fits in (fitted, explored):
        if name in fits:
            return fits[name].evidence
    return nominal.evidence + log_bayes


def _take_name(problem: Problem, variant: str, base: str) -> None:
    problem.effects[base] = problem.effects[variant]
    for each in problem.features:
        for kept in each.table.kinds:
            kept.pop(base, None)
            if variant in kept:
                kept[base] = kept.pop(variant)
    problem.renamed[base] = variant


def _rename(fit: Fit, before: str, after: str) -> Fit:
    def rename(table: Mapping) -> dict:
        return {after if key == before else key: value for key, value in table.items()}

    blocks = tuple(replace(block, tangents=rename(block.tangents)) for block in fit.blocks)
    return replace(fit, hypothesis=(after,), values=rename(fit.values), blocks=blocks)
