"""A short formula for what no listed cause explains: chosen among all terms, simulated, refitted, tested on held-out drops.

What terms of effects/terms/ would change is known from the hats of the free law (free_law.py): a term is a combination of them.
All single terms and pairs are weighed so, to first order; the best few become effects for this one campaign, are simulated and
fitted as any cause is. Formulas and figures: docs/learned-law.md.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from ...effects import Effect
from ...effects.terms import Term, list_terms
from ...errors import LabsimError
from ...inference.fits.fitting import REJECTED, Fit, Hypothesis, find_leading, fit_hypothesis, fit_p_value
from ...inference.fits.refine import list_large_effects, refine
from ...inference.problem import Problem
from ...records import FloatArray
from ..explore import FACTORS, ROUGH, allow_behind, fit_from_strengths
from ..gain import Gain, HeldOut, hold_out_folds, measure_gain, predict_held_out
from ..pairs import LEAST_GAIN
from ..screen import NARROW
from .free_law import EMBEDDED, SIZES, Marginal, Tangents, integrate
from .hats import FreeLaw, add_terms, shape_at
from .unknown import UnknownFit, log_mean

MOST_WEIGHED = 4  # formulas that few runs are made of, beside the best of every place
MOST_SIMULATED = 4  # of them, those that get as far as the best by ROUGH
# a share of what is gained, where that is more than ROUGH: mass that sticks gained 48 100 by few runs, 48 300 by more
ROUGH_SHARE = 0.01
# other forms of a place, those that are weighed first: of fifteen forms of a force of depth the four best after runs of their own
# were among these (p12)
MOST_TRIED = 6
MOST_SIBLINGS = 2  # of a place, likewise
# what a layer changes has a peak where drops end in it, which few speeds miss: all are simulated
PEAKED = "strength of depth"
LINEAR = 0.25  # of a gain: the free law of w007's place gained 281, its formula, simulated, 370
MOST_PARTS = 3  # terms, or terms and listed causes, of a formula
MOST_REFINED = 2  # formulas: where runs bend, a large one was left 21 below in ln evidence
# where nothing explains the data: terms begun anew, from each of FACTORS, with the best of these shares of their unit. At
# a p_m that has run away the tangent may have the wrong sign: there fits on few runs led to 1610 where 1790 is to be had
MOST_ANEW, SHARES = 2, (1.0, 4.0)
ALIKE = 3.0  # ln evidence within which a campaign does not tell two formulas apart


@dataclass(frozen=True)
class Formula:
    """Some terms as a fit of their own runs. gain : over the nominal model, on drops held out of both fits; causes : listed ones,
    beside which the terms stand where they do not explain the data alone."""

    terms: tuple[Term, ...]
    fit: Fit
    held_out: HeldOut
    gain: Gain
    causes: tuple[Effect, ...] = ()

    @property
    def coefficients(self) -> FloatArray:
        return np.array([self.fit.values[term.name] for term in self.terms])

    @property
    def sigma(self) -> FloatArray:
        return np.sqrt(np.diag(self.covariance(*self.terms)))

    @property
    def log_p_m(self) -> tuple[float, float]:
        """ln p_m with it, and its standard deviation."""
        return self.fit.log_p_m, math.sqrt(self.fit.covariance[0, 0])

    def covariance(self, *parts: Term | Effect) -> FloatArray:
        """Of the coefficients of terms and the amplitudes of causes, in the order asked."""
        places = [1 + self.fit.hypothesis.index(part.name) for part in parts]
        return self.fit.covariance[np.ix_(places, places)]

    def trace(self, law: FreeLaw, places: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """What it adds at places of a law, and its standard deviation, in the law's unit; None where it adds nothing there."""
        own = [term for term in self.terms if term.place == law.name]
        if not own:
            return None
        shapes = np.stack([shape_at(term, law, places) for term in own])
        value = np.array([self.fit.values[term.name] for term in own]) @ shapes
        return value, np.sqrt(np.einsum("in,ij,jn->n", shapes, self.covariance(*own), shapes))


@dataclass(frozen=True)
class LearnedLaw:
    """formulas : those that were simulated, the one with most evidence first; problem : with their terms among its effects.
    repeated : gain of the best on drops that neither fit has seen, both repeated without them; missed : of each of these the
    rms (m) without the formula and with it."""

    formulas: tuple[Formula, ...]
    problem: Problem
    repeated: Gain
    missed: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def best(self) -> Formula:
        return self.formulas[0]

    @property
    def alike(self) -> list[Formula]:
        """The others that this campaign hardly tells from the best."""
        return [each for each in self.formulas[1:] if each.fit.evidence > self.best.fit.evidence - ALIKE]


