"""Which further measurement would best tell the remaining causes apart: expected information, in bits.

Each hypothesis still standing predicts every candidate, given today's data: further drops of the projectiles at hand, drops of a
heavier and of a larger one, drops without what can be taken away (planned_drops.py), CT scans (planned_scans.py), further pushes.
What is expected of a measurement is the weight of evidence that it gives the true hypothesis against all others,
Σ p_j ln [p(y|j) / Σ_k w_k p(y|k)], w_k = p_k / (1 - p_j) (Good 1950): it goes on growing where all is decided. From below, with
the Kullback-Leibler divergences D_jk of normal distributions: -Σ p_j ln Σ_k w_k exp(-D_jk) (Hershey & Olsen 2007).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import logsumexp

from ..calibrated import read_value
from ..errors import ExtrapolationError
from ..inference.fits.fitting import Fit
from ..inference.problem import Problem
from ..records import FloatArray
from .planned_drops import Prediction, plan_drops, predict_drops
from .planned_scans import plan_scans, predict_scans
from .unlisted.learned_law import LearnedLaw

SEEN_BY_SPEED = (
    0.01  # of ln resistance, between the slowest and the fastest push: less is no cause that speed shows
)
DECIDED = 4.0  # standard deviations between two predictions that are told apart
WORTHWHILE = 0.01  # bits below which an experiment is not suggested
SMALLEST = 0.005  # probability below which a hypothesis is left out
MOST = 5  # experiments that are suggested
MOST_TOLD = 3  # of what one of them is to tell apart, that are named in its text
CERTAIN = 0.95  # probability of the first from which no other projectile is asked for


@dataclass(frozen=True)
class Suggestion:
    """change : what to do. tells : the causes that it is to tell apart, where it was made for two of them, or the formulas of a
    learned law in words. predictions : what each of them predicts, the most probable first, by its name."""

    change: str
    information_bits: float
    tells: tuple[tuple[str, ...], ...] = ()
    predictions: tuple[tuple[str, Prediction], ...] = ()

    @property
    def bits(self) -> str:
        """The information in words."""
        said = self.information_bits
        return f"{said:.0f} bits" if said >= 10.0 else f"{said:.2g} bits"

    @property
    def text(self) -> str:
        """What to do and what for."""
        if not self.tells:
            return self.change
        first, *others = [" + ".join(names) for names in self.tells[:MOST_TOLD]]
        further = len(self.tells) - MOST_TOLD
        more = f" or {further} more" if further > 0 else ""
        return f"{self.change}, to tell {first} from {' or '.join(others)}{more}"


def suggest(
    problem: Problem, fits: list[Fit], probabilities: dict[tuple[str, ...], float]
) -> list[Suggestion]:
    """Best first. fits: hypotheses with a prediction (the nominal one has the empty name)."""
    standing = [fit for fit in fits if probabilities.get(fit.hypothesis or ("none",), 0.0) > SMALLEST]
    found = [
        each
        for number, group in enumerate(problem.groups)
        if group.pushed
        for each in _suggest_pushes(problem, fits, probabilities, number)
    ]
    if len(standing) < 2:
        return found
    weight = np.array([probabilities[fit.hypothesis or ("none",)] for fit in standing])
    weight /= weight.sum()
    if any(not (group.is_scan or group.pushed) for group in problem.groups):
        found += _suggest_planned(problem, standing, weight)
    worth = [each for each in found if each.information_bits >= WORTHWHILE]
    return sorted(worth, key=lambda each: -each.information_bits)[:MOST]


def suggest_between_formulas(learned: LearnedLaw) -> list[Suggestion]:
    """What would tell the formulas of a learned law apart, best first; none where one of them stands alone. They are as probable
    as their evidence says."""
    top = learned.best.fit.evidence
    odds = [math.exp(each.fit.evidence - top) for each in learned.formulas]
    probabilities = {
        each.fit.hypothesis: odd / sum(odds) for each, odd in zip(learned.formulas, odds, strict=True)
    }
    standing = [each for each in learned.formulas if probabilities[each.fit.hypothesis] > SMALLEST]
    if len(standing) < 2:
        return []
    tells = tuple(
        tuple([cause.title for cause in each.causes] + [term.title for term in each.terms])
        for each in standing
    )
    found = suggest(learned.problem, [each.fit for each in standing], probabilities)
    return [replace(each, tells=tells) for each in found]


def _suggest_planned(problem: Problem, standing: list[Fit], weight: FloatArray) -> list[Suggestion]:
    """Planned drops and CT scans, the best of those that differ in speed alone; what needs runs of its own only where the first
    is not certain."""
    order = np.argsort(-weight, kind="stable")
    ordered = [standing[k] for k in order]
    best: dict[str, Suggestion] = {}
    for plan, predict in ((plan_drops, predict_drops), (plan_scans, predict_scans)):
        for new in (True, False) if weight.max() < CERTAIN else (False,):
            try:
                extended, planned = plan(problem, ordered, new=new)
                by_fit = predict(problem, extended, ordered) if planned else []
                break
            except ExtrapolationError:  # no run of what is new comes to rest
                if not new:
                    raise
        for (what, fast), predictions in zip(planned, zip(*by_fit, strict=True), strict=True):
            bits = expected_weight(
                [each.mean for each in predictions], [each.spread for each in predictions], weight[order]
            )
            said = tuple(
                (" + ".join(fit.hypothesis) or "none", each)
                for fit, each in zip(ordered, predictions, strict=True)
            )
            if what not in best or bits > best[what].information_bits:
                best[what] = Suggestion(f"{what} {fast}", round(bits, 3), predictions=said)
    return list(best.values())


def _suggest_pushes(
    problem: Problem, fits: list[Fit], probabilities: dict[tuple[str, ...], float], number: int
) -> list[Suggestion]:
    """As many pushes at the slowest and at the fastest speed, near each other, as tell the first cause from the most
    probable other that speed shows by DECIDED standard deviations.

    What is calibrated and the profile of the ground fall out of the ratio of the two; the scatter of samples stays. A cause that
    was not fitted is taken as large as its prior expects.
    """
    pushes = sorted(
        (dict(drop.motion.values)["speed"], drop.name) for drop in problem.campaign.drops if drop.gauge
    )
    (slow, first), (fast, last) = pushes[0], pushes[-1]
    if slow == fast:
        return []
    fitted = {fit.hypothesis: fit.values for fit in fits}
    table, place = problem.tracks.features[number].table, next(iter(problem.places.values()))
    ratios, weights, names_of = [], [], []
    for hypothesis, probability in probabilities.items():
        if probability < SMALLEST or hypothesis == ("unknown",):
            continue
        names = () if hypothesis == ("none",) else hypothesis
        usual = {name: problem.effects[name].amplitudes[0].scale for name in names}
        own = fitted.get(names, usual)
        values = {name: own[name] if abs(own[name]) > 0.1 * usual[name] else usual[name] for name in names}
        ends = []
        for speed, push in ((slow, first), (fast, last)):
            state = problem.state(problem.groups[number], push)
            changed = state
            for name in names:
                if problem.rescales_p_m(name):
                    changed = problem.effects[name].apply(changed, problem.at(name, values[name]), place)
            shift = math.log(read_value(changed.material) / read_value(state.material))
            ends.append(table.features(fits[0].log_p_m + shift, math.log(speed), values)[0])
        ratios.append(ends[1] - ends[0])
        names_of.append(hypothesis)
        weights.append(probability)
    if not ratios:
        return []
    apart = np.abs(np.array(ratios) - ratios[int(np.argmax(weights))])
    likely = np.where(apart > SEEN_BY_SPEED, weights, 0.0)
    if not likely.any():
        return []
    rival = int(np.argmax(likely))
    count = max(1, math.ceil(2.0 * (DECIDED * problem.budget.scatter / apart[rival]) ** 2))
    best = int(np.argmax(weights))
    spread = np.array([[2.0 * problem.budget.scatter**2 / count]])
    means = list(np.array(ratios)[:, None])
    bits = expected_weight(means, [spread] * len(means), np.array(weights) / sum(weights))
    return [
        Suggestion(
            f"{count} more push{'es' * (count > 1)} at {1e3 * slow:g} mm/s and as many at {1e3 * fast:g} mm/s, near each other",
            round(bits, 3),
            (names_of[best], names_of[rival]),
        )
    ]


def expected_weight(means: Sequence[FloatArray], spreads: Sequence[FloatArray], weight: FloatArray) -> float:
    """Bits of evidence that a measurement is expected to give the truth against all other hypotheses, from below.

    means : (values,) of each hypothesis; spreads : (values, values) of each; weight : (hypotheses,) probabilities, of which each
    is less than one. Source: as above.
    """
    factors = [cho_factor(spread, lower=True) for spread in spreads]
    determinants = [2.0 * float(np.sum(np.log(np.diag(factor[0])))) for factor in factors]
    total = 0.0
    for j, (mean, spread) in enumerate(zip(means, spreads, strict=True)):
        apart = []
        for k, factor in enumerate(factors):
            if k != j:
                off = mean - means[k]
                divergence = 0.5 * (
                    float(np.trace(cho_solve(factor, spread)))
                    + float(off @ cho_solve(factor, off))
                    - off.size
                    + determinants[k]
                    - determinants[j]
                )
                apart.append(math.log(weight[k] / (1.0 - weight[j])) - max(divergence, 0.0))
        total -= float(weight[j] * logsumexp(apart))
    return total / math.log(2)
