"""What is said of the law that an unknown cause would have to be: a phrase for the verdict, numbers for diagnosis.json."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..diagnosis.campaign import Diagnosis
from ..diagnosis.free_law import EMBEDDED, RecoveredLaw
from ..diagnosis.judge import PREDICTED
from .page import show_number

MISSING = {
    "depth and speed": "a law of depth and speed, about {size} % of the depth",
    "drop": "something that changes from drop to drop, about {size} % of the depth",
    "undisturbed dust": "a layering of the dust that was there before the drop",
    "depth and speed and undisturbed dust": "a layering of the dust that was there before the drop, and a law of depth and "
    "speed, about {size} % of the depth",
}
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
    if not is_embedded(found):
        return "looks like " + MISSING[unknown.block].format(size=f"{100 * unknown.size:.0f}")
    first, *rest = _rank(found)
    further = [f"a {law.law.name}" for law in rest if _clearness(law) > CLEAR]
    return f"acts like {say_law(first)}" + (f" (with parts of {' and '.join(further)})" if further else "")


def comes_nearest(found: Diagnosis) -> bool:
    """Whether a listed cause explains more than any law without a name, and is set back because held-out drops are missed."""
    return found.predicted < PREDICTED and found.best.evidence > found.unknown.evidence


def size_of_missing(found: Diagnosis) -> tuple[str, str] | None:
    """Value and unit for a tile: the clearest knot of an embedded law, or the share of the depth."""
    if is_embedded(found):
        law = _rank(found)[0]
        value, sigma = clearest(law)[1:]
        if law.law.over == "filling factor":
            size = show_number(100 * value, "{:+.0f}")
            return f"{size} ± {100 * sigma:.0f} %", f"of the strength {_say_place(law)}"
        return f"{show_number(value, '{:+.0f}')} ± {sigma:.0f} Pa", f"on the tip {_say_place(law)}"
    if "depth" in MISSING[found.unknown.block]:
        return f"≈ {100 * found.unknown.size:.0f} %", "of the depth"
    return None


def say_law(law: RecoveredLaw) -> str:
    """Its clearest knot: a strength 12 ± 3 % higher than p_m gives at a filling factor of 0.18."""
    _, value, sigma = clearest(law)
    if law.law.over == "filling factor":
        word = "more" if value > 0 else "less"
        return f"{100 * abs(value):.0f} ± {100 * sigma:.0f} % {word} compressive strength {_say_place(law)}"
    towards = {"depth": ("upwards", "downwards"), "speed": ("against the motion", "along the motion")}
    word = towards[law.law.over][value < 0]
    return f"a force on the tip of {abs(value):.0f} ± {sigma:.0f} Pa of its cross-section {word} {_say_place(law)}"


def _say_place(law: RecoveredLaw) -> str:
    knot = clearest(law)[0]
    if law.law.over == "filling factor":
        return f"at a filling factor of {knot:g}"
    if law.law.over == "depth":
        return f"at a depth of {knot:g} tip {'radius' if knot == 1 else 'radii'}"
    return f"at {knot:g} m/s"


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
                "unit": each.law.unit,
                "knots": list(each.law.knots),
                "mean": each.mean.tolist(),
                "sd": each.sigma.tolist(),
                "value_unit": each.law.value_unit,
            }
            for each in unknown.laws
        ],
    }


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
                "text": f"{_begin(value_label(law))} against {place_label(law)}: {points}. The band holds 68 %.",
            }
        )
    return {"words": words, "rows": rows}


def _begin(words: str) -> str:
    return words[0].upper() + words[1:]


def _show(law: RecoveredLaw, value: float) -> str:
    return f"{100 * value:.1f}" if law.law.over == "filling factor" else f"{value:.1f}"


def value_label(law: RecoveredLaw) -> str:
    if law.law.over == "filling factor":
        return "more strength (%)"
    return {"depth": "force upwards (Pa)", "speed": "force against the motion (Pa)"}[law.law.over]


def place_label(law: RecoveredLaw) -> str:
    unit = "" if law.law.unit == "1" else f" ({law.law.unit})"
    return {"filling factor": "filling factor", "depth": "depth", "speed": "speed"}[law.law.over] + unit
