"""Large effects: what a tangent at the nominal fit cannot see because p_m has run away to make up for it.

Where the nominal model fails, every effect that costs runs is fitted by Gauss-Newton on fingerprints (few runs), from the
nominal p_m, or the end of its range, and from strengths above and below it (FACTORS), the effect's amplitude taken first
at that strength. The best of the three replaces the tangent's word.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ..errors import ExtrapolationError
from ..inference.fits.blocks import solve_globals
from ..inference.fits.fitting import (
    DOUBTFUL,
    REJECTED,
    Fit,
    Hypothesis,
    find_leading,
    fit_hypothesis,
    fit_p_value,
    with_perturbations,
)
from ..inference.problem import Problem
from .screen import Screening
from .shapes import cause

FACTORS = (1.0, 2.5, 1 / 2.5)  # on p_m, of the strengths that fits begin at
EXPLORED = ("material", "contact")  # kinds that p_m can make up for; samples are seen in the scans
PROMISING = 3.0  # ln Bayes factor of the screening from which it is
NOWHERE = 2e4  # ln likelihood behind it at which one is not followed at all
HOPELESS = 60.0  # ln evidence behind the best at which a start is not followed to its end
FIRST_STEPS = 4


def needs_exploration(
    problem: Problem, nominal: Fit, fits: Sequence[Fit], screening: Screening, log_evidence_unknown: float
) -> bool:
    """Whether the nominal model fails, and either nothing explains the data or only what p_m can be traded for.

    However far ahead one effect is of the others about the nominal p_m: some of those explain as much at another. What the
    tangent of an effect promises counts until it is fitted. log_evidence_unknown : ln evidence of a law without a name.
    """
    found = find_leading(fits, nominal)
    gain, fitted = found.evidence - nominal.evidence, {fit.hypothesis for fit in fits}
    screened = [each.log_bayes for each in screening.scores if (each.name,) not in fitted]
    best = max([log_evidence_unknown - nominal.evidence, gain, *screened])
    if best <= PROMISING and fit_p_value(nominal) >= DOUBTFUL:
        return False
    if gain < PROMISING or fit_p_value(found) < REJECTED:
        return True
    return problem.effects[found.hypothesis[0]].kind in EXPLORED


def explore(problem: Problem, nominal: Fit, screening: Screening, fits: Sequence[Fit]) -> dict[str, Fit]:
    """Best sparse fit (on few runs) of every effect that p_m can make up for, by name; of variants in shape the stated one.

    fits : found so far.
    """
    found: dict[str, Fit] = {}
    top = max([nominal.evidence, *(fit.evidence for fit in fits)])
    for score in screening.scores:
        name = score.name
        if (
            not problem.affects_simulation(name)
            or problem.effects[name].kind not in EXPLORED
            or cause(name) != name
        ):
            continue
        fit = fit_from_strengths(problem, nominal, (name,), top)
        if fit is not None:
            found[name] = fit
            top = max(top, fit.evidence)
    return found


def fit_from_strengths(
    problem: Problem, nominal: Fit, names: Hypothesis, top: float, factors: Sequence[float] = FACTORS
) -> Fit | None:
    """The best sparse fit of one hypothesis from several strengths; None where its runs lead nowhere.

    top : ln evidence of the best that is known; a start far behind it is not followed, unless that takes no runs. factors : on
    the nominal p_m.
    """
    free = all(map(problem.acts_on_projectile, names))
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    found: Fit | None = None
    for shift in np.log(factors):
        start = nominal.log_p_m + float(shift)
        if shift != 0.0 and not low <= start <= high:
            continue
        with suppress(ExtrapolationError):  # runs that lead nowhere: not from this start
            begin = (start, _start_at(problem, nominal, names, start))
            fit = fit_hypothesis(
                problem,
                names,
                begin,
                sparse=True,
                nuisances=nominal,
                iterations=FIRST_STEPS,
                least=-math.inf if free else top - NOWHERE,
            )
            if free or fit.evidence > top - HOPELESS:
                begin = (fit.log_p_m, fit.values)
                fit = fit_hypothesis(problem, names, begin, sparse=True, nuisances=fit)
            found = fit if found is None or fit.evidence > found.evidence else found
            top = max(top, fit.evidence)
    return found


def _start_at(problem: Problem, nominal: Fit, names: Hypothesis, log_p_m: float) -> dict[str, float]:
    """Amplitudes that the data ask for at a strength, by the tangents there, within two of their steps."""
    parameters = {name: problem.effects[name].amplitudes[0] for name in names}
    costly = [name for name in names if problem.affects_simulation(name)]
    problem.require_fingerprints(costly, log_p_m, f"{' and '.join(names)} at another p_m")
    blocks = with_perturbations(problem, nominal, names, log_p_m)
    step, *_ = solve_globals(blocks, names, {name: (0.0, each.scale) for name, each in parameters.items()})
    reach = {name: 2 * abs(each.step) for name, each in parameters.items()}
    return {
        name: float(np.clip(amplitude, -reach[name], reach[name]))
        for name, amplitude in zip(names, step, strict=True)
    }