def learn_law(
    problem: Problem, nominal: Fit, unknown: UnknownFit, before: HeldOut, listed: Sequence[Fit] = ()
) -> LearnedLaw | None:
    """The formulas that explain most, simulated and fitted; None where none explains more than the nominal model
    and gives held-out drops a higher probability, the best of them where its fit is repeated without them too; None where no law
    was left free.

    before : the nominal model's predictions of held-out drops. listed : the listed cause, or pair, that explains most, and the
    parts of a pair by themselves.
    """
    tangents = unknown.tangents
    if tangents is None:
        return None
    free, terms, units = add_terms(problem, tangents.laws)
    free = replace(free, shape_evidence={**free.shape_evidence, **share_places(terms)})
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    weighed = weigh_formulas(tangents, terms, units, (low, high))
    chosen = [names for names, _ in choose_formulas(weighed, terms)]
    ranked = dict.fromkeys([names[0] for names, _ in weighed if len(names) == 1] + list(terms))
    ordered = {name: units[name] for name in ranked}
    fits = fit_formulas(
        free, nominal, chosen, ordered, list_open_places(unknown), listed, list_promises(unknown)
    )
    formulas = []
    for fit in fits:
        if fit.evidence > nominal.evidence + LEAST_GAIN:
            held_out = predict_held_out(free, fit)
            gain = measure_gain(before, held_out)
            if not gain.log_score_difference < 0.0:  # a single drop leaves none to hold out
                named = tuple(terms[name] for name in fit.hypothesis if name in terms)
                causes = tuple(free.effects[name] for name in fit.hypothesis if name not in terms)
                formulas.append(Formula(named, fit, held_out, gain, causes))
    if not formulas:
        return None
    formulas.sort(key=lambda each: -each.fit.evidence)
    without = hold_out_folds(problem, nominal)
    for k, formula in enumerate(formulas):
        with_it = hold_out_folds(free, formula.fit)
        gain = measure_gain(without, with_it)
        if not gain.log_score_difference <= 0.0:
            missed = {
                name: (before, with_it.by_record[name]) for name, before in sorted(without.by_record.items())
            }
            return LearnedLaw(tuple(formulas[k:]), free, gain, missed)
    return None


def fit_formulas(
    problem: Problem,
    nominal: Fit,
    chosen: Sequence[Hypothesis],
    units: Mapping[str, float],
    open_places: Collection[str] = (),
    listed: Sequence[Fit] = (),
    promises: Mapping[str, float] | None = None,
) -> list[Fit]:
    """Each from three strengths on few runs, and those that come furthest with runs of their own; best first, MOST_REFINED of
    them among runs about themselves. What takes no runs is first, from several sizes too where nothing explains the data: how far
    it leads is how far all others must.

    units : of all terms, those first that are weighed first; open_places : whose forms are tried in any case; listed : causes
    that explain most, which a term may stand beside; promises : ln evidence of the free laws of places. Where a formula explains
    the data, only places that promise about as much have runs.
    """

    sparse, fits, searched = list[Fit](), list[Fit](), set[str]()

    def comes_near(place: str) -> bool:
        best = find_leading([*sparse, *fits], nominal)
        margin = max(NARROW, LINEAR * (best.evidence - nominal.evidence))
        promise = (promises or {}).get(place, math.inf)
        return promise > best.evidence - margin or not _explains([best])

    def begin(chosen: Sequence[Hypothesis]) -> None:
        for names in chosen:  # before there are more runs, which few ones do not stand beside
            top = max([nominal.evidence, *(fit.evidence for fit in sparse)])
            with suppress(LabsimError):
                found = fit_from_strengths(problem, nominal, names, top)
                sparse.extend([found] if found is not None else [])

    singles = [names for names in chosen if len(names) == 1]
    seen = [names for names in singles if not problem.affects_simulation(*names)]
    pushed = [names for names in singles if problem.acts_on_projectile(*names)]
    for names in seen:
        sparse += _fit(problem, names, (nominal.log_p_m, {}), nominal)
    begin(pushed)
    if not _explains(sparse or [nominal]):
        again = [fit for (name,) in pushed for fit in _begin_anew(problem, nominal, name, units[name])]
        sparse = take_better([*sparse, *again])

    def is_worth(name: str) -> bool:
        return (name,) in (*seen, *pushed) or comes_near(list_terms()[name].place)

    begin([names for names in chosen if len(names) > 1 and all(map(is_worth, names))])
    if not _explains(sparse or [nominal]) and not _is_ahead(listed, find_leading(sparse, nominal)):
        fits = fit_siblings(problem, nominal, fits, sparse, units, searched=searched, free=True)
    dear = [names for names in singles if names not in seen and names not in pushed]
    begin([names for names in dear if is_worth(*names)])
    fits += _refine(problem, nominal, sparse, MOST_SIMULATED, fits)
    if not _explains(fits or [nominal]):
        best = find_leading(fits, nominal)
        if _is_ahead(listed, best):
            # they explain more than any formula alone: what form a law has is told about them, not without them
            fits = take_better([*fits, *fit_further(problem, listed, [*fits, *sparse], units)])
            if _explains(fits):
                return sorted(fits, key=lambda fit: -fit.evidence)
            best = find_leading(fits, nominal)
        least = best.evidence - allow_behind(best.evidence, nominal)
        ahead = [fit.hypothesis for fit in sparse if fit.evidence > least and fit.hypothesis in dear]
        fits = take_better([*fits, *fit_anew(problem, nominal, ahead, units)])
    near = [place for place in open_places if comes_near(place)]
    fits = fit_siblings(problem, nominal, fits, sparse, units, near, searched=searched)
    while not _explains(fits or [nominal]):
        further = fit_further(problem, [*fits[:1], *listed], [*fits, *sparse], units)
        if not further:
            break
        fits = sorted(take_better([*fits, *further]), key=lambda fit: -fit.evidence)
    return fits


