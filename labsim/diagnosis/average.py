"""p_m whichever cause is at work: that of every fit, by the probability of its cause.

Causes that cannot be told apart may ask for different dust (ct_scale and filling_factor do), and the p_m of the first of them is
then no answer. Hypotheses that were never simulated, and unknown, have no p_m and stay out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import truncnorm

from ..inference.fits.fitting import Fit, Hypothesis
from ..records import FloatArray
from .judge import Verdict

DRAWS = 40_000


def average_p_m(
    verdict: Verdict,
    nominal: Fit,
    rivals: Sequence[Fit],
    p_m_range: tuple[float, float],
    *,
    sampled: Mapping[Hypothesis, FloatArray] | None = None,
    seed: int = 1,
) -> FloatArray:
    """Draws of p_m, Pa, (DRAWS,): from what was ``sampled`` of a hypothesis (Pa), else from a Gaussian of ln p_m cut at the
    stated range, shapes of effects included."""
    probability = dict(verdict.probabilities)
    fits = [nominal, *rivals]
    weights = np.array([probability.get(fit.hypothesis or ("none",), 0.0) for fit in fits])
    if not weights.sum() > 0.0:
        weights = np.array([1.0] + [0.0] * len(rivals))
    rng = np.random.default_rng(seed)
    low, high = (math.log(p_m) for p_m in p_m_range)
    draws = []
    for fit, count in zip(fits, rng.multinomial(DRAWS, weights / weights.sum()), strict=True):
        if sampled is not None and fit.hypothesis in sampled:
            draws.append(np.log(rng.choice(sampled[fit.hypothesis], size=count)))
            continue
        mean, sigma = fit.log_p_m_over_shapes
        ends = (low - mean) / sigma, (high - mean) / sigma
        draws.append(truncnorm.rvs(*ends, loc=mean, scale=sigma, size=count, random_state=rng))
    return np.exp(np.concatenate(draws))
