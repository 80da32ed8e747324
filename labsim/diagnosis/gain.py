"""What an extension is worth on drops that no fit has seen: each drop is held out once.

The held-out drop's own free fall gives its contact and speed; its motion in the dust is predicted from the other
drops. Everything is the linear Gaussian algebra of the likelihood about the fitted point: holding out costs no runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..inference.fitting import Fit
from ..inference.workbench import Workbench
from ..records import FloatArray


@dataclass(frozen=True)
class HeldOut:
    """Per drop: rms of the prediction (m), rms that is expected of a true model (m), ln score, number of data."""

    names: tuple[str, ...]
    rms: FloatArray
    expected: FloatArray
    log_score: FloatArray
    count: FloatArray


@dataclass(frozen=True)
class Gain:
    rms_nominal: float  # m
    rms_extended: float
    rms_noise: float
    log_score_difference: float
    log_score_difference_sigma: float
    fraction_removed: float


def predict_held_out(bench: Workbench, fit: Fit, *, known: bool = False) -> HeldOut:
    """Leave each drop out, fit the globals to the others, predict its motion below the surface.

    A single drop leaves nothing to predict it from: its figures are NaN. known : the globals are held where the fit has them.
    """
    linear = fit.linear
    if len(fit.models) < 2:
        nothing = np.full(1, math.nan)
        return HeldOut((fit.models[0].observed.name,), nothing, nothing, nothing, np.ones(1))
    names = [] if known else ["ln_p_m", *fit.hypothesis]
    design = _stack(linear.tangents, names, linear.residual.size)
    precision = np.zeros((len(names), len(names)))
    pull = np.zeros(len(names))
    for k, name in enumerate(names[1:], start=1):
        width = bench.effects[name].amplitudes[0].scale
        precision[k, k] = 1 / width**2
        pull[k] = -fit.values[name] / width**2
    for block in linear.further:  # scans are never held out
        columns = _stack(block.tangents, names, block.residual.size)
        solved = block.solve(columns)
        precision += columns.T @ solved
        pull += solved.T @ block.residual
    rms, expected, score, count = [], [], [], []
    for model in fit.models:
        section = linear.sections[model.observed.name]
        data = model.matrix @ model.observed.depth
        below = np.zeros(section.stop - section.start, dtype=bool)
        below[: data.size] = data > 3 * model.observed.sigma
        held = np.zeros(linear.residual.size, dtype=bool)
        held[section] = below
        seen = ~held
        factor = cho_factor(linear.covariance[np.ix_(seen, seen)], lower=True)
        cross = linear.covariance[np.ix_(held, seen)]
        solved = cho_solve(factor, design[seen])
        information = design[seen].T @ solved + precision
        covariance = np.linalg.inv(information)
        best = covariance @ (solved.T @ linear.residual[seen] + pull)
        left = linear.residual[seen] - design[seen] @ best
        mean = design[held] @ best + cross @ cho_solve(factor, left)
        reach = design[held] - cross @ solved
        spread = (
            linear.covariance[np.ix_(held, held)]
            - cross @ cho_solve(factor, cross.T)
            + reach @ covariance @ reach.T
        )
        error = linear.residual[held] - mean
        lower = np.linalg.cholesky(spread)
        white = np.linalg.solve(lower, error)
        score.append(
            -0.5 * white @ white - np.sum(np.log(np.diag(lower))) - 0.5 * error.size * math.log(2 * math.pi)
        )
        rms.append(math.sqrt(np.mean(error**2)))
        expected.append(math.sqrt(np.mean(np.diag(spread))))
        count.append(error.size)
    order = tuple(model.observed.name for model in fit.models)
    return HeldOut(order, np.array(rms), np.array(expected), np.array(score), np.array(count, dtype=float))


def _stack(tangents: Mapping[str, FloatArray], names: Sequence[str], rows: int) -> FloatArray:
    """(rows, names) of tangents; there may be none."""
    return np.array([tangents[name] for name in names]).reshape(len(names), rows).T


def measure_gain(nominal: HeldOut, extended: HeldOut) -> Gain:
    """Compare two held-out predictions of the same drops."""
    total = nominal.count.sum()

    def pool(values: FloatArray) -> float:
        return float(math.sqrt(np.sum(nominal.count * values**2) / total))

    before, after, noise = pool(nominal.rms), pool(extended.rms), pool(extended.expected)
    difference = extended.log_score - nominal.log_score
    if math.isnan(before):
        return Gain(*[math.nan] * 5, fraction_removed=math.nan)
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
