"""Set the laws that were learned of unlisted causes beside what was hidden.

    python -m benchmarks.accuracy.count_laws ROWS.jsonl ...

ROWS.jsonl is what ``benchmarks/accuracy/blind.py --rows`` writes. Prints a row a campaign and counts with their 90 % intervals.
A place is right where it is that of the best formula; a form where it is among the first three formulas.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from scipy.stats import norm

from benchmarks.accuracy.blind import read_rows
from benchmarks.accuracy.draw_accuracy import find_interval
from benchmarks.accuracy.hidden_laws import LARGE, SIZE, WHERE, HiddenLaw, find_law, find_place
from labsim.effects.terms import list_terms

MOST = 3  # formulas that are named
WITHIN = float(norm.ppf(0.95))  # standard deviations of a 90 % interval
CODES = 0.06  # of ln p_m, between codes (docs/error-budget.md)


def find_places(row: dict) -> set[str]:
    """Where the verdict says that something is missing; nowhere where it names a listed cause, or none."""
    if row["first"] != "unknown":
        return set()
    if row["law"]:
        return {find_place(name) for name in row["law"][0]["terms"]}
    block = row["evidence"]["block"]
    named = {term.title: name for name, term in list_terms().items()}
    if block in named:
        return {find_place(named[block])}
    return {WHERE.get(block, block)}


def describe(row: dict, law: HiddenLaw) -> dict:
    """One campaign; None where a question does not arise."""
    formulas = row["law"][:MOST] if row["first"] == "unknown" else []
    alike = [name for each in formulas for name in each["terms"] if name in law.terms]
    inside = None
    for each in formulas[:1]:
        for name, (_, value, sigma) in each["terms"].items():
            if law.terms.get(name) is not None:
                inside = abs(value - law.terms[name]) < WITHIN * sigma
    return {
        "place": bool(find_places(row) & set(law.places)),
        "form": bool(alike) if law.terms else None,
        "size": inside,
        "formulas": "; ".join(
            " + ".join(
                f"{name} {value:.3g} ± {sigma:.2g}" for name, (_, value, sigma) in each["terms"].items()
            )
            for each in formulas
        )
        or row["evidence"]["block"],
    }


def main() -> None:
    rows = read_rows(*map(Path, sys.argv[1:]))
    counts: dict[str, list[bool]] = {}
    print("| campaign | hidden | first, P | formulas | place | form | size | p_m, Pa (true) | share |")
    print("|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        truth = row["truth"]
        law = find_law(truth)
        if law is None:
            counts.setdefault("a law preferred to a listed cause, or to none", []).append(bool(row["law"]))
            continue
        said = describe(row, law)
        strength = None
        p_m, share = row["p_m"], math.nan
        if row["law"] and row["first"] == "unknown":
            middle, width = row["law"][0]["ln_p_m"]
            # the truth's p_m is that of the large tip there, a formula's that of none in particular
            if truth.get("small_strength"):
                middle += sum(
                    value * float(list_terms()[name].shape(np.array([1e3 * LARGE]))[0])
                    for name, (place, value, _) in row["law"][0]["terms"].items()
                    if place == SIZE
                )
            strength = abs(middle - math.log(truth["pm"])) < WITHIN * math.hypot(width, CODES)
            p_m = math.exp(middle)
            before, after = row["law"][0]["rms"]
            removed = before**2 - row["rms_by_truth"] ** 2
            share = (before**2 - after**2) / removed if removed > 0.1 * before**2 else math.nan
        counts.setdefault("unknown, or nothing above 0.5", []).append(
            row["first"] == "unknown" or row["probability"] < 0.5
        )
        for what, right in (*((key, said[key]) for key in ("place", "form", "size")), ("p_m", strength)):
            if right is not None:
                counts.setdefault(what, []).append(right)
        if math.isfinite(share):
            counts.setdefault("share", []).append(share)
        marks = [{True: "yes", False: "**no**", None: ""}[said[key]] for key in ("place", "form", "size")]
        print(
            f"| {row['campaign']} | {truth['note']} | {row['first']} {row['probability']:.2f} | {said['formulas']} | "
            f"{' | '.join(marks)} | {p_m:.0f} ({truth['pm']:.0f}) | {'' if math.isnan(share) else f'{share:.2f}'} |"
        )
    print()
    for what, found in counts.items():
        if what == "share":
            print(
                f"| share of what the truth removes, median | {np.median(found):.2f} of {len(found)} campaigns |"
            )
            continue
        low, high = find_interval(sum(found), len(found))
        print(f"| {what} | {sum(found)} of {len(found)} ({100 * low:.0f} to {100 * high:.0f} %) |")


if __name__ == "__main__":
    main()
