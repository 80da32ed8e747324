"""Two effects at once: which pairs are worth their runs, and what they say of their effects alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ..errors import ExtrapolationError
from ..inference.fits.fitting import Fit, Hypothesis, fit_hypothesis
from ..inference.fits.refine import list_large_effects, refine
from ..inference.problem import Problem
from .screen import CLOSE, Screening, screen, screen_pairs

MOST_PAIRS = 3  # partners of one single
MOST_JOINT = 2  # pairs taken from the linear screening alone
LEAST_GAIN = 3.0  # ln Bayes factor that a second effect must promise
SHARE = 0.4  # of two effects the larger gains about half of what both do, or more
NOTHING = 2.0  # standard deviations within which an effect of a pair is as good as absent


def confirm_pairs(
    problem: Problem, nominal: Fit, singles: list[Fit], screening: Screening, log_evidence_unknown: float
) -> list[Fit]:
    """Pairs that the linear screening asks for: partners of the best singles, and those that only work together.

    None is worth its runs that does not come near ``log_evidence_unknown``, ln evidence of a law without a name, and no single is
    worth asking for partners that gains less than SHARE of what that law does.
    """
    ranked = sorted(singles, key=lambda fit: -fit.evidence)
    starts: dict[Hypothesis, Fit] = {}
    worth = nominal.evidence + SHARE * (log_evidence_unknown - nominal.evidence)
    for lead in ranked[:2]:
        if lead.evidence < max(nominal.evidence + LEAST_GAIN, ranked[0].evidence - CLOSE + LEAST_GAIN, worth):
            continue
        name = lead.hypothesis[0]
        # finer runs of every partner would cost more than they say
        partners = [n for n, effect in problem.effects.items() if n != name and effect.kind != "numerics"]
        again = screen(problem, lead, np.random.default_rng(0), partners)
        least = max(LEAST_GAIN, log_evidence_unknown - CLOSE - lead.evidence)
        for score in again.scores[:MOST_PAIRS]:
            if score.log_bayes > least and (score.name, name) not in starts:
                starts[name, score.name] = lead
    top = max([log_evidence_unknown - CLOSE, *(fit.evidence for fit in ranked[:1])]) - nominal.evidence
    joint = [
        (pair, log_bayes)
        for pair, log_bayes in screen_pairs(problem, screening)
        if not any(problem.effects[name].kind == "numerics" for name in pair)
    ]
    for pair, log_bayes in joint[:MOST_JOINT]:
        known = any(set(pair) == set(other) for other in starts)
        if not known and log_bayes > max(top, 0.0) + LEAST_GAIN:
            starts[pair] = nominal
    fits = []
    for both, start in starts.items():
        begin = (start.log_p_m, {name: start.values.get(name, 0.0) for name in both})
        with suppress(ExtrapolationError):
            fits.append(fit_hypothesis(problem, both, begin, nuisances=start))
    return fits


def refine_leading(
    problem: Problem, singles: Sequence[Fit], pairs: Sequence[Fit], log_evidence_unknown: float
) -> list[Fit]:
    """The pairs; the best, where it leads all singles, is not far behind ``log_evidence_unknown`` and is large, refined."""
    best = max(pairs, key=lambda fit: fit.evidence, default=None)
    least = max([log_evidence_unknown - CLOSE, *(fit.evidence for fit in singles)])
    if best is None or best.evidence < least or not list_large_effects(problem, best):
        return list(pairs)
    with suppress(ExtrapolationError):
        return [refine(problem, best), *(fit for fit in pairs if fit is not best)]
    return list(pairs)


def return_to_singles(problem: Problem, singles: Sequence[Fit], pairs: Sequence[Fit]) -> list[Fit]:
    """The singles; where the best pair leads them and one of its effects is as good as absent, the other alone from there.

    Two large effects that bend have more than one best place, and a pair may find a better one than its single did.
    """
    best = max(pairs, key=lambda fit: fit.evidence, default=None)
    known = {fit.hypothesis: fit for fit in singles}
    if best is None or any(fit.evidence >= best.evidence for fit in singles):
        return list(known.values())
    for k, absent in enumerate(best.hypothesis, start=1):
        if abs(best.values[absent]) > NOTHING * math.sqrt(best.covariance[k, k]):
            continue
        alone = tuple(name for name in best.hypothesis if name != absent)
        with suppress(ExtrapolationError):
            fit = fit_hypothesis(problem, alone, (best.log_p_m, best.values), nuisances=best)
            if alone not in known or fit.evidence > known[alone].evidence:
                known[alone] = fit
    return list(known.values())
