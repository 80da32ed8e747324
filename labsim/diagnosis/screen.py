"""Which effects could explain what the nominal fit leaves? Score tests on whitened, projected tangents.

Input: a Problem and the nominal Fit. Output: a Screening with, for every effect, how far its fingerprint (the tangent after
ln p_m and all nuisances are taken out) lies along the residual, what amplitude that asks for, and how alike the
fingerprints are. Formulas: docs/diagnosis-method.md; Rao's score test, linear Gaussian Bayes factor, where ln p_m ends with its
range and amplitudes with their limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..inference.fits.blocks import whiten_all
from ..inference.fits.evidence import integrate_linear, log_share_inside
from ..inference.fits.fitting import Fit, with_perturbations
from ..inference.problem import Problem
from ..records import FloatArray

DRAWS = 20_000
SPARE = 20  # draws for one inside all limits
CONFUSABLE = 0.9  # cosine of fingerprints
CLOSE = 30.0  # ln Bayes factors within which a screened effect is re-simulated
NARROW = 15.0  # the same between hypotheses whose order more runs may change
HALF = 0.5  # of the best gain, if that is less than CLOSE asks: large effects are not what screening or fingerprints say


@dataclass(frozen=True)
class Score:
    """One effect about null. score : standard normal under the nominal model; signal : length of the fingerprint per unit
    amplitude; amplitude : what the score asks for; log_bayes : ln Bayes factor against the nominal model, linear."""

    name: str
    score: float
    signal: float
    amplitude: float
    log_bayes: float


@dataclass(frozen=True)
class Screening:
    """scores, best first; cosines : (k, k) between fingerprints in the order of ``names``; p_value of the largest score;
    residual, fingerprints : whitened, projected.

    log_p_m : of the fit; step : how far the data want it from there, were it free, with standard deviation sigma; traded : (k,)
    of that step, per unit of each amplitude.
    """

    scores: list[Score]
    names: list[str]
    cosines: FloatArray
    p_value: float
    residual: FloatArray
    fingerprints: FloatArray
    log_p_m: float
    step: float
    sigma: float
    traded: FloatArray


def screen(problem: Problem, fit: Fit, rng: np.random.Generator, names: list[str] | None = None) -> Screening:
    """Tangents of all effects at the nominal fit (runs at one amplitude and one p_m each) and their scores."""
    names = [name for name in (names or problem.effects) if problem.effects[name].amplitudes]
    simulated = [name for name in names if problem.affects_simulation(name)]
    problem.require_fingerprints(simulated, fit.log_p_m, "what each cause changes")
    names = [name for name in names if name not in simulated or has_runs(problem, name)]
    whitened = whiten_all(with_perturbations(problem, fit, names), ["ln_p_m", *names])
    sigma = 1.0 / float(np.linalg.norm(whitened[:, 1]))
    direction = whitened[:, 1] * sigma
    along = direction @ whitened
    projected = whitened - np.outer(direction, along)
    residual, fingerprints, traded = projected[:, 0], projected[:, 2:], sigma * along[2:]
    lengths = np.linalg.norm(fingerprints, axis=0)
    usable = lengths > 1e-9
    names = [name for name, ok in zip(names, usable, strict=True) if ok]
    fingerprints, lengths, traded = fingerprints[:, usable], lengths[usable], traded[usable]
    unit = fingerprints / lengths
    z = unit.T @ residual
    cosines = unit.T @ unit
    largest = float(np.max(z**2)) if len(z) else 0.0
    root = np.linalg.cholesky(cosines + 1e-9 * np.eye(len(z)))
    null = np.max((rng.standard_normal((DRAWS, len(z))) @ root.T) ** 2, axis=1)
    p_value = float((np.sum(null >= largest) + 1) / (DRAWS + 1))
    found = Screening(
        [],
        names,
        cosines,
        p_value,
        residual,
        fingerprints,
        fit.log_p_m,
        sigma * float(along[0]),
        sigma,
        traded,
    )
    scores = []
    for k, name in enumerate(names):
        log_bayes = compare_linear(problem, found, [k]) + problem.shape_evidence.get(name, 0.0)
        scores.append(Score(name, float(z[k]), float(lengths[k]), float(z[k] / lengths[k]), log_bayes))
    return replace(found, scores=sorted(scores, key=lambda score: -score.log_bayes))


def compare_linear(problem: Problem, screening: Screening, chosen: Sequence[int]) -> float:
    """ln Bayes factor of the chosen effects, by their places in ``names``, against the nominal model, all of them linear.

    Both are integrated over ln p_m inside its range and over amplitudes inside their limits: a nominal fit that its range stops
    is as bad as it is there, and what asks for an amplitude that cannot be explains nothing.
    """
    rows, (strengths, *limits) = _lay_out(problem, screening, chosen)
    data = len(rows) - len(limits)
    nominal = integrate_linear(rows[:data, 1:2], rows[:data, 0], [strengths])
    extended = integrate_linear(rows[:, 1:], rows[:, 0], [strengths, *limits])
    cut = sum(log_share_inside(*between, 0.0, 1.0) for between in limits)  # of the priors
    return extended - nominal - cut - 0.5 * len(limits) * math.log(2 * math.pi)


def draw_strengths(
    problem: Problem, screening: Screening, name: str, count: int, rng: np.random.Generator
) -> FloatArray:
    """Draws (count,) of ln p_m with one effect beside it, linear, inside the range of p_m and the effect's limits."""
    rows, limits = _lay_out(problem, screening, [screening.names.index(name)])
    information = rows[:, 1:].T @ rows[:, 1:]
    covariance = np.linalg.inv(information)
    drawn = rng.multivariate_normal(covariance @ rows[:, 1:].T @ rows[:, 0], covariance, SPARE * count)
    low, high = np.transpose(limits)
    inside = drawn[np.all((drawn > low) & (drawn < high), axis=1)]
    if len(inside) < count:  # limits cut nearly all of it off: it lies at them
        inside = np.clip(drawn, low, high)
    return screening.log_p_m + inside[:count, 0]


