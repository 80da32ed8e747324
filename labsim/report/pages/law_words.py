"""What is said of the law that an unknown cause would have to be: a phrase for the verdict, numbers for diagnosis.json."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from ...diagnosis.campaign import Diagnosis
from ...diagnosis.judge import PREDICTED
from ...diagnosis.unlisted.free_law import EMBEDDED, RecoveredLaw
from ...diagnosis.unlisted.hats import shape_at
from ...diagnosis.unlisted.learned_law import Formula
from ...diagnosis.unlisted.wobble import Wobble
from ...effects import Effect
from ...effects.law_places import FORCE, MASS, SHEAR, SIGMA, WHERE
from .page import show_number
from .phrases import say_hypothesis, shown_unit, state_p_value

MISSING = {
    "depth and speed": "a law of depth and speed, about {size} % of the depth",
    "drop": "something that changes from drop to drop, about {size} % of the depth",
    "undisturbed dust": "a layering of the dust that was there before the drop",
    "depth and speed and undisturbed dust": "a layering of the dust that was there before the drop, and a law of depth and "
    "speed, about {size} % of the depth",
}
POINTS = 41  # of a curve in diagnosis.json
CLEAR = 2.0  # standard deviations from which a further law of several is named


def is_embedded(found: Diagnosis) -> bool:
    """Whether the best free law stands in the equations of motion."""
    return found.unknown.block in EMBEDDED


def say_missing(found: Diagnosis) -> str:
    """What the unnamed law of the best fit does, or depends on, and how large it is; after ``what is missing``."""
    unknown, parts = found.unknown, found.misfit
    missed = [part.name for part in parts if part.missed]
    if missed and not any(part.missed for part in parts if part.kind == "drops"):
        return f"shows in {' and '.join(missed)} alone: p_m explains the drops"
    if found.learned is not None:
        equation = say_equation(found.learned.best)
        return f"is like {say_formula(found.learned.best)}" + (f", so that {equation}" if equation else "")
    wobble = unknown.find_wobble(found.nominal)
    if wobble is not None:
        return (
            f"looks like a camera that wobbles by {_say_swing(wobble)} at {wobble.frequency:.0f} Hz, in flight and in the dust "
            "alike"
        )
    if not is_embedded(found):
        return "looks like " + MISSING.get(unknown.block, unknown.block).format(
            size=f"{100 * unknown.size:.0f}"
        )
    first, *rest = _rank(found)
    further = [f"a {law.law.name}" for law in rest if _clearness(law) > CLEAR]
    return f"acts like {say_law(first)}" + (f" (with parts of {' and '.join(further)})" if further else "")


def comes_nearest(found: Diagnosis) -> bool:
    """Whether a listed cause explains more than any law without a name, or that was learned, and is set back because held-out
    drops are missed, or a law on top of it explains more."""
    learned = found.learned.best.fit.evidence if found.learned is not None else -math.inf
    set_back = found.predicted < PREDICTED or found.unknown.beside > 0.0
    return set_back and found.best.evidence > max(found.unknown.evidence, learned)


def say_nearest(found: Diagnosis) -> str:
    """That cause, and what sets it back."""
    lacks = f"does not predict drops that no fit has seen ({state_p_value(found.predicted)})"
    if found.predicted >= PREDICTED:
        lacks = f"a law left free on top of it explains more (by {found.unknown.beside:.1f} in ln evidence)"
    return f"{say_hypothesis(found.best.hypothesis)} comes nearest, but {lacks}"


def size_of_missing(found: Diagnosis) -> tuple[str, str] | None:
    """Value and words for a tile: the formula and its places, the clearest knot of an embedded law, the swing of a camera, or the
    share of the depth."""
    if found.learned is not None:
        best = found.learned.best
        places = " and ".join(dict.fromkeys(term.place for term in best.terms))
        beside = "".join(f", beside {effect.name.replace('_', ' ')}" for effect in best.causes)
        return " + ".join(_say_terms(best)), places + beside
    if is_embedded(found):
        law = _rank(found)[0]
        _, value, sigma = clearest(law)
        return _say_size(law, value, sigma, "+"), f"{law.law.place.shown} {_say_place(law)}"
    wobble = found.unknown.find_wobble(found.nominal)
    if wobble is not None:
        return _say_swing(wobble), f"of the camera, at {wobble.frequency:.0f} Hz"
    if "depth" in MISSING.get(found.unknown.block, ""):
        return f"≈ {100 * found.unknown.size:.0f} %", "of the depth"
    return None


def say_law(law: RecoveredLaw) -> str:
    """Its clearest knot: 12 ± 3 % more strength at a filling factor of 0.18, a force upwards of 205 ± 30 Pa at a depth of 1 tip
    radius."""
    _, value, sigma = clearest(law)
    shown, where = law.law.place.shown, _say_place(law)
    if law.law.place.shown_unit != "%":
        return f"a {shown} of {_say_size(law, value, sigma)} {where}"
    if value < 0 and shown.startswith("more "):
        value, shown = -value, f"less {shown.removeprefix('more ')}"
    return f"{_say_size(law, value, sigma)} {shown} {where}"


def _say_size(law: RecoveredLaw, value: float, sigma: float, sign: str = "") -> str:
    """value ± sigma as they are shown, with the unit."""
    place = law.law.place
    digits = _count_digits(place.factor * sigma)
    size = show_number(place.factor * value, f"{{:{sign}.{digits}f}}")
    return f"{size} ± {place.factor * sigma:.{digits}f} {place.shown_unit}"


def _count_digits(sigma: float) -> int:
    """Decimals that show a standard deviation with one digit at least."""
    return max(0, -math.floor(math.log10(sigma))) if sigma > 0 else 0


def _say_place(law: RecoveredLaw) -> str:
    knot, unit = clearest(law)[0], law.law.place.unit
    if unit == "tip radii" and knot == 1:
        unit = "tip radius"
    over = law.law.over.removesuffix(" where dust lay")
    return f"at a {over} of {knot:g}" + (f" {unit}" if unit != "1" else "")


def clearest(law: RecoveredLaw) -> tuple[float, float, float]:
    """Knot, value and standard deviation where the law is largest, of knots that the data reach and that exceed their error."""
    low, high = law.law.reach
    reached = np.array([low <= knot <= high for knot in law.law.knots])
    size = np.abs(law.mean)
    for chosen in (reached & (size > law.sigma), reached, np.ones_like(reached)):
        if chosen.any():
            k = int(np.argmax(np.where(chosen, size, -1.0)))
            break
    return law.law.knots[k], float(law.mean[k]), float(law.sigma[k])


def _rank(found: Diagnosis) -> list[RecoveredLaw]:
    """The laws of the best freedom, first the one that explains most by itself."""
    alone = found.unknown.evidences
    return sorted(found.unknown.laws, key=lambda law: -alone.get(law.law.name, -math.inf))


def _clearness(law: RecoveredLaw) -> float:
    return float(np.max(np.abs(law.mean) / law.sigma))


def describe_unknown(found: Diagnosis) -> dict[str, Any]:
    """For diagnosis.json: every freedom's ln evidence over the nominal model's, and the laws at their knots."""
    unknown = found.unknown
    return {
        "best": unknown.block,
        "log_bayes": {name: value - found.nominal.evidence for name, value in unknown.evidences.items()},
        "embedded": unknown.embedded,
        "log_bayes_beside_best_cause": unknown.beside if math.isfinite(unknown.beside) else None,
        "laws": [
            {
                "name": each.law.name,
                "over": each.law.over,
                "unit": each.law.place.unit,
                "knots": list(each.law.knots),
                "mean": each.mean.tolist(),
                "sd": each.sigma.tolist(),
                "value_unit": each.law.place.value_unit,
            }
            for each in unknown.laws
        ],
        "wobble": _describe_wobble(found),
    }


def _say_swing(wobble: Wobble) -> str:
    return f"{wobble.amplitude:.2g} ± {wobble.sigma:.1g} px"


def _describe_wobble(found: Diagnosis) -> dict[str, Any] | None:
    wobble = found.unknown.find_wobble(found.nominal)
    if wobble is None:
        return None
    p_m = math.exp(wobble.log_p_m)
    return {
        "frequency_Hz": wobble.frequency,
        "amplitude_px": wobble.amplitude,
        "sd_px": wobble.sigma,
        "p_m_Pa": {"mean": p_m, "sd": p_m * wobble.log_p_m_sigma},
    }


def say_formula(formula: Formula) -> str:
    """What is added to the equations, with coefficients ± standard deviations."""
    said = zip(formula.terms, _say_terms(formula), strict=True)
    terms = " and ".join(f"{term.acts.words} {text}" for term, text in said)
    return terms + "".join(
        f", beside a listed cause: {each}" for each in map(partial(_say_listed, formula), formula.causes)
    )


def _say_listed(formula: Formula, effect: Effect) -> str:
    """``the top of the sample is denser than the bulk (excess 0.046 ± 0.002)``."""
    parameter, amplitude = effect.amplitudes[0], formula.fit.values[effect.name]
    factor, unit = shown_unit(parameter)
    sigma = math.sqrt(formula.covariance(effect)[0, 0])
    title = effect.say(parameter.hold(amplitude))
    amount = f"{_say_value(factor * parameter.hold(amplitude), factor * sigma)} {unit}".rstrip()
    return f"{title[0].lower()}{title[1:]} ({parameter.name.replace('_', ' ')} {amount})"


def say_equation(formula: Formula) -> str:
    """The equation of motion with a formula in it, as labsim/effects/law_places.py has it; empty where all of it is the camera's.

    m z″ = m g − F_dust − A (513 ± 49) Pa s²/m² × v²
    """
    parts: dict[str, list[str]] = {}
    for term, text in zip(formula.terms, _say_terms(formula), strict=True):
        for part, how in term.acts.enters:
            parts.setdefault(part, []).append(how.format(text))
    if not parts:
        return ""
    strengths = ", ".join(" ".join([name, *parts[name]]) for name in (SIGMA, SHEAR) if name in parts)
    dust = f"F_dust[{strengths}]" if strengths else "F_dust"
    forces = "".join(f" − {force}" for force in parts.get(FORCE, []))
    moved = f"m (1 + {' + '.join(parts[MASS])}) (z″ − g) = −" if MASS in parts else "m z″ = m g −"
    return ", ".join([f"{moved} {dust}{forces}", *parts.get(WHERE, [])])


def _say_terms(formula: Formula) -> list[str]:
    """Each term without its place: ``(513 ± 49) Pa s²/m² × v²``."""
    said = []
    for term, c, sigma in zip(formula.terms, formula.coefficients, formula.sigma, strict=True):
        unit = "" if term.unit == "1" else f" {term.unit}"
        times = "" if term.formula == "1" else f" × {term.formula}"
        said.append(f"({_say_value(float(c), float(sigma))}){unit}{times}")
    return said


def _say_value(value: float, sigma: float) -> str:
    """``513 ± 49``: a standard deviation with two digits."""
    digits = max(0, 1 - math.floor(math.log10(sigma))) if sigma > 0 else 3
    return f"{show_number(value, f'{{:.{digits}f}}')} ± {sigma:.{digits}f}"


def describe_learned(found: Diagnosis) -> dict[str, Any] | None:
    """For diagnosis.json: the formula, its coefficients and curves, rivals and held-out drops; None where none was learned."""
    learned = found.learned
    if learned is None:
        return None
    best, gain = learned.best, learned.repeated
    log_p_m, sigma = best.log_p_m
    return {
        "terms": [
            {"term": term.name, "coefficient": float(c), "sd": float(sd), "unit": term.unit}
            for term, c, sd in zip(best.terms, best.coefficients, best.sigma, strict=True)
        ],
        "beside": [
            {
                "effect": effect.name,
                **found.problem.at(effect.name, best.fit.values[effect.name]),
                "sd": math.sqrt(best.covariance(effect)[0, 0]),
            }
            for effect in best.causes
        ],
        "formula": say_formula(best),
        "equation": say_equation(best),
        "place": " and ".join(dict.fromkeys(term.place for term in best.terms)),
        "evidence": best.fit.evidence,
        "log_bayes": best.fit.evidence - found.nominal.evidence,
        "p_m_Pa": {"mean": math.exp(log_p_m), "sd": math.exp(log_p_m) * sigma},
        "curve": _describe_curves(found, best),
        "rivals": [
            {
                "terms": [term.name for term in each.terms],
                "coefficients": each.coefficients.tolist(),
                "sd": each.sigma.tolist(),
                "units": [term.unit for term in each.terms],
                "formula": say_formula(each),
                "evidence": each.fit.evidence,
                "log_evidence_behind": best.fit.evidence - each.fit.evidence,
            }
            for each in learned.formulas[1:]
        ],
        "held_out": {
            "rms_before_m": gain.rms_nominal,
            "rms_after_m": gain.rms_extended,
            "rms_noise_m": gain.rms_noise,
            "drops": [
                {"name": name, "rms_before_m": before, "rms_after_m": after}
                for name, (before, after) in learned.missed.items()
            ],
        },
    }


def _describe_curves(found: Diagnosis, formula: Formula) -> list[dict[str, Any]]:
    """Every term of a formula at POINTS places, as far as the data reach, with the band of 68 % by its coefficient's error.

    A filling factor is the dust's own, not its compaction. Terms that need no runs have no free law that says how far: those of
    the tip's radius go from the smallest tip to the largest, those of a clock as far as drops come anywhere.
    """
    laws = {law.name: law for law in (found.unknown.tangents.laws if found.unknown.tangents else ())}
    radii = [1e3 * group.projectile.tip_radius for group in found.problem.groups]
    curves = []
    for term, c, sigma in zip(formula.terms, formula.coefficients, formula.sigma, strict=True):
        acts = term.acts
        law = laws.get(term.place)
        if law is not None:
            places = np.linspace(*law.reach, POINTS)
            shape = shape_at(term, law, places)
        else:
            of_size = acts.over == "radius of the tip"
            places = (
                np.linspace(min(radii), max(radii), POINTS)
                if of_size
                else np.linspace(0.0, acts.reach, POINTS)
            )
            shape = term.shape(places)
        curves.append(
            {
                "term": term.name,
                "over": acts.over,
                "unit": acts.unit,
                "value_unit": acts.value_unit,
                "x": places.tolist(),
                "y": (c * shape).tolist(),
                "low": (c * shape - sigma * np.abs(shape)).tolist(),
                "high": (c * shape + sigma * np.abs(shape)).tolist(),
            }
        )
    return curves


def say_learned(found: Diagnosis) -> list[str]:
    """What was learned, in lines; none where nothing was."""
    if found.learned is None:
        return []
    best, alike, others = found.learned.best, found.learned.alike, found.learned.formulas[1:]
    gain = found.learned.repeated
    before, after, noise = (
        show_number(1e6 * rms, "{:.1f}") for rms in (gain.rms_nominal, gain.rms_extended, gain.rms_noise)
    )
    log_p_m, sigma = best.log_p_m
    p_m = math.exp(log_p_m) / 1e3
    said = [f"a formula for what is missing: {say_formula(best)}"]
    if equation := say_equation(best):
        said.append(f"the equation of motion with it: {equation}")
    said.append(
        f"with it held-out drops are missed by {after} µm rms, by {before} µm without, by {noise} µm were it the truth; "
        f"p_m is {p_m:.3g} ± {p_m * sigma:.2g} kPa"
    )

    def say_behind(formula: Formula) -> str:
        behind = best.fit.evidence - formula.fit.evidence
        return f"{say_formula(formula)} ({behind:.1f} behind in ln evidence)"

    if alike:
        said.append(f"hardly told from it here: {'; '.join(map(say_behind, alike))}")
    elif others:
        said.append(f"next best is {say_behind(others[0])}")
    return said


def describe_laws(found: Diagnosis) -> dict[str, Any] | None:
    """Words and captions of the page's section on the free law; None where there is nothing to draw."""
    unknown = found.unknown
    if found.verdict.word != "unknown" or not unknown.laws:
        return None
    ahead = unknown.evidences[unknown.block] - unknown.evidences[unknown.embedded]
    words = (
        "A law that is left free where the equations have a place for it: a factor on a strength, a force on the tip, per its "
        "cross-section, a mass that moves with it; known at some depths, speeds, strains or times, linear between. "
        f"Of these the data prefer {unknown.embedded}."
    )
    if not is_embedded(found) and ahead > 0:
        words += (
            f" A free law without a place in the equations ({unknown.block}) says more of these data, by {ahead:.0f} in ln "
            "evidence: read the curves as the nearest that such a law comes to what is missing."
        )
    drawn = {term.place for term in found.learned.best.terms} if found.learned else set()
    rows = []
    for k, law in enumerate(unknown.laws):
        points = ", ".join(
            f"{_show(law, value)} ± {_show(law, sigma)} at {knot:g}"
            for knot, value, sigma in zip(law.law.knots, law.mean, law.sigma, strict=True)
        )
        rows.append(
            {
                "figure": f"law{k}",
                "title": _begin(law.law.name),
                "text": f"{_begin(law.law.place.axes[1])} against {law.law.place.axes[0]}: {points}. The band holds 68 %."
                + (" Dashed: the formula, with its band." if law.law.name in drawn else ""),
            }
        )
    learned = [*say_learned(found), "a drop with it: labsim simulate --model model.toml"]
    return {
        "words": words,
        "rows": rows,
        "learned": " ".join(f"{_begin(text)}." for text in learned) if found.learned else "",
    }


def _begin(words: str) -> str:
    return words[0].upper() + words[1:]


def _show(law: RecoveredLaw, value: float) -> str:
    factor = law.law.place.factor
    return f"{factor * value:.{max(1, _count_digits(factor * float(law.sigma.min())))}f}"
