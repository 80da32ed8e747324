"""What is said of the law that an unknown cause would have to be: a phrase for the verdict, numbers for diagnosis.json."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...diagnosis.campaign import Diagnosis
from ...diagnosis.judge import PREDICTED
from ...diagnosis.unlisted.free_law import EMBEDDED, RecoveredLaw
from ...diagnosis.unlisted.learned_law import Formula
from ...diagnosis.unlisted.wobble import Wobble
from .page import show_number

MISSING = {
    "depth and speed": "a law of depth and speed, about {size} % of the depth",
    "drop": "something that changes from drop to drop, about {size} % of the depth",
    "undisturbed dust": "a layering of the dust that was there before the drop",
    "depth and speed and undisturbed dust": "a layering of the dust that was there before the drop, and a law of depth and "
    "speed, about {size} % of the depth",
}
# after the unit of a force: what it goes with
PER = {"Pa": " of its cross-section", "N/m": " of its circumference", "mN": ", alike for all tips,"}
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
        return f"is like {say_formula(found.learned.best)}"
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
    """Whether a listed cause explains more than any law without a name, and is set back because held-out drops are missed."""
    return found.predicted < PREDICTED and found.best.evidence > found.unknown.evidence


def size_of_missing(found: Diagnosis) -> tuple[str, str] | None:
    """Value and unit for a tile: the clearest knot of an embedded law, the swing of a camera, or the share of the depth."""
    if is_embedded(found):
        law = _rank(found)[0]
        _, value, sigma = clearest(law)
        return (
            _say_size(law, value, sigma, "+"),
            f"{'of the strength' if _is_strength(law) else 'on the tip'} {_say_place(law)}",
        )
    wobble = found.unknown.find_wobble(found.nominal)
    if wobble is not None:
        return _say_swing(wobble), f"of the camera, at {wobble.frequency:.0f} Hz"
    if "depth" in MISSING.get(found.unknown.block, ""):
        return f"≈ {100 * found.unknown.size:.0f} %", "of the depth"
    return None


def say_law(law: RecoveredLaw) -> str:
    """Its clearest knot: a strength 12 ± 3 % higher than p_m gives at a filling factor of 0.18."""
    _, value, sigma = clearest(law)
    size = _say_size(law, abs(value), sigma)
    if _is_strength(law):
        return f"{size} {'more' if value > 0 else 'less'} compressive strength {_say_place(law)}"
    towards = {"depth": ("upwards", "downwards"), "speed": ("against the motion", "along the motion")}
    word = towards[law.law.over][value < 0]
    return f"a force on the tip of {size}{PER[law.law.place.value_unit]} {word} {_say_place(law)}"


def _say_size(law: RecoveredLaw, value: float, sigma: float, sign: str = "") -> str:
    """value ± sigma as they are shown, with the unit."""
    place = law.law.place
    digits = _count_digits(place.factor * sigma)
    size = show_number(place.factor * value, f"{{:{sign}.{digits}f}}")
    return f"{size} ± {place.factor * sigma:.{digits}f} {place.shown_unit}"


def _is_strength(law: RecoveredLaw) -> bool:
    return law.law.place.shown_unit == "%"


def _count_digits(sigma: float) -> int:
    """Decimals that show a standard deviation with one digit at least."""
    return max(0, -math.floor(math.log10(sigma))) if sigma > 0 else 0


def _say_place(law: RecoveredLaw) -> str:
    knot, unit = clearest(law)[0], law.law.place.unit
    if law.law.over == "filling factor":
        return f"at a filling factor of {knot:g}"
    if unit == "tip radii" and knot == 1:
        unit = "tip radius"
    return f"at {knot:g} m/s" if law.law.over == "speed" else f"at a depth of {knot:g} {unit}"


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
    said = []
    for term, c, sigma in zip(formula.terms, formula.coefficients, formula.sigma, strict=True):
        digits = max(0, 1 - math.floor(math.log10(sigma))) if sigma > 0 else 3
        unit = "" if term.unit == "1" else f" {term.unit}"
        times = "" if term.formula == "1" else f" × {term.formula}"
        said.append(f"{term.acts.words} ({c:.{digits}f} ± {sigma:.{digits}f}){unit}{times}")
    return " and ".join(said)


def describe_learned(found: Diagnosis) -> dict[str, Any] | None:
    """For diagnosis.json: the formula with its coefficients, rivals and held-out drops; None where none was learned."""
    learned = found.learned
    if learned is None:
        return None
    best, gain = learned.best, learned.repeated
    log_p_m, sigma = best.fit.log_p_m, math.sqrt(best.fit.covariance[0, 0])
    return {
        "terms": [
            {"term": term.name, "coefficient": float(c), "sd": float(sd), "unit": term.unit}
            for term, c, sd in zip(best.terms, best.coefficients, best.sigma, strict=True)
        ],
        "formula": say_formula(best),
        "place": " and ".join(dict.fromkeys(term.place for term in best.terms)),
        "log_bayes": best.fit.evidence - found.nominal.evidence,
        "p_m_Pa": {"mean": math.exp(log_p_m), "sd": math.exp(log_p_m) * sigma},
        "rivals": [
            {
                "terms": [term.name for term in each.terms],
                "formula": say_formula(each),
                "log_evidence_behind": best.fit.evidence - each.fit.evidence,
            }
            for each in learned.formulas[1:]
        ],
        "held_out": {
            "rms_before_m": gain.rms_nominal,
            "rms_after_m": gain.rms_extended,
            "rms_noise_m": gain.rms_noise,
        },
    }


def say_learned(found: Diagnosis) -> list[str]:
    """What was learned, in lines; none where nothing was."""
    if found.learned is None:
        return []
    best, alike = found.learned.best, found.learned.alike
    gain = found.learned.repeated
    before, after, noise = (
        show_number(1e6 * rms, "{:.1f}") for rms in (gain.rms_nominal, gain.rms_extended, gain.rms_noise)
    )
    p_m, sigma = math.exp(best.fit.log_p_m) / 1e3, math.sqrt(best.fit.covariance[0, 0])
    said = [
        f"a formula for what is missing: {say_formula(best)}",
        f"with it held-out drops are missed by {after} µm rms, by {before} µm without, by {noise} µm were it the truth; "
        f"p_m is {p_m:.3g} ± {p_m * sigma:.2g} kPa",
    ]
    if alike:
        said.append(f"hardly told from it here: {'; '.join(map(say_formula, alike))}")
    return said


def describe_laws(found: Diagnosis) -> dict[str, Any] | None:
    """Words and captions of the page's section on the free law; None where there is nothing to draw."""
    unknown = found.unknown
    if found.verdict.word != "unknown" or not unknown.laws:
        return None
    ahead = unknown.evidences[unknown.block] - unknown.evidences[unknown.embedded]
    words = (
        "A law that is left free where the equations have a place for it: a factor on the compressive strength at some filling "
        "factors, a force on the tip, per its cross-section, at some depths or speeds, linear between. "
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
                + (" Dashed: the formula." if law.law.name in drawn else ""),
            }
        )
    learned = [*say_learned(found), "labsim simulate --model model.toml simulates a drop with it"]
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