def fit_further(
    problem: Problem, bases: Sequence[Fit], known: Sequence[Fit], units: Mapping[str, float]
) -> list[Fit]:
    """Fits with one term more than each of ``bases`` has, of those that are LEAST_GAIN ahead of it and of all others. On few runs
    the best single term of every place is tried, then MOST_TRIED others of the place that leads; what comes furthest has runs of
    its own. MOST_PARTS at most.

    known : fits of single terms, which say what is best at a place.
    """
    alone = [fit for fit in known if len(fit.hypothesis) == 1]
    singles = [fit.hypothesis[0] for fit, _ in _list_places(alone, (), units, math.inf).values()]
    found = [
        fit
        for base in bases
        if len(base.hypothesis) < MOST_PARTS
        for fit in _fit_beside(problem, base, singles, units)
    ]
    top = max(fit.evidence for fit in (*bases, *known))
    return [fit for fit in found if fit.evidence > top + LEAST_GAIN]


def _fit_beside(problem: Problem, base: Fit, singles: Sequence[str], units: Mapping[str, float]) -> list[Fit]:
    """A fit with one of some terms more, and with others of its place; those that come furthest with runs of their own."""

    def add(name: str, start: Fit, size: float) -> list[Fit]:
        begin = (start.log_p_m, {**start.values, name: size * units[name]})
        return _fit(problem, (*base.hypothesis, name), begin, start, sparse=True)

    sparse = [fit for name in singles if name not in base.hypothesis for fit in add(name, base, 0.0)]
    if not sparse:
        return []
    best = max(sparse, key=lambda fit: fit.evidence)
    *_, added = best.hypothesis
    others = _list_forms(list_terms()[added].place, units, best.hypothesis)
    sparse += [fit for name in others for fit in add(name, best, best.values[added] / units[added])]
    return [
        fit
        for start in sorted(sparse, key=lambda fit: -fit.evidence)[:MOST_SIBLINGS]
        for fit in _fit(problem, start.hypothesis, (start.log_p_m, start.values), start)
    ]


def _list_forms(place: str, units: Mapping[str, float], known: Collection[str]) -> list[str]:
    """The first MOST_TRIED terms of a place, as ``units`` has them in order, beside those that are known."""
    names = [name for name in units if list_terms()[name].place == place and name not in known]
    return names[:MOST_TRIED]


