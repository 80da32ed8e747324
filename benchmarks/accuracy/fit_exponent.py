"""How much does a difference in ln evidence count between two causes of another code? The exponent 1/T of the verdict, fitted.

    python -m benchmarks.accuracy.fit_exponent benchmarks/accuracy/rows/*.jsonl

A file has one line a campaign, as ``blind.py --rows`` writes them. Every campaign is
judged again from its evidences with other T. Printed for each T: how often the first is what was hidden, how often a wrong
cause has more than 0.5, and the mean of -ln of the probability of what was hidden: the lower the better. Campaigns that this
was fitted on are no test of it.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace

import pandas as pd

from benchmarks.accuracy.blind import name_hypothesis, read_rows
from labsim.diagnosis import judge

EXPONENTS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0)
NOT_CAUSES = ("none", "unknown")


def judge_again(row: dict, temperature: float) -> dict[str, float]:
    """Probability of every hypothesis, its causes in the order of their names; best first."""
    found = row["evidence"]
    fits = [
        SimpleNamespace(hypothesis=tuple(name.split(" + ")), evidence=value)
        for name, value in found["fitted"].items()
    ]
    judge.TEMPERATURE = temperature
    verdict = judge.judge(
        SimpleNamespace(evidence=0.0),  # type: ignore[arg-type]
        fits,  # type: ignore[arg-type]
        found["unknown"],
        found["catalogue"],
        found["screened"],
        found["predicted"],
        beside=-math.inf
        if found.get("beside") is None
        else found["beside"],  # rows before 2026-12-01 have none
    )
    return {name_hypothesis(causes): probability for causes, probability in verdict.probabilities}


def main(paths: list[Path]) -> None:
    rows = read_rows(*paths)
    table = []
    for temperature in EXPONENTS:
        right = wrong = 0
        surprise = 0.0
        for row in rows:
            hidden = name_hypothesis(row["truth"]["cause"].split(" + "))
            found = judge_again(row, temperature)
            first, probability = next(iter(found.items()))
            right += first == hidden
            part = set(first.split(" + ")) <= set(hidden.split(" + "))
            wrong += probability > 0.5 and first not in NOT_CAUSES and not part
            surprise -= math.log(max(found.get(hidden, 0.0), 1e-6))
        table.append((temperature, right, wrong, surprise / len(rows)))
    print(f"{len(rows)} campaigns")
    print(pd.DataFrame(table, columns=["T", "right", "wrong > 0.5", "-ln P"]).round(3).to_string(index=False))


if __name__ == "__main__":
    main([Path(each) for each in sys.argv[1:]])
