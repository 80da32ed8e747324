"""What an extension is worth on drops that no fit has seen: each drop is held out once.

The held-out drop's own free fall gives its contact and speed; its motion in the dust is predicted from the other
drops. Everything is the linear Gaussian algebra of the likelihood about the fitted point: holding out costs no runs. Where a fit
bends, hold_out_folds repeats it without the drops.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve

from ..inference.fits.blocks import Block
from ..inference.fits.fitting import Fit, fit_hypothesis
from ..inference.problem import Problem
from ..records import FloatArray

DRAWS = 4000  # of the null law
FOLDS = 5


@dataclass(frozen=True)
class HeldOut:
    """Per drop, or some that were held out together: rms of the prediction (m), rms that is expected of a true model (m), ln
    score, number of data. by_record : rms (m) of every record by its name, those too that were held out with others."""

    names: tuple[str, ...]
    rms: FloatArray
    expected: FloatArray
    log_score: FloatArray
    count: FloatArray
    by_record: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Gain:
    rms_nominal: float  # m
    rms_extended: float
    rms_noise: float
    log_score_difference: float
    log_score_difference_sigma: float
    fraction_removed: float


@dataclass(frozen=True)
class Unseen:
    """Rows that no fit has seen: errors of their prediction are linear in the data. held, seen : (n,) which; design : (n, k) of
    all."""

    held: np.ndarray
    seen: np.ndarray
    design: FloatArray
    solved: FloatArray  # C⁻¹ times the design of what is seen
    weights: FloatArray  # (held, seen) of their own errors that the others tell
    covariance: FloatArray  # (k, k) of the globals without them
    spread: FloatArray  # (held, held) of their prediction

    def miss(self, residual: FloatArray, pull: FloatArray) -> FloatArray:
        """Data minus prediction, (held, ...), for residuals (n, ...) and what scans and priors say of the globals, (k, ...)."""
        best = self.covariance @ (self.solved.T @ residual[self.seen] + pull)
        left = residual[self.seen] - self.design[self.seen] @ best
        return residual[self.held] - self.design[self.held] @ best - self.weights @ left


def predict_unseen(
    held: np.ndarray, design: FloatArray, covariance: FloatArray, precision: FloatArray
) -> Unseen:
    """held : (n,) bool; design : (n, k); covariance : (n, n) of all errors; precision : (k, k), what else is known of the
    globals."""
    seen = ~held
    cross = covariance[np.ix_(held, seen)]
    both = np.hstack([design[seen], cross.T])
    if seen.any():
        both = cho_solve(cho_factor(covariance[np.ix_(seen, seen)], lower=True), both)
    solved, weights = both[:, : design.shape[1]], both[:, design.shape[1] :].T
    of_globals = np.linalg.inv(design[seen].T @ solved + precision)
    reach = design[held] - cross @ solved
    spread = covariance[np.ix_(held, held)] - weights @ cross.T + reach @ of_globals @ reach.T
    return Unseen(held, seen, design, solved, weights, of_globals, spread)


def _hold_out(
    problem: Problem, fit: Fit, known: bool, groups: Sequence[Sequence[str]]
) -> tuple[list[tuple[Unseen, FloatArray]], FloatArray, FloatArray]:
    """Every group of drops held out, by the names of their records, and what turns an error of its data into m, as depth or by
    integration, (held, held); what scans and priors say of the globals: pull (k,) and precision (k, k)."""
    linear = fit.drops
    names = [] if known else ["ln_p_m", *fit.hypothesis]
    design = stack_tangents(linear, names)
    pull, precision = weigh_globals(problem, fit, names)
    drops = []
    models = {model.observed.name: model for model in problem.tracks.models}
    for records in groups:
        held = np.zeros(linear.residual.size, dtype=bool)
        for name in records:
            section = linear.sections[name]
            held[section.start : section.start + models[name].data.size] = models[name].held
        lengths = block_diag(*(models[n].lengths[np.ix_(models[n].held, models[n].held)] for n in records))
        drops.append((predict_unseen(held, design, linear.covariance, precision), lengths))
    return drops, pull, precision


def weigh_globals(
    problem: Problem, fit: Fit, names: Sequence[str], without: Collection[int] = (0,)
) -> tuple[FloatArray, FloatArray]:
    """What priors and all data say of ln p_m and of effects, about a fit: pull (k,) and precision (k, k). without : places of
    observations that are left out, the drops where nothing else is said."""
    precision = np.zeros((len(names), len(names)))
    pull = np.zeros(len(names))
    for k, name in enumerate(names[1:], start=1):
        width, _ = problem.effects[name].amplitudes[0].stand_in(fit.values[name])
        precision[k, k] = 1 / width**2
        pull[k] = -fit.values[name] / width**2
    for block in (block for k, block in enumerate(fit.blocks) if k not in without):
        columns = stack_tangents(block, names)
        solved = block.solve(columns)
        precision += columns.T @ solved
        pull += solved.T @ block.residual
    return pull, precision


def hold_out_folds(problem: Problem, fit: Fit) -> HeldOut:
    """Leave a fifth of the drops out at a time, repeat the fit with its runs without them, predict them."""
    models, samples = problem.tracks.models, list(problem.tracks.samples.items())
    if len(samples) < 2:
        return predict_held_out(problem, fit)
    parts = []
    for k in range(min(FOLDS, len(samples))):
        fold = [name for _, records in samples[k::FOLDS] for name in records]
        kept = [j for j, model in enumerate(models) if model.observed.name not in fold]
        rest = replace(problem.tracks, models=tuple(models[j] for j in kept))
        without = replace(problem, observations=(rest, *problem.observations[1:]))
        start = replace(fit, nuisances=(fit.nuisances[0][kept], *fit.nuisances[1:]))
        again = fit_hypothesis(without, fit.hypothesis, (fit.log_p_m, fit.values), nuisances=start)
        there = fit_hypothesis(
            problem, fit.hypothesis, (again.log_p_m, again.values), nuisances=fit, iterations=0
        )
        parts.append(predict_held_out(problem, there, groups=[fold]))

    def join(key: str) -> FloatArray:
        return np.concatenate([getattr(part, key) for part in parts])

    return HeldOut(
        tuple(name for part in parts for name in part.names),
        join("rms"),
        join("expected"),
        join("log_score"),
        join("count"),
        {name: rms for part in parts for name, rms in part.by_record.items()},
    )


def predict_held_out(
    problem: Problem, fit: Fit, *, known: bool = False, groups: Sequence[Sequence[str]] = ()
) -> HeldOut:
    """Leave each drop out, fit the globals to the others, predict its motion below the surface.

    A single drop leaves nothing to predict it from: its figures are NaN. known : the globals are held where the fit has them.
    groups : names of records that are left out together, in place of those of one drop each.
    """
    names = tuple(", ".join(group) for group in groups) or tuple(problem.tracks.samples)
    groups = groups or list(problem.tracks.samples.values())
    if len(problem.tracks.samples) < 2:
        nothing = np.full(1, math.nan)
        return HeldOut(names, nothing, nothing, nothing, np.ones(1))
    rms, expected, score, count = [], [], [], []
    by_record: dict[str, float] = {}
    held = {model.observed.name: int(np.count_nonzero(model.held)) for model in problem.tracks.models}
    drops, pull, _precision = _hold_out(problem, fit, known, groups)
    for (drop, lengths), records in zip(drops, groups, strict=True):
        error = drop.miss(fit.drops.residual, pull)
        missed = lengths @ error
        parts = np.split(missed, np.cumsum([held[name] for name in records])[:-1])
        by_record |= {name: math.sqrt(np.mean(part**2)) for name, part in zip(records, parts, strict=True)}
        lower = np.linalg.cholesky(drop.spread)
        white = np.linalg.solve(lower, error)
        score.append(
            -0.5 * white @ white - np.sum(np.log(np.diag(lower))) - 0.5 * error.size * math.log(2 * math.pi)
        )
        rms.append(math.sqrt(np.mean(missed**2)))
        expected.append(math.sqrt(np.mean(np.diag(lengths @ drop.spread @ lengths.T))))
        count.append(error.size)
    return HeldOut(
        names, np.array(rms), np.array(expected), np.array(score), np.array(count, dtype=float), by_record
    )


def check_prediction(problem: Problem, fit: Fit, random: np.random.Generator, draws: int = DRAWS) -> float:
    """p value: how often held-out drops of a true model miss by as much, in the mean square over all of them.

    A fault that is smooth along the way is a few directions among hundreds of data, where χ² does not show it; what one drop
    says of another is few numbers. Its null law is drawn: data of the fitted model's own covariance. 1 with a single drop.
    """
    if len(problem.tracks.samples) < 2:
        return 1.0
    drops, pull, precision = _hold_out(problem, fit, False, list(problem.tracks.samples.values()))
    lower = np.tril(fit.drops.lower)
    residuals = lower @ random.standard_normal((len(lower), draws))
    values, axes = np.linalg.eigh(precision)
    pulls = axes * np.sqrt(np.maximum(values, 0.0)) @ random.standard_normal((len(values), draws))
    seen = sum(float(np.sum((lengths @ drop.miss(fit.drops.residual, pull)) ** 2)) for drop, lengths in drops)
    drawn = sum(np.sum((lengths @ drop.miss(residuals, pulls)) ** 2, axis=0) for drop, lengths in drops)
    return float((1 + np.count_nonzero(drawn >= seen)) / (1 + draws))


def stack_tangents(block: Block, names: Sequence[str]) -> FloatArray:
    """(rows, names) of a block's tangents; there may be none."""
    return np.array([block.tangents[name] for name in names]).reshape(len(names), block.residual.size).T


def measure_gain(nominal: HeldOut, extended: HeldOut) -> Gain:
    """Compare two held-out predictions of the same drops."""
    total = nominal.count.sum()

    def pool(values: FloatArray) -> float:
        return float(math.sqrt(np.sum(nominal.count * values**2) / total))

    before, after, noise = pool(nominal.rms), pool(extended.rms), pool(extended.expected)
    difference = extended.log_score - nominal.log_score
    if math.isnan(before):
        return Gain(*[math.nan] * 6)
    removable = max(before**2 - noise**2, 1e-30)
    fraction = (
        float(np.clip(1 - max(after**2 - noise**2, 0.0) / removable, 0.0, 1.0)) if before > noise else 0.0
    )
    return Gain(
        before,
        after,
        noise,
        float(difference.sum()),
        float(math.sqrt(len(difference) * np.var(difference, ddof=1)))
        if len(difference) > 1
        else float("nan"),
        fraction,
    )
