"""calibration.json and diagnosis.json of a campaign with tracks and scans, and the lines that people read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..calibrated import find_parameter, show_parameter
from ..diagnosis.campaign import Diagnosis
from ..diagnosis.gain import Gain
from ..diagnosis.judge import MOST_NAMED
from ..diagnosis.misfit import say_misfit
from ..effects import Effect
from ..effects.model import Model
from ..effects.terms import Law
from ..inference.calibrate import Calibration
from ..inference.fits.fitting import Fit
from ..inference.fits.posterior import Posterior
from ..inference.problem import Problem
from ..inference.published.calibrate import summarise
from ..records import Campaign, FloatArray
from ..sph import solver_hash
from .pages.law_words import (
    comes_nearest,
    describe_learned,
    describe_unknown,
    say_learned,
    say_missing,
    say_nearest,
)
from .pages.phrases import (
    CERTAIN,
    say_amount,
    say_combination,
    say_hypothesis,
    say_interval,
    say_probability,
    shown_unit,
    state_p_value,
)
from .pages.remedies import say_remedy

NUMERICAL_DEPTH = (
    0.0033  # rms left of nine depths against an independent solver at DEFAULT_CELLS, docs/other-methods.md
)

MOST_SAID = 3  # causes that are not testable, on one line


def list_samples(problem: Problem, fit: Fit) -> dict[str, float]:
    """The calibrated strength of each sample, as its drop shows it, in the unit of the common one, with what the fit's effects
    change of it; none of samples that several instruments recorded, which have it in common."""
    tracks, scatters, offsets = problem.tracks, fit.drops.scatters, problem.log_offsets(fit.values)
    instants = tracks.instants(fit.nuisances[0])
    return {
        model.observed.drop.sample: math.exp(fit.log_p_m + offsets[model.observed.name] + instant.strength)
        for model, instant, scatter in zip(tracks.models, instants, scatters, strict=True)
        if scatter > 0.0
    }


def campaign_calibration_summary(found: Calibration) -> dict[str, Any]:
    """calibration.json."""
    first, *others = found.posterior.names
    return {
        "campaign": found.campaign.name,
        first: summarise(found.posterior.calibrated),
        "calibrated": _name_calibrated(found.campaign, found.posterior.calibrated),
        "parameters": {name: summarise(found.posterior.samples(name)) for name in others},
        "r_hat": found.posterior.r_hat,
        "ess": found.posterior.ess,
        "chi_square": found.fit.chi_square,
        "points": found.fit.points,
        "p_value": found.p_value,
        "scatter": found.scatter.summarise(),
        "samples": list_samples(found.problem, found.fit),
        "error_budget": asdict(found.problem.budget),
        "runs_new": found.runs_new,
        "runs_reused": found.runs_reused,
        "wall_s": found.wall,
        "solver": solver_hash(found.campaign.material.law),
        "warnings": list(found.warnings),
    }


def _name_calibrated(campaign: Campaign, samples: FloatArray) -> dict[str, Any]:
    """What is calibrated, whatever the law."""
    name, unit = find_parameter(campaign.material.law)
    return {"name": name, "unit": unit, **summarise(samples)}


def say_calibrated(campaign: Campaign, value: float) -> str:
    """``1.35 kPa``: a value (SI) of what is calibrated, as people see it."""
    _, unit, factor = show_parameter(campaign.material.law)
    return f"{value * factor:.3g} {unit}"


def say_records(problem: Problem) -> str:
    """``drops`` or ``pushes``."""
    return "pushes" if problem.pushed else "drops"


def say_count(problem: Problem) -> str:
    """``1 drop``, ``25 pushes``."""
    count, records = len(problem.tracks.samples), say_records(problem)
    return f"{count} {records if count != 1 else 'push' if records == 'pushes' else 'drop'}"


def campaign_calibration_lines(found: Calibration) -> str:
    q, (label, unit, factor) = (
        summarise(found.posterior.calibrated),
        show_parameter(found.campaign.material.law),
    )
    mean, sd, low, high = (q[key] * factor for key in ("mean", "sd", "q05", "q95"))
    scans = len(found.problem.scans)
    others = [each.name for each in found.problem.observations if each.kind not in ("drops", "map")]
    beside = "".join(f", {name}" for name in others)
    lines = [
        *_say_doubts(found),
        f"{found.campaign.name}: {label} = {mean:.3f} ± {sd:.3f} {unit} (90 %: {low:.3f} to {high:.3f} {unit})",
    ]
    for name in found.posterior.names[1:]:
        q = summarise(found.posterior.samples(name))
        lines.append(f"  {name} = {q['mean']:.4g} ± {q['sd']:.2g}")
    lines += [
        f"  {say_count(found.problem)}, {scans} scan{'s' * (scans != 1)}{beside}; χ² {found.fit.chi_square:.0f} for "
        f"{found.fit.points} data ({state_p_value(found.p_value)})",
        f"  scatter of ln {label} from sample to sample {found.scatter.mean:.3f} ± {found.scatter.sd:.3f}"
        f" ({found.problem.budget.scatter:.2g} in use)",
        f"  R-hat {found.posterior.r_hat:.3f}, {found.posterior.ess:.0f} independent samples; "
        f"{found.runs_new} new runs, {found.runs_reused} from the store, {found.wall:.0f} s",
    ]
    return "\n".join([*lines, *(f"  warning: {text}" for text in found.warnings[found.doubts :])])


def _say_doubts(found: Calibration | Diagnosis) -> list[str]:
    """The warnings that stand before the result: who reads the first line only reads these."""
    return [f"warning: {text}" for text in found.warnings[: found.doubts]]


def _quantiles(posterior: Posterior, name: str) -> dict[str, float]:
    q05, q50, q95 = np.quantile(posterior.samples(name), [0.05, 0.5, 0.95])
    return {"q05": float(q05), "q50": float(q50), "q95": float(q95)}


def state_numerical_error(problem: Problem) -> dict[str, float]:
    """Of the simulated depth, and the spacing (m) of the smallest tip."""
    radii = [group.projectile.tip_radius for group in problem.groups if not group.is_scan]
    return {"depth_relative": NUMERICAL_DEPTH, "spacing_m": min(radii) / problem.grid.cells}


def campaign_diagnosis_summary(found: Diagnosis) -> dict[str, Any]:
    """diagnosis.json, with the contract's keys."""
    fits = {fit.hypothesis: fit for fit in found.rivals}
    causes = []
    for hypothesis, probability in found.verdict.probabilities:
        parameters: dict[str, Any] = {}
        fit = fits.get(hypothesis)
        if fit is not None:
            for k, name in enumerate(hypothesis, start=1):
                parameter = found.problem.effects[name].amplitudes[0]
                value, sigma = parameter.null + fit.values[name], math.sqrt(fit.covariance[k, k])
                full = f"{name}.{parameter.name}"
                low, high = parameter.limits
                if fit is found.best and full in found.posterior_extended.names:
                    entry = _quantiles(found.posterior_extended, full)
                else:
                    entry = {
                        "q05": float(np.clip(value - 1.645 * sigma, low, high)),
                        "q50": value,
                        "q95": float(np.clip(value + 1.645 * sigma, low, high)),
                    }
                parameters[full] = {**entry, "unit": parameter.unit}
        cause = {"causes": list(hypothesis), "probability": probability, "parameters": parameters}
        if fit is not None:
            cause["step_left_sigma"] = fit.unsettled  # of a fit at its best: nought
        if hypothesis == ("unknown",):
            cause["free_law"] = describe_unknown(found)
        causes.append(cause)
    gain = found.gain
    unit = "" if found.problem.pushed else "_m"  # of a push what is left is relative
    return {
        "format": 1,
        "campaign": found.campaign.name,
        "verdict": found.verdict.word,
        "remedy": say_remedy(found, found.suggestions),
        "p_value": found.p_value,
        "causes": causes,
        "inclusion_probability": {
            name: total for name, total in found.verdict.inclusion.items() if total >= 1e-4
        },
        "named": [list(hypothesis) for hypothesis, _ in found.verdict.named],
        "classes": [found.alike] if found.alike else [],
        "confusable": [[first, second, round(cosine, 4)] for first, second, cosine in found.confusable],
        "law": describe_learned(found),
        "misfit": [asdict(part) for part in found.misfit],
        "not_testable": [
            {
                "cause": each.name,
                "trace_sigma": each.trace,
                "value": list(each.values),
                "unit": found.problem.effects[each.name].amplitudes[0].unit,
                found.posterior_nominal.names[0]: list(each.p_m),
            }
            for each in found.untestable
        ],
        "well_determined": found.combination
        and {
            "expression": found.combination.expression,
            "value": found.combination.value,
            "sigma": found.combination.value * found.combination.sigma,
        },
        found.posterior_nominal.names[0]: {
            "nominal": summarise(found.posterior_nominal.calibrated),
            "extended": summarise(found.posterior_extended.calibrated),
            "over_causes": summarise(found.p_m_averaged),
        },
        "calibrated": _name_calibrated(found.campaign, found.p_m_averaged),
        "gain": {
            f"rms_nominal{unit}": gain.rms_nominal,
            f"rms_extended{unit}": gain.rms_extended,
            f"rms_noise{unit}": gain.rms_noise,
            "log_score_difference": gain.log_score_difference,
            "log_score_difference_sigma": gain.log_score_difference_sigma,
            "fraction_of_discrepancy_removed": gain.fraction_removed,
            "p_value": found.predicted,
            "extension": list(found.best.hypothesis),
            "drops": [
                {"name": name, f"rms_nominal{unit}": float(a), f"rms_extended{unit}": float(b)}
                for name, a, b in zip(
                    found.held_out_nominal.names,
                    found.held_out_nominal.rms,
                    found.held_out_extended.rms,
                    strict=True,
                )
            ],
        },
        "next_experiment": [
            {
                "change": each.text,
                "information_bits": each.information_bits,
                "predictions": [
                    {"cause": cause, **expected.summarise()} for cause, expected in each.predictions
                ],
            }
            for each in found.suggestions
        ],
        "numerical_error": state_numerical_error(found.problem),
        "scatter": found.scatter.summarise(),
        "samples": list_samples(found.problem, found.best),
        "error_budget": asdict(found.problem.budget),
        "runs_new": found.runs_new,
        "runs_reused": found.runs_reused,
        "wall_s": found.wall,
        "solver": solver_hash(found.campaign.material.law),
        "warnings": list(found.warnings),
    }