def fit_anew(
    problem: Problem, nominal: Fit, singles: Sequence[Hypothesis], units: Mapping[str, float]
) -> list[Fit]:
    """The terms that get furthest before p_m is moved, fitted from there with runs of their own."""
    # few runs do not stand beside more: they get names of their own
    probes = {f"{name} anew": problem.effects[name] for (name,) in singles}
    probing = replace(problem, effects={**problem.effects, **probes})
    begun = {
        names: _begin_anew(probing, nominal, probe, units[names[0]])
        for names, probe in zip(singles, probes, strict=True)
    }
    best = {names: max(fit.evidence for fit in starts) for names, starts in begun.items() if starts}
    return [
        fit
        for names in sorted(best, key=lambda names: -best[names])[:MOST_ANEW]
        for start in begun[names]
        for fit in _fit(
            problem, names, (start.log_p_m, dict(zip(names, start.values.values(), strict=True))), start
        )
    ]


def _begin_anew(problem: Problem, nominal: Fit, name: str, unit: float) -> list[Fit]:
    """The best size of a term, by its unit, at each of several strengths; followed where its law takes no runs."""
    sizes, found = [sign * share * unit for sign in (1.0, -1.0) for share in SHARES], []
    for strength in _list_strengths(problem, nominal):
        starts = [fit for size in sizes for fit in _start(problem, name, strength, size, nominal)]
        for each in sorted(starts, key=lambda fit: -fit.evidence)[:1]:
            free = problem.acts_on_projectile(name)
            begin = (each.log_p_m, each.values)
            found += _fit(problem, (name,), begin, each, sparse=True) if free else [each]
    return found


def _list_strengths(problem: Problem, nominal: Fit) -> list[float]:
    """ln of p_m to begin at, within its range."""
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    return sorted({min(max(nominal.log_p_m + math.log(factor), low), high) for factor in FACTORS})


def _start(problem: Problem, name: str, log_p_m: float, size: float, nominal: Fit) -> list[Fit]:
    """One amplitude at one strength, nuisances at their best; none beyond its limits, or where its runs fail."""
    low, high = problem.effects[name].amplitudes[0].limits
    if low < size < high:
        with suppress(LabsimError):
            begin = (log_p_m, {name: size})
            return [fit_hypothesis(problem, (name,), begin, nuisances=nominal, sparse=True, iterations=0)]
    return []


def fit_siblings(
    problem: Problem,
    nominal: Fit,
    fits: Sequence[Fit],
    sparse: Sequence[Fit],
    units: Mapping[str, float],
    open_places: Collection[str] = (),
    *,
    searched: set[str] | None = None,
    free: bool = False,
) -> list[Fit]:
    """The fits, and the other terms of their places, begun where the best formula with a term there ended and as large: which
    form a law has cannot be told about a p_m that is far from the truth's. MOST_TRIED of a place, as ``units`` has them in order.

    Places of the best formula, of those hardly told from it, and ``open_places``; until something explains the data all places
    that few runs (``sparse``) lead to, one after another: those that take no runs first, the dear ones last. ``free`` : those
    alone. The best has runs about itself once it is ahead of what few runs promise there, in the end MOST_REFINED of them.
    searched : places whose forms were tried, added to.
    """
    found, refined = list(fits), set[Hypothesis]()
    searched = set() if searched is None else searched
    while True:
        explained = _explains(found)
        best = find_leading(found or sparse, nominal)
        behind = ALIKE if explained else allow_behind(best.evidence, nominal)
        begun = _list_places(found or sparse, () if explained else sparse, units, behind)
        if explained:
            further = _list_places(sparse, (), units, math.inf)
            begun |= {
                place: further[place] for place in open_places if place in further and place not in begun
            }
        ranks = {each: _rank_place(problem, each) for each in begun if each not in searched}
        left = [each for each in ranks if ranks[each] == 0 or not free]
        place = min(left, key=lambda each: ranks[each], default=None)
        promised = max((begun[each][0].evidence for each in ranks if ranks[each] == 0), default=-math.inf)
        if found and not explained and best.evidence >= promised and best.hypothesis not in refined:
            found = _refine_leading(problem, found, 1, refined)
            continue
        if place is None:
            return found if free else _refine_leading(problem, found, MOST_REFINED, refined)
        searched.add(place)
        start, size = begun[place]
        known = {fit.hypothesis[0] for fit in found if len(fit.hypothesis) == 1}
        siblings: list[Fit] = []
        for name in _list_forms(place, units, known):
            begin = (start.log_p_m, {name: size * units[name]})
            with suppress(LabsimError):
                siblings.append(
                    fit_hypothesis(problem, (name,), begin, sparse=place != PEAKED, nuisances=start)
                )
            # where the wrong form led, the right one's runs may fail
            if place != PEAKED and not explained:
                top = max([nominal.evidence, *(fit.evidence for fit in siblings)])
                with suppress(LabsimError):
                    again = fit_from_strengths(problem, nominal, (name,), top)
                    siblings += [again] if again is not None else []
        found = take_better([*found, *_refine(problem, nominal, take_better(siblings), MOST_SIBLINGS, found)])


