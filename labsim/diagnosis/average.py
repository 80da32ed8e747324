"""p_m whichever cause is at work: that of every hypothesis, by its probability.

Causes that cannot be told apart may ask for different dust (ct_scale and filling_factor do), and the p_m of the first of them is
then no answer. Nor is that of none where p_m makes up for a cause that nobody can see: causes that were screened and not
simulated count with what their tangents say. Unknown has no p_m and stays out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.stats import truncnorm

from ..inference.fits.fitting import Fit, Hypothesis
from ..records import FloatArray
from .judge import Verdict

DRAWS = 40_000

Draw = Callable[[int, np.random.Generator], FloatArray]


def average_p_m(
    verdict: Verdict,
    nominal: Fit,
    rivals: Sequence[Fit],
    p_m_range: tuple[float, float],
    *,
    sampled: Mapping[Hypothesis, FloatArray] | None = None,
    screened: Mapping[Hypothesis, Draw] | None = None,
    seed: int = 1,
) -> FloatArray:
    """Draws of p_m, Pa, (DRAWS,): from what was ``sampled`` of a hypothesis (Pa), else from a Gaussian of ln p_m cut at the
    stated range, shapes of effects included.

    screened : of hypotheses that were not fitted, what draws a number of ln p_m; what a fit says goes before.
    """
    probability = dict(verdict.probabilities)
    fits: dict[Hypothesis, Fit] = {fit.hypothesis: fit for fit in (nominal, *rivals)}
    others = {name: draw for name, draw in (screened or {}).items() if name not in fits}
    names = [*fits, *others]
    weights = np.array([probability.get(name or ("none",), 0.0) for name in names])
    if not weights.sum() > 0.0:
        weights = np.array([1.0] + [0.0] * (len(names) - 1))
    rng = np.random.default_rng(seed)
    low, high = (math.log(p_m) for p_m in p_m_range)
    draws = []
    for name, count in zip(names, rng.multinomial(DRAWS, weights / weights.sum()), strict=True):
        if name in others:
            if count:
                draws.append(np.clip(others[name](int(count), rng), low, high))
            continue
        fit = fits[name]
        if sampled is not None and fit.hypothesis in sampled:
            draws.append(np.log(rng.choice(sampled[fit.hypothesis], size=count)))
            continue
        mean, sigma = fit.log_p_m_over_shapes
        ends = (low - mean) / sigma, (high - mean) / sigma
        draws.append(truncnorm.rvs(*ends, loc=mean, scale=sigma, size=count, random_state=rng))
    return np.exp(np.concatenate(draws))
