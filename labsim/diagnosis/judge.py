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
# by which differences in ln evidence are divided among all that is not none: two codes differ by as much as what tells one cause
# from another (benchmarks/accuracy/fit_exponent.py); among causes that change runs which accelerometers feel: what such a cause
# changes of a force is as rough as that is
TEMPERATURE, ROUGH_TEMPERATURE = 2.5, 10.0
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
    against_unknown: float = TEMPERATURE,
) -> Verdict:
    """Posterior probabilities of all hypotheses.

    None has what the evidences give it against all others. These share the rest by their priors times their evidences to the
    power of 1/TEMPERATURE: a coarsened likelihood, after Miller & Dunson (2019). Causes behind the best one fall off by
    ROUGH_TEMPERATURE where that is among ``rough``; unknown stands to the best one by ``against_unknown``.

    beside : ln Bayes factor of a free law on top of the best cause over that cause alone. That something unlisted is at work too
    is as likely beforehand as that it is at work alone.
    screened: ln Bayes factor against nominal, from the linear screening, for singles that were not re-simulated. predicted :
    p value of held-out drops with the best cause, or of its own data. Where they are missed, unknown stands to that cause at
    least as its prior does to that of all causes, times the largest Bayes factor that such a p value allows, 1/(-e p ln p):
    Sellke et al. (2001).
    """
    gain: dict[Hypothesis, float] = {(name,): gained for name, gained in screened.items()}
    gain |= {fit.hypothesis: fit.evidence - nominal.evidence for fit in rivals}  # re-simulated, where it was
    prior = {hypothesis: weigh_prior(hypothesis, catalogue) for hypothesis in gain}
    of_unknown, of_none = unknown_evidence - nominal.evidence, weigh_prior((), catalogue)
    full = [prior[hypothesis] + value for hypothesis, value in gain.items()]
    on_top = max(full, default=-math.inf) + beside
    full += [math.log(PRIOR_UNKNOWN) + of_unknown, math.log(PRIOR_UNKNOWN) + on_top]
    best = max(gain, key=lambda hypothesis: gain[hypothesis], default=())
    temperature = _choose_temperature(best, rough)
    weight = {
        hypothesis: prior[hypothesis] + gain[best] / against_unknown - (gain[best] - value) / temperature
        for hypothesis, value in gain.items()
    }
    first = max(weight.values(), default=-math.inf)
    alone, further = of_unknown / against_unknown, first + beside / against_unknown
    if predicted < PREDICTED:
        predicted = max(predicted, sys.float_info.min)  # that of a bad misfit rounds to nought
        bound = -1.0 - math.log(predicted) - math.log(-math.log(predicted))
        alone = max(alone, first - math.log(1 - PRIOR_NONE - PRIOR_UNKNOWN) + bound)
    weight[("unknown",)] = math.log(PRIOR_UNKNOWN) + float(np.logaddexp(alone, further))
    spread = logsumexp(full) - logsumexp(list(weight.values()))
    weight = {hypothesis: value + spread for hypothesis, value in weight.items()} | {("none",): of_none}
    total = logsumexp(list(weight.values()))
    ranked = sorted(
        ((name, math.exp(value - total)) for name, value in weight.items()), key=lambda item: -item[1]
    )
    word = ranked[0][0][0] if ranked[0][0] in (("none",), ("unknown",)) else "effect"
    return Verdict(word, ranked)


def _choose_temperature(first: Collection[str], rough: Collection[str]) -> float:
    """By which causes' differences in ln evidence from the best are divided: one for all, or one with less could stand before one
    with more."""
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