def _rank_place(problem: Problem, place: str) -> int:
    """When a place has its turn: those whose laws take no runs first, and last those that take most."""
    if place == PEAKED:
        return 2
    name = next(
        name for name, term in list_terms().items() if term.place == place and name in problem.effects
    )
    return 0 if problem.acts_on_projectile(name) or not problem.affects_simulation(name) else 1


def list_promises(unknown: UnknownFit) -> dict[str, float]:
    """ln evidence of the law of every place, left free there alone."""
    return {
        places[0]: unknown.evidences.get(name, -math.inf)
        for name, places in EMBEDDED.items()
        if len(places) == 1
    }


def list_open_places(unknown: UnknownFit) -> list[str]:
    """Places whose law, left free, explains about as much as that of the best place does: what stands there is a matter of its
    form, which is then tried."""
    alone = list_promises(unknown)
    ranked = sorted(alone, key=lambda place: -alone[place])
    return [place for place in ranked if alone[place] > alone[ranked[0]] - ALIKE]


def _is_ahead(fits: Sequence[Fit], best: Fit) -> bool:
    """Whether one of some fits is clearly better than another."""
    return any(fit.evidence > best.evidence + LEAST_GAIN for fit in fits)


def _explains(fits: Sequence[Fit]) -> bool:
    """Whether the best of some fits explains the data."""
    best = max(fits, key=lambda fit: fit.evidence, default=None)
    return best is not None and fit_p_value(best) >= REJECTED


def _list_places(
    fits: Sequence[Fit], sparse: Sequence[Fit], units: Mapping[str, float], behind: float
) -> dict[str, tuple[Fit, float]]:
    """Where siblings are looked for, in order: the best fit with a term at a place, and how large that is over its unit. behind :
    the best of ``fits`` by so much in ln evidence at most."""
    top = max((fit.evidence for fit in fits), default=math.inf)
    begun: dict[str, tuple[Fit, float]] = {}
    for fit in sorted((*fits, *sparse), key=lambda fit: -fit.evidence):
        for name in fit.hypothesis:
            if name in units and fit.evidence > top - behind:  # no listed cause
                begun.setdefault(list_terms()[name].place, (fit, fit.values[name] / units[name]))
    return begun


def _refine_leading(problem: Problem, fits: Sequence[Fit], most: int, refined: set[Hypothesis]) -> list[Fit]:
    """The fits, the best first; ``most`` of these, no more than ROUGH behind it, among runs about themselves where large."""
    ordered = sorted(fits, key=lambda fit: -fit.evidence)
    for k, fit in enumerate(ordered[:most]):
        if fit.hypothesis not in refined and fit.evidence > ordered[0].evidence - ROUGH:
            refined.add(fit.hypothesis)
            if list_large_effects(problem, fit):
                with suppress(LabsimError):
                    ordered[k] = refine(problem, fit)
    return sorted(ordered, key=lambda fit: -fit.evidence)


def take_better(fits: Sequence[Fit]) -> list[Fit]:
    """One fit of each hypothesis, that with most evidence."""
    found: dict[Hypothesis, Fit] = {}
    for fit in fits:
        if fit.hypothesis not in found or fit.evidence > found[fit.hypothesis].evidence:
            found[fit.hypothesis] = fit
    return list(found.values())


def _refine(
    problem: Problem, nominal: Fit, sparse: Sequence[Fit], most: int, known: Sequence[Fit] = ()
) -> list[Fit]:
    """Those that come as far as the best of them, and of what is ``known`` with runs of its own, but for what few runs leave
    open; ``most`` at most, with runs of their own."""
    top = max((fit.evidence for fit in (*sparse, *known)), default=0.0)
    rough = max(ROUGH, ROUGH_SHARE * (top - nominal.evidence))
    done = {fit.hypothesis for fit in known}
    near = [fit for fit in sparse if fit.evidence > top - rough and fit.hypothesis not in done]
    return [
        fit
        for each in sorted(near, key=lambda fit: -fit.evidence)[:most]
        for fit in _fit(problem, each.hypothesis, (each.log_p_m, each.values), each)
    ]


