"""Does the interval of p_m hold with another code? Split conformal, kind of cause by kind of cause.

    python -m benchmarks.accuracy.conformal ROWS.jsonl ...

ROWS.jsonl is what ``benchmarks/accuracy/blind.py --rows`` writes. How far ln p_m lies from the truth is taken in standard
deviations of the posterior, e.g. of n campaigns. Half of the campaigns, drawn at random, say by what factor intervals have to be
wider: the ceil(0.9 (n + 1))-th smallest |e| over 1.645 (Papadopoulos et al. 2002; Lei et al. 2018). The other half counts in how
many the wider interval holds the truth. Printed are means over SPLITS draws. Where the verdict is unknown p_m is said not to be
measured: those stand apart, and so do campaigns where what is first is wrong.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import norm

from benchmarks.accuracy.blind import read_rows, score
from benchmarks.accuracy.draw_accuracy import find_interval
from labsim.effects import list_effects
from labsim.records import FloatArray

SPLITS = 2000
SHARE = 0.9
WITHIN = float(norm.ppf(0.5 + SHARE / 2))
FEWEST = 10  # campaigns: a ninth smallest of fewer than nine does not exist


def split(errors: FloatArray, rng: np.random.Generator) -> tuple[float, float]:
    """Factor that one half asks for, and share of the other that the wider interval holds, means over SPLITS draws. errors :
    (n,) standard deviations."""
    half, factors, held = len(errors) // 2, [], []
    rank = math.ceil(SHARE * (half + 1)) - 1
    for _ in range(SPLITS):
        order = rng.permutation(errors)
        wide = math.inf if rank >= half else float(np.sort(order[:half])[rank])
        factors.append(wide / WITHIN)
        held.append(float(np.mean(order[half:] <= wide)))
    return float(np.mean(factors)), float(np.mean(held))


def find_kind(row: pd.Series, kinds: dict[str, str]) -> str:
    if row["first"] == "unknown":
        return "unknown"
    if row.hidden == "none":
        return "nothing hidden"
    right = row["class"] or row["first"] == "none"
    kind = kinds.get(row.hidden.split(" + ")[0], "unlisted")
    return f"{kind}, {'right' if right else 'wrong'}" if " + " not in row.hidden else "pair"


def main() -> None:
    table = score(read_rows(*map(Path, sys.argv[1:])))
    kinds = {name: effect.kind for name, effect in list_effects(None).items()}
    table["kind"] = [find_kind(row, kinds) for _, row in table.iterrows()]
    table["error"] = table["ln p_m off"].abs() / table.sd
    rng = np.random.default_rng(1)
    groups = [*table.groupby("kind"), ("all but unknown", table[table.kind != "unknown"])]
    print(
        "| what | campaigns | mean of ln p_m off | in 90 % | factor | in the wider interval |\n|---|---|---|---|---|---|"
    )
    for kind, some in groups:
        inside = int((some.error <= WITHIN).sum())
        low, high = find_interval(inside, len(some))
        asked = ""
        if len(some) >= 2 * FEWEST:
            factor, held = split(some.error.to_numpy(), rng)
            asked = f"{factor:.2f} | {held:.2f}"
        print(
            f"| {kind} | {len(some)} | {some['ln p_m off'].mean():+.3f} | {inside} ({100 * low:.0f} to {100 * high:.0f} %) | "
            f"{asked or '|'} |"
        )


if __name__ == "__main__":
    main()
