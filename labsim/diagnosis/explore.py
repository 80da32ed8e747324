"""Large effects: what a tangent at the nominal fit cannot see because p_m has run away to make up for it.

Where the nominal model fails, every effect that costs runs is fitted by Gauss-Newton on fingerprints (few runs), from the
nominal p_m, or the end of its range, and from strengths above and below it (FACTORS), the effect's amplitude taken first
at that strength. The best of the three replaces the tangent's word, with runs of its own where it comes near.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
    require_runs,
    with_perturbations,
)
from ..inference.problem import Problem
from .screen import HALF, Screening
from .shapes import cause

FACTORS = (1.0, 2.5, 1 / 2.5)  # on p_m, of the strengths that fits begin at
EXPLORED = ("material", "contact")  # kinds that p_m can make up for; samples are seen in the scans
PROMISING = 3.0  # ln Bayes factor of the screening from which it is
# ln evidence behind the best within which a hypothesis has more runs: few runs are good to some twenty, and large effects are not
# what they promise (HALF)
ROUGH = 60.0


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


def explore(
    problem: Problem, nominal: Fit, screening: Screening, fits: Sequence[Fit], log_evidence_unknown: float
) -> dict[str, Fit]:
    """Best sparse fit (on few runs) of every effect that p_m can make up for, by name; of variants in shape the stated one.

    fits : found so far; log_evidence_unknown : ln evidence of a law without a name.
    """
    found: dict[str, Fit] = {}
    top = max([nominal.evidence, log_evidence_unknown, *(fit.evidence for fit in fits)])
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


def allow_behind(top: float, nominal: Fit) -> float:
    """How far behind the best ln evidence a hypothesis may be, by few runs, for more to be made of it."""
    return max(ROUGH, (1.0 - HALF) * (top - nominal.evidence))


def fit_from_strengths(problem: Problem, nominal: Fit, names: Hypothesis, top: float) -> Fit | None:
    """The best sparse fit of one hypothesis from several strengths; None where its runs lead nowhere.

    First from each on runs of one amplitude there, in proportion. The best of these is looked at once more where it is large, and
    followed with runs of its own where it is not far behind ``top``, ln evidence of the best that is known. A law that takes no
    runs is followed from all.
    """
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    starts = [nominal.log_p_m + math.log(factor) for factor in FACTORS]
    begun = []
    for start in [starts[0], *(each for each in starts[1:] if low <= each <= high)]:
        with suppress(ExtrapolationError):  # runs that lead nowhere: not from this start
            begun.append((start, _start_at(problem, nominal, names, start)))
    fits = [fit for begin in begun for fit in _fit(problem, names, begin, nominal, known=True)]
    if fits and not all(map(problem.acts_on_projectile, names)):
        best = max(fits, key=lambda fit: fit.evidence)
        if _reaches_far(problem, best):
            with suppress(ExtrapolationError):
                require_runs(problem, best, sparse=True)
                best = fit_hypothesis(problem, names, _end(best), sparse=True, nuisances=best, known=True)
        if best.evidence < top - allow_behind(max(top, best.evidence), nominal):
            return best
        fits = [best]
    ends = [end for fit in fits for end in _fit(problem, names, _end(fit), fit)]
    return max(ends or fits, key=lambda fit: fit.evidence, default=None)


def _end(fit: Fit) -> tuple[float, Mapping[str, float]]:
    """Where another fit may begin."""
    return fit.log_p_m, fit.values


def _reaches_far(problem: Problem, fit: Fit) -> bool:
    """Whether an amplitude is beyond the one that runs were made of first, where proportion is a guess."""
    parameters = {name: problem.effects[name].amplitudes[0] for name in fit.hypothesis}
    return any(
        abs(parameters[name].grade(value)) > abs(parameters[name].grade(parameters[name].step))
        for name, value in fit.values.items()
    )


def _fit(
    problem: Problem,
    names: Hypothesis,
    start: tuple[float, Mapping[str, float]],
    nuisances: Fit,
    *,
    known: bool = False,
) -> list[Fit]:
    """A sparse fit; none where its runs lead nowhere."""
    with suppress(ExtrapolationError):
        return [fit_hypothesis(problem, names, start, sparse=True, nuisances=nuisances, known=known)]
    return []


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