def _fit(
    problem: Problem,
    names: Hypothesis,
    start: tuple[float, Mapping[str, float]],
    known: Fit,
    *,
    sparse: bool = False,
) -> list[Fit]:
    """A formula fitted; none where its runs fail: it is no formula for this dust."""
    with suppress(LabsimError):
        return [fit_hypothesis(problem, names, start, nuisances=known, sparse=sparse)]
    return []


def choose_formulas(
    weighed: Sequence[tuple[Hypothesis, Marginal]], terms: Mapping[str, Term]
) -> list[tuple[Hypothesis, Marginal]]:
    """Those to simulate, best first: the first MOST_WEIGHED, and the best single term of every other place. What is weighed is
    linear about a p_m that may be far from the truth's, where a term of the right place stands behind pairs of wrong ones."""
    chosen = list(weighed[:MOST_WEIGHED])
    places = {terms[names[0]].place for names, _ in chosen if len(names) == 1}
    for names, marginal in weighed:
        if len(names) == 1 and terms[names[0]].place not in places:
            places.add(terms[names[0]].place)
            chosen.append((names, marginal))
    return chosen


def share_places(terms: Mapping[str, Term]) -> dict[str, float]:
    """ln prior of every term: all places are as likely as one another, however many terms somebody has thought of there."""
    places = [term.place for term in terms.values()]
    return {name: -math.log(places.count(term.place)) for name, term in terms.items()}


def share_hats(term: Term, law: FreeLaw) -> FloatArray:
    """Heights of the law's hats whose sum is nearest to the term. Its values at the knots are not: a film between two is lost."""
    places = term.sample(law.grid[0], max(law.knots))
    hats = [np.interp(places, law.grid, [float(place == knot) for place in law.grid]) for knot in law.knots]
    heights: FloatArray = np.linalg.lstsq(np.stack(hats, axis=1), shape_at(term, law, places), rcond=None)[0]
    return heights


def weigh_formulas(
    tangents: Tangents, terms: Mapping[str, Term], units: Mapping[str, float], limits: tuple[float, float]
) -> list[tuple[Hypothesis, Marginal]]:
    """Terms by themselves and in pairs, those with most evidence first; a pair only where it promises LEAST_GAIN over its better
    part, and over nothing. Coefficients are over ``units``; one on the wrong side of a limit is refused."""
    laws = {law.name: law for law in tangents.laws}
    columns = np.zeros((len(tangents.gram), 2 + len(terms)))
    columns[0, 0] = columns[1, 1] = 1.0
    for k, (name, term) in enumerate(terms.items(), start=2):
        if not term.acts.simulated:
            columns[tangents.names.index(name) + 1, k] = 1.0
            continue
        law = laws[term.place]
        for hat, share in zip(law.hats, share_hats(term, law) * units[name] / law.scale, strict=True):
            columns[tangents.names.index(hat) + 1, k] = share
    gram = columns.T @ tangents.gram @ columns
    reduced = replace(tangents, names=("ln_p_m", *terms), gram=gram)

    priors = share_places(terms)

    def weigh(names: Sequence[str]) -> tuple[float, Marginal]:
        each = [integrate(reduced, names, size, limits) for size in SIZES]
        evidence = log_mean([one.evidence for one in each]) + sum(priors[name] for name in names)
        return evidence, max(each, key=lambda one: one.evidence)

    def allowed(names: Sequence[str], marginal: Marginal) -> bool:
        signs = zip(names, marginal.coefficients[1:], strict=True)
        return all(terms[name].limits[0] < 0.0 if c < 0 else terms[name].limits[1] > 0.0 for name, c in signs)

    nothing, _ = weigh(())
    weighed: dict[Hypothesis, tuple[float, Marginal]] = {}
    for names in [(name,) for name in terms] + list(combinations(terms, 2)):
        evidence, marginal = weigh(names)
        parts = [weighed[part,][0] for part in names if (part,) in weighed]
        if allowed(names, marginal) and (len(names) == 1 or evidence > max([nothing, *parts]) + LEAST_GAIN):
            weighed[names] = evidence, marginal
    ranked = sorted(weighed, key=lambda names: -weighed[names][0])
    return [(names, weighed[names][1]) for names in ranked]
