"""From evidences to a verdict: none, an effect (or a pair), or unknown, with probabilities that sum to one."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from ..inference.fits.fitting import Fit, Hypothesis

PRIOR_NONE = 0.5
PRIOR_UNKNOWN = 0.1
PRIOR_PAIRS = 0.1  # all pairs together
# among causes: what tells one from another rests on details in which two solvers differ (benchmarks/accuracy/fit_exponent.py);
# and behind one that changes runs which accelerometers feel: what it changes of a force is as rough as that is
TEMPERATURE, ROUGH_TEMPERATURE = 3.0, 10.0
# of a part of the best pair, and of unknown, a cause with more freedom than any listed one. On fifty campaigns of two other
# solvers a second effect that was not there gained at most 5.5, the weakest that was 9.6
NESTED = 2.0
# p value of the best cause's held-out drops, or of its own data, below which what is not listed gets the odds that it allows
PREDICTED = 0.05
# probability that what a verdict names holds together; and that one of two causes has to get where it is the one, on average, if
# the data can tell them apart
NAMED = 0.9
MOST_NAMED = 3


@dataclass(frozen=True)
class Verdict:
    """probabilities : best first, of hypotheses as tuples of names, ("none",) and ("unknown",) among them."""

    word: str  # "none" | "effect" | "unknown"
    probabilities: list[tuple[Hypothesis, float]]

    @property
    def inclusion(self) -> dict[str, float]:
        """Posterior inclusion probability of each cause: alone or beside another."""
        total: dict[str, float] = {}
        for hypothesis, probability in self.probabilities:
            for name in hypothesis:
                total[name] = total.get(name, 0.0) + probability
        return total

    @property
    def of_first(self) -> float:
        """Probability of the first and of all that hold it beside something else."""
        first = set(self.probabilities[0][0])
        return sum(probability for hypothesis, probability in self.probabilities if first <= set(hypothesis))

    @property
    def named(self) -> list[tuple[Hypothesis, float]]:
        """The first and, where it is an effect, what the data hardly tell from it: until NAMED is reached, MOST_NAMED at most."""
        if self.word != "effect":
            return self.probabilities[:1]
        before = 0.0
        named = []
        for hypothesis, probability in self.probabilities[:MOST_NAMED]:
            if before < NAMED:
                named.append((hypothesis, probability))
            before += probability
        return named


def weigh_prior(hypothesis: Hypothesis, catalogue: Sequence[str]) -> float:
    """ln of the prior probability of none (empty), one cause or a pair of those listed."""
    causes = len(catalogue)
    if len(hypothesis) == 2:
        return math.log(PRIOR_PAIRS / max(causes * (causes - 1) / 2, 1))
    share = (1 - PRIOR_NONE - PRIOR_UNKNOWN - PRIOR_PAIRS) / max(causes, 1)
    return math.log(share if hypothesis else PRIOR_NONE)


def judge(
    nominal: Fit,
    rivals: Sequence[Fit],
    unknown_evidence: float,
    catalogue: Sequence[str],
    screened: Mapping[str, float],
    predicted: float = 1.0,
    rough: Collection[str] = (),
    beside: float = -math.inf,
    unknown_softness: float = NESTED,
) -> Verdict:
    """Posterior probabilities of all hypotheses.

    None has what the evidences give it against all others. These share the rest: behind what explains most they fall off by the
    difference of their gains over the temperature (NESTED for parts of the best, ``unknown_softness`` for unknown), since they
    are told apart by residuals of the size of the solver's own error. Of two singles the one with more evidence always stands
    first.

    beside : ln Bayes factor of a free law on top of the best cause over that cause alone. That something unlisted is at work too
    is as likely beforehand as that it is at work alone. rough : causes behind which ROUGH_TEMPERATURE holds. unknown_softness :
    by which what unknown and the best cause differ by is divided, and what is beside.
    screened: ln Bayes factor against nominal, from the linear screening, for singles that were not re-simulated. predicted :
    p value of held-out drops with the best cause, or of its own data. Where they are missed, unknown stands to that cause at
    least as its prior does to that of all causes, times the largest Bayes factor that such a p value allows, 1/(-e p ln p):
    Sellke et al. (2001).
    """
    gain: dict[Hypothesis, float] = {(name,): gained for name, gained in screened.items()}
    gain |= {fit.hypothesis: fit.evidence - nominal.evidence for fit in rivals}  # re-simulated, where it was
    of_unknown = unknown_evidence - nominal.evidence
    full = [weigh_prior(hypothesis, catalogue) + value for hypothesis, value in gain.items()]
    on_top = max(full, default=-math.inf) + beside
    full += [math.log(PRIOR_UNKNOWN) + of_unknown, math.log(PRIOR_UNKNOWN) + on_top]
    most = max([0.0, *gain.values()])
    top = max(most, of_unknown)
    lead = top - (top - most) / unknown_softness
    ahead = {name for hypothesis, value in gain.items() if value == most for name in hypothesis}
    nested = [max(value, 0.0) for hypothesis, value in gain.items() if set(hypothesis) < ahead]
    temperature = _choose_temperature(ahead, rough)
    softened = top - (top - max(of_unknown, 0.0)) / unknown_softness
    weight: dict[Hypothesis, float] = {
        ("unknown",): math.log(PRIOR_UNKNOWN) + softened + min(of_unknown, 0.0)
    }
    for hypothesis, value in gain.items():
        above = max(value, 0.0)
        softened = lead - (most - above) / (NESTED if set(hypothesis) < ahead else temperature)
        # what explains less than a part of the best never stands before that part
        behind = [
            lead - (most - part) / NESTED - (part - above) / temperature for part in nested if part >= above
        ]
        softened = min([softened, *behind])
        weight[hypothesis] = weigh_prior(hypothesis, catalogue) + softened + min(value, 0.0)
    first = max((weight[hypothesis] for hypothesis in gain), default=-math.inf)
    if predicted < PREDICTED:
        predicted = max(predicted, sys.float_info.min)  # that of a bad misfit rounds to nought
        bound = -1.0 - math.log(predicted) - math.log(-math.log(predicted))
        odds = math.log(PRIOR_UNKNOWN / (1 - PRIOR_NONE - PRIOR_UNKNOWN)) + bound
        weight[("unknown",)] = max(weight[("unknown",)], first + odds)
    further = math.log(PRIOR_UNKNOWN) + max(beside, 0.0) / unknown_softness + min(beside, 0.0)
    weight[("unknown",)] = float(np.logaddexp(weight[("unknown",)], first + further))
    spread = logsumexp(full) - logsumexp(list(weight.values()))
    weight = {hypothesis: value + spread for hypothesis, value in weight.items()}
    weight[("none",)] = weigh_prior((), catalogue)
    total = logsumexp(list(weight.values()))
    ranked = sorted(
        ((name, math.exp(value - total)) for name, value in weight.items()), key=lambda item: -item[1]
    )
    best = ranked[0][0]
    word = best[0] if best in (("none",), ("unknown",)) else "effect"
    return Verdict(word, ranked)


def _choose_temperature(first: Collection[str], rough: Collection[str]) -> float:
    """By which differences in ln evidence from the best are divided: one for all, or one with less could stand before one with
    more."""
    return ROUGH_TEMPERATURE if first and set(first) <= set(rough) else TEMPERATURE


def find_class(first: Fit, rivals: Sequence[Fit], rough: Collection[str] = ()) -> list[str]:
    """The cause that was found and those from which these data cannot tell it, by name; whichever has more evidence.

    Were one of two fits the truth, the other's ln evidence would on average be behind by half the square of their distance: of
    what they predict, in standard deviations of the data. Over the temperature that has to give it NAMED of the probability.
    """
    least = 2.0 * _choose_temperature(first.hypothesis, rough) * math.log(NAMED / (1.0 - NAMED))
    others = [fit for fit in rivals if len(fit.hypothesis) == 1 and _distance(first, fit) < least]
    return sorted({fit.hypothesis[0] for fit in (first, *others)})


def _distance(one: Fit, other: Fit) -> float:
    """Squared, of two fits' predictions, in standard deviations of the data as the first sees them."""
    apart = 0.0
    for here, there in zip(one.blocks, other.blocks, strict=True):
        white = here.whiten(here.residual - there.residual)
        apart += float(np.sum(white**2))
    return apart