LEADS = {
    "sample": "The sample is not as stated",
    "measurement": "The measurement is off",
    "numerics": "The simulation's numerics are off",
}  # by kind of cause; of all others the simulation is wrong


def say_verdict(found: Diagnosis) -> str:
    """The verdict as a laboratory can act on it, in two sentences; numbers are medians of the posteriors."""
    best, probability = found.verdict.probabilities[0]
    if found.verdict.word == "unknown":
        missing = say_nearest(found) if comes_nearest(found) else f"what is missing {say_missing(found)}"
        return (
            "The simulation is wrong in a way that no listed cause explains (probability "
            f"{say_probability(probability)}): {missing}."
        )
    label, _, _ = show_parameter(found.campaign.material.law)
    nominal = say_calibrated(found.campaign, float(np.median(found.posterior_nominal.calibrated)))
    if found.verdict.word == "none":
        return (
            f"The nominal simulation explains these data at {label} = {nominal} "
            f"(probability {say_probability(probability)}); nothing in the catalogue is needed."
        )
    kinds = {found.problem.effects[name].kind for name in best}
    lead = LEADS.get(next(iter(kinds)), "") if len(kinds) == 1 else ""
    causes = ", and ".join(_say_cause(found, name) for name in best)
    beside = [(h, p) for h, p in found.verdict.named[1:] if set(best) < set(h)]
    alike = [(name,) for name in found.alike if name not in best]
    others = [(h, p) for h, p in found.verdict.named[1:] if (h, p) not in beside and h not in alike]
    apart = " or ".join(f"{say_hypothesis(h)} ({say_probability(p)})" for h, p in others)
    hardly = f", hardly told from {apart}" if apart else ""
    sure = say_probability(probability)
    if beside:  # the cause is there either way
        partners = " or ".join(
            f"{_say_titles(found, [name for name in h if name not in best])} ({say_probability(p)})"
            for h, p in beside
        )
        sure = (
            f"{say_probability(found.verdict.of_first)}, alone ({sure}) or beside another cause: {partners}"
        )
    if alike:
        together = say_probability(probability + sum(p for h, p in found.verdict.probabilities if h in alike))
        names = " and ".join(map(say_hypothesis, alike))
        sure += f", and {together} together with {names}, from which these data cannot tell it"
    extended = say_calibrated(found.campaign, float(np.median(found.posterior_extended.calibrated)))
    moved = f"is {extended} instead of {nominal}" if extended != nominal else f"stays {extended}"
    if found.verdict.of_first < 0.5:
        lead = "These data do not decide; most probable"
    return (
        f"{lead or 'The simulation is wrong'}: {causes}; probability {sure}{hardly}. With it, {label} "
        f"{moved}, and {say_gain(found.gain, say_records(found.problem))}."
    )


