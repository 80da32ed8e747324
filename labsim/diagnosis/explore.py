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
    fit_hypothesis,
    goodness_of_fit,
    with_probes,
)
from ..inference.workbench import Workbench
from .screen import Screening
from .shapes import cause

FACTORS = (1.0, 2.5, 1 / 2.5)  # on p_m, of the strengths that fits begin at
EXPLORED = ("material", "contact")  # kinds that p_m can make up for; samples are seen in the scans
PROMISING = 3.0  # ln Bayes factor of the screening from which it is
NOWHERE = 2e4  # ln likelihood behind it at which one is not followed at all
HOPELESS = 60.0  # ln evidence behind the best at which a start is not followed to its end
FIRST_STEPS = 4


def is_open(
    bench: Workbench, nominal: Fit, fits: Sequence[Fit], screening: Screening, without_place: float
) -> bool:
    """Whether the nominal model fails, and either nothing explains the data or only what p_m can be traded for.

    However far ahead one effect is of the others about the nominal p_m: some of those explain as much at another.
    without_place : ln evidence of a law without a name.
    """
    best = max([without_place - nominal.evidence, *(each.log_bayes for each in screening.scores[:1])])
    if best <= PROMISING and goodness_of_fit(nominal) >= DOUBTFUL:
        return False
    found = max(fits, key=lambda fit: fit.evidence, default=nominal)
    if found.evidence < nominal.evidence + PROMISING or goodness_of_fit(found) < REJECTED:
        return True
    return bench.effects[found.hypothesis[0]].kind in EXPLORED


def explore(bench: Workbench, nominal: Fit, screening: Screening, fits: Sequence[Fit]) -> dict[str, Fit]:
    """Best coarse fit of every effect that p_m can make up for, by name; of variants in shape the stated one.

    fits : found so far.
    """
    found: dict[str, Fit] = {}
    top = max([nominal.evidence, *(fit.evidence for fit in fits)])
    for score in screening.scores:
        name = score.name
        if not bench.costs_runs(name) or bench.effects[name].kind not in EXPLORED or cause(name) != name:
            continue
        fit = fit_from_strengths(bench, nominal, (name,), top)
        if fit is not None:
            found[name] = fit
            top = max(top, fit.evidence)
    return found


def fit_from_strengths(
    bench: Workbench, nominal: Fit, names: Hypothesis, top: float, factors: Sequence[float] = FACTORS
) -> Fit | None:
    """The best coarse fit of one hypothesis from several strengths; None where its runs lead nowhere.

    top : ln evidence of the best that is known; a start far behind it is not followed. factors : on the nominal p_m.
    """
    low, high = (math.log(p) for p in bench.campaign.p_m_range)
    found: Fit | None = None
    for shift in np.log(factors):
        start = nominal.log_p_m + float(shift)
        if shift != 0.0 and not low <= start <= high:
            continue
        with suppress(ExtrapolationError):  # runs that lead nowhere: not from this start
            begin = (start, _start_at(bench, nominal, names, start))
            fit = fit_hypothesis(
                bench,
                names,
                begin,
                coarse=True,
                nuisances=nominal,
                iterations=FIRST_STEPS,
                least=top - NOWHERE,
            )
            if fit.evidence > top - HOPELESS:
                begin = (fit.log_p_m, fit.values)
                fit = fit_hypothesis(bench, names, begin, coarse=True, nuisances=fit)
            found = fit if found is None or fit.evidence > found.evidence else found
            top = max(top, fit.evidence)
    return found


def _start_at(bench: Workbench, nominal: Fit, names: Hypothesis, log_p_m: float) -> dict[str, float]:
    """Amplitudes that the data ask for at a strength, by the tangents there, within two of their steps."""
    parameters = {name: bench.effects[name].amplitudes[0] for name in names}
    costly = [name for name in names if bench.costs_runs(name)]
    bench.require_fingerprints(costly, log_p_m, f"{' and '.join(names)} at another p_m")
    blocks = with_probes(bench, nominal, names, log_p_m)
    step, *_ = solve_globals(blocks, names, {name: (0.0, each.scale) for name, each in parameters.items()})
    reach = {name: 2 * abs(each.step) for name, each in parameters.items()}
    return {
        name: float(np.clip(amplitude, -reach[name], reach[name]))
        for name, amplitude in zip(names, step, strict=True)
    }
