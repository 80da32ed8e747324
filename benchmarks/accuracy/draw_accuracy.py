"""Draw what ``blind.py`` found: which cause was named first for each that was hidden, how often a stated probability was right.

    python -m benchmarks.accuracy.draw_accuracy DIR ROWS.jsonl [ROWS.jsonl ...]

Writes DIR/confusion.png and DIR/reliability.png and prints the expected calibration error: the mean distance between the
probability of the cause that stands first and the share of such verdicts that are right, over bins of that probability. Rows
count such that none, listed causes, pairs and what nobody listed have together what the prior gives them: probabilities can only
hold where causes are as frequent as the prior says.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from scipy.stats import beta

from benchmarks.accuracy.blind import read_rows, score
from labsim.diagnosis.judge import PRIOR_NONE, PRIOR_PAIRS, PRIOR_UNKNOWN

matplotlib.use("Agg")
import matplotlib.pyplot as plt

BINS = np.array([0.0, 0.5, 0.7, 0.9, 1.0])


def draw_confusion(table: pd.DataFrame) -> plt.Figure:
    """Rows: hidden; columns: named first; the number of campaigns in each cell."""
    hidden = sorted(set(table.hidden), key=lambda name: (name not in ("none", "unknown"), name))
    named = [*hidden, *sorted(set(table["first"]) - set(hidden))]
    count = pd.crosstab(table.hidden, table["first"]).reindex(index=hidden, columns=named, fill_value=0)
    figure, ax = plt.subplots(
        figsize=(2.6 + 0.32 * len(named), 2.2 + 0.3 * len(hidden)), layout="constrained"
    )
    ax.imshow(count.to_numpy(), cmap="Blues", vmax=max(2, count.to_numpy().max()) * 1.5)
    for (i, j), value in np.ndenumerate(count.to_numpy()):
        if value:
            ax.text(
                j, i, value, ha="center", va="center", color="black" if hidden[i] == named[j] else "tab:red"
            )
    ax.set_xticks(range(len(named)), [name.replace("_", " ") for name in named], rotation=60, ha="right")
    ax.set_yticks(range(len(hidden)), [name.replace("_", " ") for name in hidden])
    ax.set(xlabel="named first", ylabel="hidden")
    return figure


def find_interval(right: int, of: int) -> tuple[float, float]:
    """90 % interval of a share (Jeffreys)."""
    low, high = beta.ppf([0.05, 0.95], right + 0.5, of - right + 0.5)
    return float(low), float(high)


def bin_verdicts(said: pd.Series, right: pd.Series) -> list[tuple[float, int, int]]:
    """Of each of BINS that has verdicts: the mean probability that is said, how many are right, how many there are."""
    bins = right.groupby(pd.cut(said, BINS), observed=True)
    return [(float(said[each.index].mean()), int(each.sum()), len(each)) for _, each in bins]


def find_calibration_error(said: pd.Series, right: pd.Series, weight: pd.Series) -> float:
    """Expected: the mean distance of the probability that is said from the share that is right, over BINS."""
    distance = weight * (said - right.astype(float))
    return float(distance.groupby(pd.cut(said, BINS), observed=True).sum().abs().sum() / weight.sum())


def expect_calibration_error(said: pd.Series, weight: pd.Series, draws: int = 1000) -> tuple[float, float]:
    """90 % interval of the error that as many verdicts have whose probabilities hold: few rows are never without one."""
    rng = np.random.default_rng(0)
    errors = [
        find_calibration_error(said, pd.Series(rng.random(len(said)) < said.to_numpy(), said.index), weight)
        for _ in range(draws)
    ]
    low, high = np.quantile(errors, [0.05, 0.95])
    return float(low), float(high)


def weigh_rows(hidden: pd.Series) -> pd.Series:
    """What each row counts, so that all rows of a kind have together what the prior gives that kind."""
    kind = hidden.where(hidden.isin(["none", "unknown"]), "single")
    kind = kind.mask(hidden.str.contains(" + ", regex=False), "pair")
    prior = {"none": PRIOR_NONE, "unknown": PRIOR_UNKNOWN, "pair": PRIOR_PAIRS}
    prior["single"] = 1 - sum(prior.values())
    return kind.map(prior) / kind.map(kind.value_counts())


def draw_reliability(table: pd.DataFrame) -> plt.Figure:
    """Share of verdicts that are exact against the probability said, with 90 % intervals."""
    figure, ax = plt.subplots(figsize=(4.2, 3.8), layout="constrained")
    ax.plot([0, 1], [0, 1], color="0.6", lw=1)
    for said, hits, number in bin_verdicts(table.P, table.exact):
        share = hits / number
        ax.plot([said, said], find_interval(hits, number), color="tab:blue", lw=1.2)
        ax.plot(said, share, "o", color="tab:blue")
        ax.annotate(
            f"{hits} of {number}", (said, share), (-6, 4), textcoords="offset points", ha="right", fontsize=8
        )
    ax.set(
        xlabel="probability of the cause that stands first",
        ylabel="share that is right",
        xlim=(0, 1.02),
        ylim=(0, 1.06),  # room for a label at one
    )
    return figure


def main() -> None:
    folder, *paths = map(Path, sys.argv[1:])
    table = score(read_rows(*paths))
    draw_confusion(table).savefig(folder / "confusion.png", dpi=110)
    draw_reliability(table).savefig(folder / "reliability.png", dpi=110)
    error = find_calibration_error(table.P, table.exact, weigh_rows(table.hidden))
    print(
        f"{len(table)} campaigns: first is right in {int(table.exact.sum())}; expected calibration error {error:.3f}"
    )


if __name__ == "__main__":
    main()