LISTED_NOWHERE = {
    "none": "the simulation as it stands explains the data",
    "unknown": "something that no listed cause explains",
}


def _say_titles(found: Diagnosis, names: Sequence[str]) -> str:
    titles = [
        found.problem.effects[name].title if name in found.problem.effects else LISTED_NOWHERE[name]
        for name in names
    ]
    return " and ".join(f"{title[0].lower()}{title[1:]}" for title in titles)


def _say_cause(found: Diagnosis, name: str) -> str:
    """``the pixels are larger than stated (factor 1.06, 90 %: 1.05 to 1.07)``."""
    effect = found.problem.effects[name]
    if not effect.amplitudes:
        return effect.title[0].lower() + effect.title[1:]
    parameter = effect.amplitudes[0]
    q = _quantiles(found.posterior_extended, f"{name}.{parameter.name}")
    factor, unit = shown_unit(parameter)
    middle, low, high = say_interval(*(q[key] * factor for key in ("q50", "q05", "q95")))
    amount = f"{parameter.name.replace('_', ' ')} {middle} {unit}".rstrip() + f", 90 %: {low} to {high}"
    # eta s^n says nothing without n; a shape of nought is none
    for shape in (each for each in effect.parameters if each.shape and each.null != 0.0):
        amount += f"; {shape.name.replace('_', ' ')} {say_amount(shape, shape.null)}"
    title = effect.say(q["q50"])
    return f"{title[0].lower()}{title[1:]} ({amount})"


