"""``diagnose``: measured campaign in; what its simulation gets wrong, why, and what the extension is worth, out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial

import numpy as np

from ..errors import ExtrapolationError
from ..inference.calibrate import (
    prepare,
    sample_fit,
    warn_of_range,
    warn_unsettled,
    warn_unused_scans,
)
from ..inference.fits.fitting import DOUBTFUL, REJECTED, Fit, find_leading, fit_hypothesis, fit_p_value
from ..inference.fits.posterior import Posterior
from ..inference.fits.refine import list_large_effects, refine
from ..inference.free_fall import doubt_scales
from ..inference.measure import Measurements, measure
from ..inference.observations.linearised_drop import ErrorBudget
from ..inference.problem import Problem
from ..inference.scatter import (
    Scatter,
    ScatterEstimate,
    estimate_scatter,
    find_larger,
    fit_with,
    set_error_budget,
    weigh_least,
)
from ..inference.surface_rows import doubt_surface_rows
from ..records import Campaign, FloatArray
from ..runs.store import Progress, RunStore
from .average import average_p_m
from .explore import EXPLORED, ROUGH, explore, needs_exploration
from .gain import Gain, HeldOut, check_prediction, measure_gain, predict_held_out
from .judge import PREDICTED, PRIOR_UNKNOWN, TEMPERATURE, Verdict, find_class, judge, weigh_prior
from .misfit import Part, measure_misfit
from .next_experiment import Suggestion, suggest, suggest_between_formulas
from .pairs import confirm_pairs, refine_leading, return_to_singles
from .screen import CLOSE, HALF, NARROW, Score, Screening, draw_strengths, has_runs, list_confusable, screen
from .shapes import cause, lay_out_shapes, merge_variants
from .unlisted.free_law import Hats, fit_hats, simulate_hats, weigh_beside
from .unlisted.learned_law import LearnedLaw, learn_law
from .unlisted.unknown import UnknownFit, fit_unknown
from .untestable import Combination, Untestable, find_combination, list_untestable

WORTHWHILE = 0.5  # ln Bayes factor below which the linear screening is answer enough
MOST_RERUN = 4  # effects that cost runs, of the screening and of exploring
MOST_EXPLORED = 3
MOST_VARIANTS = 2  # of one cause in shape; the screening is answer enough for the others
MOST_REFINED = 2  # large effects with runs at three strengths and amplitudes about them


@dataclass(frozen=True)
class Judgement:
    """What is at work in a campaign, before any posterior is sampled. best : the fit that the verdict rests on.

    p_value : of the nominal model; predicted : of held-out drops with the best listed cause, or of all that it was fitted to
    where it fails there; 1 where neither was asked for.
    """

    campaign: Campaign
    problem: Problem
    nominal: Fit
    rivals: list[Fit]
    screening: Screening
    unknown: UnknownFit
    verdict: Verdict
    p_value: float
    predicted: float
    best: Fit

    @cached_property
    def alike(self) -> list[str]:
        """The cause named first and those from which these data cannot tell it; none where there are no others."""
        if self.verdict.word != "effect" or len(self.best.hypothesis) != 1:
            return []
        found = find_class(self.best, self.rivals, _list_rough(self.problem))
        return found if len(found) > 1 else []

    @property
    def leading(self) -> Fit:
        """The listed cause, or pair, that explains most; the nominal fit where none was fitted."""
        return find_leading(self.rivals, self.nominal)


@dataclass(frozen=True)
class Diagnosis(Judgement):
    """Everything diagnose found; report.tables writes it as diagnosis.json. p_m_averaged : (n,) draws over all causes, Pa.

    suggestions : further experiments, the best first, between the formulas of ``learned`` where several stand. untestable :
    beside what was found; combination : what is measured although they may be there. misfit : of the nominal fit, every
    observation, every drop and map. learned : what is missing as a formula, where nothing listed explains the data.
    """

    confusable: list[tuple[str, str, float]]
    untestable: list[Untestable]
    combination: Combination | None
    misfit: list[Part]
    learned: LearnedLaw | None
    held_out_nominal: HeldOut
    held_out_extended: HeldOut
    gain: Gain
    posterior_nominal: Posterior
    posterior_extended: Posterior
    p_m_averaged: FloatArray
    scatter: ScatterEstimate
    runs_new: int
    runs_reused: int
    wall: float
    suggestions: tuple[Suggestion, ...]
    warnings: tuple[str, ...]
    doubts: int = 0  # how many of the warnings, the first ones, are about p_m itself: nobody should read it without them

    def __repr__(self) -> str:
        causes, probability = self.verdict.probabilities[0]
        said = f"{self.verdict.word}, {' + '.join(causes)} with probability {probability:.3g}"
        return f"<Diagnosis of {self.campaign.name}: {said}>"


def judge_campaign(problem: Problem, nominal: Fit, *, seed: int = 1, known: Sequence[Fit] = ()) -> Judgement:
    """Screen, confirm, judge what ``prepare`` gives of a campaign. Raises LabsimError subclasses as its parts do.

    known : fits to the same data with other error terms, from which fits begin as well.
    """
    lay_out_shapes(problem)
    screening = screen(problem, nominal, np.random.default_rng(seed))
    p_value = min(1.0, 2.0 * min(screening.p_value, fit_p_value(nominal)))
    unknown = fit_unknown(problem, nominal)
    # the laws without a name are those of drops; how much they explain is how far a cause has to come
    failed = p_value < REJECTED and not problem.pushed and unknown.find_wobble(nominal) is None
    hats = None
    if failed and not problem.felt:
        hats, unknown = leave_law_free(problem, nominal)
    fits = confirm_singles(problem, nominal, screening)
    explored: dict[str, Fit] = {}
    if needs_exploration(problem, nominal, fits, screening, unknown.evidence):
        explored = explore(problem, nominal, screening, fits, unknown.evidence)
        fits = confirm_explored(problem, nominal, fits, explored, unknown.evidence)
    fits = confirm_known(problem, fits, known)
    fits = refine_best(problem, fits, unknown.evidence)
    rivals, screening = merge_variants(problem, nominal, fits, screening, explored)
    pairs = confirm_pairs(problem, nominal, rivals, screening, unknown.evidence)
    pairs = refine_leading(problem, rivals, pairs, unknown.evidence)
    rivals = return_to_singles(problem, rivals, pairs) + pairs
    leading = find_leading(rivals, nominal)
    predicted = 1.0
    if p_value < REJECTED and rivals:
        predicted = check_leading(problem, leading, np.random.default_rng(seed))
    if failed and problem.felt and not (rivals and min(fit_p_value(leading), predicted) >= DOUBTFUL):
        # two codes differ more in the force that accelerometers feel than such a law may say where a cause explains the data
        hats, unknown = leave_law_free(problem, nominal)
    if hats is not None and rivals:
        unknown = replace(unknown, beside=weigh_beside(hats, leading))
    verdict = judge(
        nominal,
        rivals,
        unknown.evidence,
        list(problem.effects),
        {score.name: score.log_bayes for score in screening.scores},
        predicted,
        _list_rough(problem),
        unknown.beside,
        1.0 if problem.pushed or problem.felt else TEMPERATURE,  # that was measured on films
    )
    first = verdict.probabilities[0][0]
    if first == ("unknown",):  # the nearest that the catalogue comes to it
        best = leading
    else:
        best = next((fit for fit in rivals if fit.hypothesis == first), nominal)
    return Judgement(
        problem.campaign, problem, nominal, rivals, screening, unknown, verdict, p_value, predicted, best
    )


def leave_law_free(problem: Problem, nominal: Fit) -> tuple[Hats, UnknownFit]:
    """Runs of every hat, and what is unknown with the laws that they leave free among the rest."""
    hats = simulate_hats(problem, nominal)
    return hats, fit_unknown(problem, nominal, fit_hats(problem, nominal, hats))


def _list_rough(problem: Problem) -> list[str]:
    """Causes that change runs, where accelerometers feel what they change."""
    return [name for name in problem.effects if problem.felt and problem.affects_simulation(name)]


def judge_scatters(
    campaign: Campaign, open_with: Callable[[ErrorBudget], tuple[Problem, Fit]], *, seed: int = 1
) -> Judgement:
    """Judge with the least scatter of samples, or with the larger one that the nominal model or the leading cause asks for.

    open_with : a problem and its nominal fit for a given error budget. A larger scatter is taken where the model that asks for it
    stands, with its prior and its evidence, before all that was found with the least one. The nominal model is asked first: where
    it then explains the data, and stands before all that tangents promise, nothing is looked for with the least one.
    """
    budget = set_error_budget(campaign)
    problem, nominal = open_with(budget)
    least = weigh_least(budget.scatter)
    asked = find_larger(least, problem, nominal)
    if asked is not None:
        _, loose = fit_with(asked, problem, nominal)
        reached = asked.log_prior + loose.evidence
        if not fails(loose) and reached > least.log_prior + _promise(problem, nominal, seed):
            return judge_campaign(*open_with(replace(budget, scatter=asked.value)), seed=seed)
    found = judge_campaign(problem, nominal, seed=seed)
    larger = _find_larger(found, least)
    if larger is None:
        return found
    return judge_campaign(*open_with(replace(budget, scatter=larger)), seed=seed, known=found.rivals)


def _find_larger(found: Judgement, least: Scatter) -> float | None:
    """The scatter with which the nominal model or the leading cause stands before all that was found with the least one."""

    def stand(fit: Fit) -> float:
        return weigh_prior(fit.hypothesis, list(found.problem.effects)) + fit.evidence

    unknown = math.log(PRIOR_UNKNOWN) + found.unknown.evidence
    best, value = least.log_prior + max(unknown, *map(stand, [found.nominal, *found.rivals])), None
    for fit in [found.nominal, found.leading][: 1 + bool(found.rivals)]:
        asked = find_larger(least, found.problem, fit)
        if asked is not None:
            reached = asked.log_prior + stand(fit_with(asked, found.problem, fit)[1])
            if reached > best:
                best, value = reached, asked.value
    return value


def _promise(problem: Problem, nominal: Fit, seed: int) -> float:
    """ln evidence that the best hypothesis may reach, by what costs next to nothing: tangents, and a law without a name."""
    best = screen(problem, nominal, np.random.default_rng(seed)).scores[:1]
    gains = [0.0, *(score.log_bayes / HALF for score in best)]
    return max(nominal.evidence + max(gains), fit_unknown(problem, nominal).evidence)


def diagnose_campaign(
    campaign: Campaign,
    store: RunStore,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    seed: int = 1,
    progress: Progress | None = None,
    use_scans: bool = True,
    cells: int | None = None,
    measurements: Measurements | None = None,
) -> Diagnosis:
    """Measure and calibrate, judge_campaign, and what follows from it: gain on held-out drops, posteriors without and with the
    extension."""
    began = time.perf_counter()
    seen = measurements or measure(campaign, workers=workers)

    def open_with(budget: ErrorBudget) -> tuple[Problem, Fit]:
        return prepare(
            campaign,
            store,
            budget=budget,
            workers=workers,
            scheduler=scheduler,
            progress=progress,
            use_scans=use_scans,
            cells=cells,
            measurements=seen,
        )

    found = judge_scatters(campaign, open_with, seed=seed)
    problem, nominal = found.problem, found.nominal
    best = allow_for_codes(problem, nominal, found.best)
    held_nominal, posterior = _predict(problem, nominal, seed, progress)
    held_best, extended = (
        (held_nominal, posterior) if found.best is nominal else _predict(problem, best, seed, progress)
    )
    warnings = [f"{name}: {reason}" for name, reason in problem.reasons.items() if "runs" in reason]
    warnings += warn_failed(problem)
    warnings += warn_unused_scans(problem)
    if found.p_value < REJECTED:
        warnings += doubt_surface_rows(seen.drops)
    if found.predicted < PREDICTED:
        lacks = "explain the data" if fails(found.leading) else "predict drops that no fit has seen"
        warnings.append(
            f"of the listed causes {' with '.join(found.leading.hypothesis)} explains most, but it does not {lacks} "
            f"(p = {found.predicted:.2g}): something that is not listed may be at work"
        )
    sampled = {fit.hypothesis: chain.calibrated for fit, chain in ((nominal, posterior), (best, extended))}
    rivals = [allow_for_codes(problem, nominal, fit) for fit in found.rivals]
    averaged = average_p_m(
        found.verdict,
        nominal,
        rivals,
        campaign.p_m_range,
        sampled=sampled,
        screened={
            (name,): partial(draw_between_codes, problem, found.screening, name)
            for name in found.screening.names
        },
        seed=seed,
    )
    about = best if found.verdict.word == "effect" else nominal
    untestable = list_untestable(problem, about)
    learned = None
    if found.verdict.word == "unknown":
        listed = [fit for fit in found.rivals if set(fit.hypothesis) <= set(found.leading.hypothesis)]
        learned = learn_law(problem, nominal, found.unknown, held_nominal, listed)
    wobble = found.unknown.find_wobble(nominal)
    if found.verdict.word == "unknown" and wobble is not None:
        warnings.append(
            f"p_m is {math.exp(wobble.log_p_m):.4g} Pa, to {100 * wobble.log_p_m_sigma:.1f} %, with the camera's wobble taken "
            "out; all other figures of p_m are without"
        )
    elif found.verdict.word == "unknown":
        measured = "p_m is not measured while the cause is unknown:"
        if learned is not None:
            log_p_m, sigma = learned.best.log_p_m
            measured = f"p_m is {math.exp(log_p_m):.4g} Pa, to {100 * sigma:.1f} %, with the formula that was learned;"
        warnings.append(
            f"{measured} {np.median(posterior.calibrated):.4g} Pa without, "
            f"{np.median(extended.calibrated):.4g} Pa with the nearest listed cause; neither's interval holds"
        )
    doubts = [f"nominal model: {text}" for text in warn_of_range(problem, nominal)]
    if best is nominal:  # one that fails has no best worth to be at
        doubts += [f"nominal model: {text}" for text in warn_unsettled(nominal)]
    doubted: list[tuple[Fit, list[str]]] = []
    if best is not nominal:
        doubted.append((best, warn_of_range(problem, best) + warn_unsettled(best)))
    named = {hypothesis for hypothesis, _ in found.verdict.named} - {best.hypothesis}
    doubted += [(fit, warn_unsettled(fit)) for fit in found.rivals if fit.hypothesis in named]
    if learned is not None:
        law = learned.best.fit
        doubted.append((law, warn_of_range(learned.problem, law) + warn_unsettled(law)))
    doubts += [f"with {' + '.join(fit.hypothesis)}: {text}" for fit, texts in doubted for text in texts]
    doubts += doubt_scales(seen.drops)
    return Diagnosis(
        **{each.name: getattr(found, each.name) for each in fields(Judgement)},
        confusable=list_confusable(found.screening),
        untestable=untestable,
        combination=find_combination(problem, about, untestable),
        misfit=measure_misfit(problem, nominal),
        learned=learned,
        held_out_nominal=held_nominal,
        held_out_extended=held_best,
        gain=measure_gain(held_nominal, held_best),
        posterior_nominal=posterior,
        posterior_extended=extended,
        p_m_averaged=averaged,
        scatter=estimate_scatter(problem, best),
        suggestions=tuple(suggest_next(found, learned)),
        runs_new=store.new,
        runs_reused=store.reused,
        wall=time.perf_counter() - began,
        warnings=(*doubts, *warnings),
        doubts=len(doubts),
    )


def suggest_next(found: Judgement, learned: LearnedLaw | None) -> list[Suggestion]:
    """Experiments that tell the formulas of a learned law apart where several stand, else the causes."""
    if learned is not None:
        with suppress(ExtrapolationError):  # one of the formulas cannot be simulated in what is planned
            if between := suggest_between_formulas(learned):
                return between
    return suggest(found.problem, [found.nominal, *found.rivals], dict(found.verdict.probabilities))


def allow_for_codes(problem: Problem, nominal: Fit, fit: Fit) -> Fit:
    """Let p_m beside a cause of the material be what another code would say: codes differ in what such a cause does by a share of
    that, and p_m makes up for it (docs/error-budget.md)."""
    if not any(problem.effects[name].kind == "material" for name in fit.hypothesis):
        return fit
    beside = spread_between_codes(problem, abs(fit.log_p_m - nominal.log_p_m))
    return replace(fit, between_codes=float(beside))


def spread_between_codes(problem: Problem, moved: float | FloatArray) -> FloatArray:
    """Standard deviation of ln p_m between codes, beside a cause of the material that has moved it by so much."""
    return np.hypot(problem.budget.other_codes, problem.budget.change_of_strength * moved)


def draw_between_codes(
    problem: Problem, screening: Screening, name: str, count: int, rng: np.random.Generator
) -> FloatArray:
    """Draws (count,) of ln p_m with an effect that was only screened, as another code would say them."""
    drawn = draw_strengths(problem, screening, name, count, rng)
    of_material = problem.effects[name].kind == "material"
    spread = spread_between_codes(problem, of_material * np.abs(drawn - screening.log_p_m))
    return drawn + spread * rng.standard_normal(count)


def check_leading(problem: Problem, leading: Fit, rng: np.random.Generator) -> float:
    """p value of held-out drops with the leading cause, or of the data that it was fitted to where it fails there."""
    predicted = check_prediction(problem, leading, rng)
    return min(predicted, fit_p_value(leading)) if fails(leading) else predicted


def fails(fit: Fit) -> bool:
    """Whether a hypothesis does not explain the data that it was fitted to."""
    return fit_p_value(fit) < REJECTED


def _predict(problem: Problem, fit: Fit, seed: int, progress: Progress | None) -> tuple[HeldOut, Posterior]:
    """What follows from a fit: of held-out drops, of its parameters."""
    return predict_held_out(problem, fit), sample_fit(problem, fit, seed=seed, progress=progress)


def warn_failed(problem: Problem) -> list[str]:
    """Of every cause that no verdict knows of: of one projectile at least, no run with it stopped, on either side of its null."""
    return [
        f"{name}: is not judged, since its runs fail; see labsim runs"
        for name, effect in problem.effects.items()
        if effect.amplitudes
        and problem.affects_simulation(name)
        and cause(name) == name
        and not has_runs(problem, name)
    ]


def confirm_singles(problem: Problem, nominal: Fit, screening: Screening) -> list[Fit]:
    """Re-simulate the effects that the screening cannot exclude; those of the measurement cost nothing and are all fitted."""
    if not screening.scores:
        return []
    free = [score for score in screening.scores if not problem.affects_simulation(score.name)]
    fits = [_fit_from_score(problem, nominal, score) for score in free]
    top = max([screening.scores[0].log_bayes, *(fit.evidence - nominal.evidence for fit in fits)])

    def least(score: Score) -> float:
        explored = problem.effects[score.name].kind in EXPLORED
        return top - CLOSE if explored else min(top - CLOSE, HALF * top)

    costly = [
        score
        for score in screening.scores
        if problem.affects_simulation(score.name)
        and score.log_bayes > max(least(score), WORTHWHILE)
        # finer runs for a suspicion of coarseness only where nothing else explains as much
        and (problem.effects[score.name].kind != "numerics" or score is screening.scores[0])
    ][:MOST_RERUN]
    for score in costly:
        variants = sum(cause(fit.hypothesis[0]) == cause(score.name) for fit in fits)
        if score.log_bayes < least(score) or variants >= MOST_VARIANTS:  # far behind by now
            continue
        with suppress(ExtrapolationError):  # its runs lead nowhere: no candidate
            fits.append(_fit_from_score(problem, nominal, score))
            top = max(top, fits[-1].evidence - nominal.evidence)
    return fits


def confirm_explored(
    problem: Problem, nominal: Fit, fits: list[Fit], explored: dict[str, Fit], log_evidence_unknown: float
) -> list[Fit]:
    """The fits with those joined, or replaced, that start from the best of exploring.

    One that gains less than HALF of what a law without a name (``log_evidence_unknown``, its ln evidence) does is not worth
    more runs.
    """
    known = {fit.hypothesis[0]: fit for fit in fits}
    top = max([nominal.evidence, *(fit.evidence for fit in [*fits, *explored.values()])])
    worth = nominal.evidence + HALF * (log_evidence_unknown - nominal.evidence)
    ranked = sorted(explored, key=lambda name: -explored[name].evidence)
    for name in [name for name in ranked if explored[name].evidence > top - ROUGH][:MOST_EXPLORED]:
        fit = start = explored[name]
        if start.evidence > worth:
            try:
                fit = fit_hypothesis(problem, (name,), (start.log_p_m, start.values), nuisances=start)
            except ExtrapolationError:
                continue
        if name not in known or fit.evidence > known[name].evidence:
            known[name] = fit
    return list(known.values())


def confirm_known(problem: Problem, fits: list[Fit], known: Sequence[Fit]) -> list[Fit]:
    """The fits with those joined, or replaced, that start from the best of ``known``."""
    best = {fit.hypothesis[0]: fit for fit in fits}
    singles = [
        each for each in known if len(each.hypothesis) == 1 and problem.affects_simulation(each.hypothesis[0])
    ]
    top = max((each.evidence for each in singles), default=0.0)
    for start in singles:
        name = start.hypothesis[0]
        if start.evidence > top - CLOSE:
            with suppress(ExtrapolationError):
                fit = fit_hypothesis(problem, (name,), (start.log_p_m, start.values))
                if name not in best or fit.evidence > best[name].evidence:
                    best[name] = fit
    return list(best.values())


def refine_best(problem: Problem, fits: list[Fit], log_evidence_unknown: float) -> list[Fit]:
    """The fits with the best of those that are large made once more with runs at three strengths and amplitudes about them.

    One or two lead there; what tells two large effects apart is how they bend with p_m. Where a law without a name
    (``log_evidence_unknown``, its ln evidence) is far ahead of all, none is worth the runs.
    """
    least = max([log_evidence_unknown - CLOSE, *(fit.evidence - NARROW for fit in fits)])
    settled: list[Fit] = []
    again: set[str] = set()  # one variant of a cause
    for fit in sorted(fits, key=lambda fit: -fit.evidence):
        name = fit.hypothesis[0]
        if (
            len(again) < MOST_REFINED
            and cause(name) not in again
            and fit.evidence > least
            and list_large_effects(problem, fit)
        ):
            again.add(cause(name))
            with suppress(ExtrapolationError):
                fit = refine(problem, fit)
        settled.append(fit)
    return settled


def _fit_from_score(problem: Problem, nominal: Fit, score: Score) -> Fit:
    reach = 2 * abs(problem.effects[score.name].amplitudes[0].step)
    start = float(np.clip(score.amplitude, -reach, reach))
    fit = fit_hypothesis(problem, (score.name,), (nominal.log_p_m, {score.name: start}))
    if fit.log_likelihood > nominal.log_likelihood:
        return fit
    # the best is no less likely than null, which it holds: from a far start the fit has ended at a limit
    again = fit_hypothesis(problem, (score.name,), (nominal.log_p_m, {score.name: 0.0}), nuisances=nominal)
    return max(fit, again, key=lambda each: each.evidence)