def _lay_out(
    problem: Problem, screening: Screening, chosen: Sequence[int]
) -> tuple[FloatArray, list[tuple[float, float]]]:
    """Data, tangents of ln p_m and of amplitudes in units of their priors, (n, 2 + chosen), whitened, with a row of its prior
    for each amplitude at the end; and the limits of ln p_m, from the fit's, and of the amplitudes."""
    place = list(chosen)
    parameters = [problem.effects[screening.names[k]].amplitudes[0] for k in place]
    limits = [
        ((each.limits[0] - each.null) / each.scale, (each.limits[1] - each.null) / each.scale)
        for each in parameters
    ]
    low, high = (math.log(p) - screening.log_p_m for p in problem.campaign.p_m_range)
    widths = [each.scale for each in parameters]
    # the first row is all that lies along the tangent of ln p_m
    along = np.concatenate([[screening.step, 1.0], screening.traded[place] * widths]) / screening.sigma
    beside = [
        screening.residual,
        np.zeros(len(screening.residual)),
        screening.fingerprints[:, place] * widths,
    ]
    return np.vstack([along, np.column_stack(beside), np.eye(2 + len(place))[2:]]), [(low, high), *limits]


def screen_pairs(problem: Problem, screening: Screening) -> list[tuple[tuple[str, str], float]]:
    """ln Bayes factors of all pairs against the nominal model, linear, best first."""
    found = [
        ((first, screening.names[j]), compare_linear(problem, screening, (i, j)))
        for i, first in enumerate(screening.names)
        for j in range(i + 1, len(screening.names))
    ]
    return sorted(found, key=lambda item: -item[1])


def has_runs(problem: Problem, name: str) -> bool:
    """Whether an effect's runs gave every projectile something to compare."""
    return all(each.table.knows(name) for each in problem.features)


def list_confusable(screening: Screening) -> list[tuple[str, str, float]]:
    """Pairs whose fingerprints are nearly parallel in this campaign, known before any data are looked at."""
    found = []
    for i, first in enumerate(screening.names):
        for j in range(i + 1, len(screening.names)):
            cosine = float(screening.cosines[i, j])
            if abs(cosine) > CONFUSABLE:
                found.append((first, screening.names[j], cosine))
    return sorted(found, key=lambda item: -abs(item[2]))