def say_gain(gain: Gain, records: str = "drops") -> str:
    """What held-out drops, or pushes, say of the extension, in words."""
    if math.isnan(gain.rms_nominal):
        return f"a single {'push' if records == 'pushes' else 'drop'} leaves none to hold out"
    if gain.rms_nominal <= gain.rms_noise and records != "drops":
        return f"held-out {records} were predicted within the noise without it"
    if gain.rms_nominal <= gain.rms_noise:
        return "held-out drops, whose own free fall fixes contact and speed, were predicted within the noise without it"
    before, after, noise = (
        f"{1e2 * each:.1f} %" if records == "pushes" else f"{1e6 * each:.3g} µm"
        for each in (gain.rms_nominal, gain.rms_extended, gain.rms_noise)
    )
    return f"held-out {records} are missed by {after} instead of {before} ({noise} are expected)"


def campaign_diagnosis_lines(found: Diagnosis) -> str:
    label, unit, factor = show_parameter(found.campaign.material.law)
    lines = [*_say_doubts(found), say_verdict(found), say_remedy(found, found.suggestions), ""]
    lines.append("  probability  cause")
    worth = [each for each in found.verdict.probabilities if each[1] >= 5e-4][:6]
    wide = max((len(" + ".join(hypothesis)) for hypothesis, _ in worth), default=0)
    for hypothesis, probability in worth:
        words = _say_titles(found, hypothesis)
        lines.append(f"  {probability:11.3f}  {' + '.join(hypothesis):{wide}}  {words}".rstrip())
    if others := found.verdict.probabilities[len(worth) :]:
        lines.append(f"  {sum(p for _, p in others):11.3f}  the {len(others)} others together")
    if found.verdict.word != "unknown" and found.verdict.probabilities[0][1] < CERTAIN:
        low, high = np.quantile(found.p_m_averaged, [0.05, 0.95]) * factor
        lines.append(f"  {label} whichever of these holds: {low:.2f} to {high:.2f} {unit} (90 %)")
    gain = found.gain
    shown, of_shown = (100.0, "%") if found.problem.pushed else (1e6, "µm")
    nearest = "the nearest listed cause, " if found.verdict.word == "unknown" else ""
    lines.append(
        f"  held-out {say_records(found.problem)}: rms {gain.rms_nominal * shown:.1f} {of_shown} nominal, "
        f"{gain.rms_extended * shown:.1f} {of_shown} with "
        f"{nearest}{' + '.join(found.best.hypothesis) or 'nothing added'}, {gain.rms_noise * shown:.1f} {of_shown} expected; "
        f"ln score "
        f"{gain.log_score_difference:+.1f} ± {gain.log_score_difference_sigma:.1f}"
    )
    lines.append(
        f"  nominal model: {state_p_value(found.p_value)}; scatter between samples {found.scatter.mean:.3f} of ln {label}"
    )
    if missed := say_misfit(found.misfit):
        lines.append(f"  the nominal model {missed}")
    for first, second, cosine in found.confusable[:4]:
        lines.append(f"  hard to tell apart here: {first} and {second} (cosine {cosine:+.2f})")
    lines += [f"  {text}" for text in say_learned(found)]
    lines += _say_untestable(found)
    if found.suggestions:
        best = found.suggestions[0]
        lines.append(f"  next experiment: {best.text} ({best.bits})")
        lines += [f"    {cause} expects {each.text}" for cause, each in best.predictions[:MOST_NAMED]]
    lines.append(f"  {found.runs_new} new runs, {found.runs_reused} from the store, {found.wall:.0f} s")
    return "\n".join([*lines, *(f"  warning: {text}" for text in found.warnings[found.doubts :])])


