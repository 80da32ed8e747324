"""What a diagnosed campaign's page says of causes, of what is alike, and of the gain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...diagnosis.campaign import Diagnosis
from ...diagnosis.misfit import say_misfit
from .law_words import say_missing
from .page import show_number
from .phrases import SHOWN, say_combination

BADGES = {
    "none": "Nothing is wrong beyond the errors",
    "effect": "A cause is found",
    "unknown": "Wrong, and no listed cause explains it",
}
RARE = 0.01  # probability below which a cause is only named


def describe_causes(found: Diagnosis, summary: dict) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    rest: list[str] = []
    for cause in summary["causes"]:
        name = " + ".join(cause["causes"])
        if cause["probability"] < RARE and rows:
            rest.append(name + (f" {cause['probability']:.4f}" if cause["probability"] >= 5e-5 else ""))
            continue
        parameters = []
        for full, q in cause["parameters"].items():
            factor, unit = SHOWN.get(q["unit"], (1.0, q["unit"]))
            middle, low, high = (show_number(q[key] * factor, "{:.3g}") for key in ("q50", "q05", "q95"))
            parameters.append(f"{full.split('.', 1)[1]} = {middle} ({low} to {high}) {unit}".rstrip())
        rows.append(
            {
                "name": name,
                "probability": f"{cause['probability']:.3f}",
                "percent": f"{100 * cause['probability']:.1f}",
                "title": _title(found, cause["causes"]),
                "parameters": parameters or ["–"],
            }
        )
    words = (
        "Posterior probabilities of every cause alone, of pairs where one is not enough, of the nominal model (none) and of a "
        "free law without a name (unknown); together they are one."
    )
    if missed := say_misfit(found.misfit):
        words += f" The nominal fit {missed}."
    if found.verdict.word == "unknown":
        words += f" {_say_unknown(found)}"
    against = [f"{name}: {reason}" for name, reason in found.problem.reasons.items()]
    return {"words": words, "rows": rows, "rest": rest, "against": against}


def _say_unknown(found: Diagnosis) -> str:
    nearest = " + ".join(found.best.hypothesis) or "the nominal model"
    return (
        f"What is missing {say_missing(found)}; the nearest that the catalogue comes to it is {nearest}, drawn beside "
        "the nominal model."
    )


def _title(found: Diagnosis, causes: Sequence[str]) -> str:
    fixed = {
        "none": "The nominal simulation is right within its errors",
        "unknown": "Something that no listed cause explains",
    }
    known = found.problem.effects
    return "; ".join(fixed.get(name) or (known[name].title if name in known else name) for name in causes)


def list_confusable(found: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Cause, cause, cosine, and what the two are."""
    return [
        (
            first,
            second,
            show_number(cosine, "{:+.2f}"),
            f"{_title(found, [first])} / {_title(found, [second])}",
        )
        for first, second, cosine in found.confusable
    ]


def describe_untestable(found: Diagnosis) -> dict[str, Any] | None:
    """What could be there unseen, and the p_m that it would imply; None where everything is testable."""
    if not found.untestable:
        return None
    words = (
        "These causes may be there unseen, and p_m takes their place. The third column is the most that leaves no more than two "
        "standard deviations of the data, or one standard deviation of its prior where that is less; the last is the p_m of dust "
        "with so much of it."
    )
    if found.combination is not None:
        words += f" Measured all the same: {say_combination(found.combination)}."
    rows = [
        (
            each.name,
            _title(found, [each.name]),
            f"{each.values[0]:.3g} to {each.values[1]:.3g} "
            + found.problem.effects[each.name].amplitudes[0].unit.removesuffix("1"),
            "{:.3g} to {:.3g}".format(*(p / 1e3 for p in each.p_m)),
        )
        for each in found.untestable
    ]
    return {"words": words, "rows": rows}


def describe_gain(found: Diagnosis, summary: dict, labels: Sequence[str]) -> dict[str, Any]:
    gain = summary["gain"]
    nominal, extended, noise = (
        show_number(1e6 * gain[key], "{:.1f}") for key in ("rms_nominal_m", "rms_extended_m", "rms_noise_m")
    )
    words = f"Each drop was predicted once from the others, with its own free fall: the nominal model misses by {nominal} µm rms"
    if len(labels) > 1:
        sigma = gain["log_score_difference_sigma"]
        about = f" ±\u00a0{show_number(sigma, '{:.1f}')}" if np.isfinite(sigma) else ""
        fraction = show_number(100 * gain["fraction_of_discrepancy_removed"], "{:.0f}")
        words += (
            f", {labels[1]} by {extended} µm, and a true model would by {noise} µm; {fraction} % of the removable discrepancy is "
            f"gone. The logarithm of the probability that was given to the held-out drops changes by "
            f"{show_number(gain['log_score_difference'], '{:+.1f}')}{about}; above zero the extended model predicts better."
        )
    else:
        words += (
            f", a true model would by {noise} µm. Nothing is added to the model, so there is nothing to gain."
        )
    columns = [found.held_out_nominal.rms]
    if len(labels) > 1:
        columns.append(found.held_out_extended.rms)
    columns.append(found.held_out_extended.expected)
    rows = [
        (name, *(show_number(1e6 * float(value), "{:.1f}") for value in values))
        for name, *values in zip(found.held_out_nominal.names, *columns, strict=True)
    ]
    text = "What each model misses of a held-out drop below the surface, rms; the dash is what a true model would leave."
    return {"words": words, "rows": rows, "text": text}
