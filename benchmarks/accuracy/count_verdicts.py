"""Count what verdicts on fresh campaigns are worth, with 90 % intervals.

    python -m benchmarks.accuracy.count_verdicts ROWS.jsonl ...

ROWS.jsonl is what ``benchmarks/accuracy/blind.py --rows`` writes of campaigns of a plan that fresh.py drew.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from benchmarks.accuracy.blind import STRONG, read_rows, score
from benchmarks.accuracy.draw_accuracy import (
    expect_calibration_error,
    find_calibration_error,
    find_interval,
    weigh_rows,
)

BANDS = ((0.0, 0.03), (0.03, 0.06), (0.06, 0.11))  # of the scatter of p_m between samples
POWER = 6.0  # standard deviations, from which a cause that nobody listed should be seen
UNSEEN = 1.0  # the same, below which p_m makes up for a cause
GAIN = 0.9  # of what the truth removes, that a right cause should
OFTEN = ("bulk_modulus", "shear_strength")  # causes that are counted by themselves


def count(name: str, right: pd.Series) -> None:
    """One row: how many of how many, and the interval of the share."""
    hits, all_ = int(right.sum()), len(right)
    low, high = find_interval(hits, all_)
    share = f"{100 * hits / all_:.0f} % ({100 * low:.0f} to {100 * high:.0f})" if all_ else ""
    print(f"| {name} | {hits} of {all_} | {share} |")


def main() -> None:
    table = score(read_rows(*map(Path, sys.argv[1:])))
    null, unlisted = table.hidden == "none", table.hidden == "unknown"
    pair = table.hidden.str.contains(" + ", regex=False)
    listed = ~null & ~unlisted & ~pair
    strong = listed & (table.sigmas >= STRONG)
    print("| what | how many | share (90 % interval) |\n|---|---|---|")
    for low, high in BANDS:
        some = null & (table.scatter > low) & (table.scatter <= high)
        count(f"nothing hidden, scatter {100 * low:g} to {100 * high:g} %: none", table.right[some])
    count(f"one listed cause of {STRONG:g} σ and more: it or its class first", table.right[strong])
    count("… among the at most three named", table["named"][strong])
    count("… weaker: it or its class first, or none", table.right[listed & ~strong])
    count("a pair: both named", table["exact"][pair])
    count("unlisted: unknown, or nothing above 0.5", table.right[unlisted])
    told = table["first"] == "unknown"
    count(f"… of {POWER:g} σ and more: unknown", told[unlisted & (table.sigmas >= POWER)])
    for name in OFTEN:
        count(f"{name}: it or its class named", (table["named"] | table["class"])[table.hidden == name])
    count("all: a wrong cause above 0.5", table["wrong>0.5"])
    count("p_m in its 90 % interval, nothing hidden", table["in 90 %"][null])
    # where the verdict is unknown, p_m is said not to be measured
    said = ~null & ~told
    count("p_m in its 90 % interval, something hidden, the first cause fitted", table["in 90 %"][said])
    made_up = table.sigmas < UNSEEN
    count(f"… a cause of less than {UNSEEN:g} σ, which p_m makes up for", table["in 90 %"][said & made_up])
    count("… all others", table["in 90 %"][said & ~made_up])
    count("… over all causes that are not excluded", table["in 90 % over causes"][said].dropna())
    share = table["share"][(table["exact"] | table["class"]) & ~null & ~told].dropna()
    print(
        f"\nof what the truth removes of held-out drops the right cause, or its class, removes {share.median():.2f} (median of "
        f"{len(share)}; {int((share >= GAIN).sum())} of them {GAIN:g} or more)"
    )
    print("expected calibration error")
    for name, weight in (
        ("causes as frequent as the prior says", weigh_rows(table.hidden)),
        ("as drawn", table.P * 0 + 1),
    ):
        exact, right = (find_calibration_error(table.P, table[each], weight) for each in ("exact", "right"))
        low, high = expect_calibration_error(table.P, weight)
        print(
            f"{name}: {exact:.3f} of exact causes ({low:.3f} to {high:.3f} were every probability to hold), "
            f"{right:.3f} of what the rows above call right"
        )


if __name__ == "__main__":
    main()
