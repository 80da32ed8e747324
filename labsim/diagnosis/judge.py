"""From evidences to a verdict: none, an effect (or a pair), or unknown, with probabilities that sum to one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..inference.fitting import Fit, Hypothesis

PRIOR_NONE = 0.5
PRIOR_UNKNOWN = 0.1
PRIOR_PAIRS = 0.05  # all pairs together
TEMPERATURE = 1.0  # evidences are divided by it


@dataclass(frozen=True)
class Verdict:
    """probabilities : best first, of hypotheses as tuples of names, ("none",) and ("unknown",) among them."""

    word: str  # "none" | "effect" | "unknown"
    probabilities: list[tuple[Hypothesis, float]]


def judge(
    nominal: Fit,
    rivals: Sequence[Fit],
    unknown_evidence: float,
    catalogue: Sequence[str],
    screened: Mapping[str, float],
) -> Verdict:
    """Posterior probabilities of all hypotheses.

    screened: ln Bayes factor against nominal, from the linear screening, for singles that were not re-simulated.
    """
    singles = [fit for fit in rivals if len(fit.hypothesis) == 1]
    pairs = [fit for fit in rivals if len(fit.hypothesis) == 2]
    share = (1 - PRIOR_NONE - PRIOR_UNKNOWN - PRIOR_PAIRS) / max(len(catalogue), 1)
    weight: dict[Hypothesis, float] = {("none",): math.log(PRIOR_NONE) + nominal.evidence / TEMPERATURE}
    weight[("unknown",)] = math.log(PRIOR_UNKNOWN) + unknown_evidence / TEMPERATURE
    confirmed = {fit.hypothesis[0] for fit in singles}
    for fit in singles:
        weight[fit.hypothesis] = math.log(share) + fit.evidence / TEMPERATURE
    for name, log_bayes in screened.items():
        if name not in confirmed:
            weight[(name,)] = math.log(share) + (nominal.evidence + log_bayes) / TEMPERATURE
    count = max(len(catalogue) * (len(catalogue) - 1) / 2, 1)
    for fit in pairs:
        weight[fit.hypothesis] = math.log(PRIOR_PAIRS / count) + fit.evidence / TEMPERATURE
    top = max(weight.values())
    total = sum(math.exp(value - top) for value in weight.values())
    ranked = sorted(
        ((name, math.exp(value - top) / total) for name, value in weight.items()), key=lambda item: -item[1]
    )
    best = ranked[0][0]
    word = best[0] if best in (("none",), ("unknown",)) else "effect"
    return Verdict(word, ranked)