def _say_untestable(found: Diagnosis) -> list[str]:
    """Causes that could be there unseen, where they would move p_m by more than its error; and what holds all the same."""
    if found.combination is None:
        return []
    label, unit, factor = show_parameter(found.campaign.material.law)
    named = [
        f"{each.name} ({label} would be {each.p_m[0] * factor:.3g} to {each.p_m[1] * factor:.3g} {unit})"
        for each in found.untestable[:MOST_SAID]
    ]
    further = len(found.untestable) - MOST_SAID
    more = f", and {further} more" if further > 0 else ""
    return [
        f"  not testable here: {', '.join(named)}{more}",
        f"  what holds all the same: {say_combination(found.combination)}",
    ]


def _state_effects(
    fit: Fit, effects: Sequence[Effect], problem: Problem
) -> tuple[tuple[str, dict[str, float]], ...]:
    """Effects as a model.toml holds them: all their parameters, at the amplitudes of a fit."""
    return tuple(
        (effect.name, effect.at(problem.at(effect.name, fit.values[effect.name]))) for effect in effects
    )


def extended_model(found: Diagnosis) -> Model:
    """The extension as model.toml holds it: the cause, or the law that was learned in its place."""
    if found.verdict.word == "unknown" and found.learned is not None:
        learned = found.learned.best
        terms = tuple(
            (term.name, float(c)) for term, c in zip(learned.terms, learned.coefficients, strict=True)
        )
        listed = _state_effects(learned.fit, learned.causes, found.problem)
        return Model(math.exp(learned.fit.log_p_m), listed, law=Law(terms))
    fit = found.best if found.verdict.word == "effect" else found.nominal
    effects = _state_effects(fit, [found.problem.effects[name] for name in fit.hypothesis], found.problem)
    wobble = found.unknown.find_wobble(found.nominal) if found.verdict.word == "unknown" else None
    log_p_m = wobble.log_p_m if wobble is not None else fit.log_p_m
    return Model(p_m=math.exp(log_p_m), effects=effects, matter=Path(found.campaign.material.law).stem)
