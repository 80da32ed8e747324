"""Right and wrong of a day's hidden causes, on rows whose answer is known."""

from __future__ import annotations

import pandas as pd
import pytest

from benchmarks.accuracy.blind import judge_rows
from benchmarks.accuracy.fresh import draw_plan
from benchmarks.accuracy.hide_and_find import LISTED, NULLS, UNLISTED


@pytest.mark.parametrize(
    ("hidden", "first", "probability", "in_class", "sigmas", "right"),
    [
        ("none", "none", 0.6, False, 0.0, True),
        ("none", "pore_gas", 0.4, False, 0.0, False),
        ("pore_gas", "pore_gas", 0.9, True, 12.0, True),
        ("pore_gas", "none", 0.9, False, 12.0, False),
        ("pore_gas", "none", 0.9, False, 5.0, True),
        ("pore_gas", "unknown", 0.9, False, 5.0, False),
        ("unknown", "unknown", 0.9, False, float("nan"), True),
        ("unknown", "pore_gas", 0.4, False, float("nan"), True),
        ("unknown", "pore_gas", 0.9, False, float("nan"), False),
    ],
)
def test_right_is_what_was_hidden_or_what_cannot_be_told_from_it(
    hidden, first, probability, in_class, sigmas, right
):
    row = {"hidden": hidden, "first": first, "P": probability, "class": in_class, "sigmas": sigmas}
    assert bool(judge_rows(pd.DataFrame([row]))[0]) is right


def test_a_seed_draws_the_same_campaigns():
    plans = [
        draw_plan(seed, nulls=NULLS, listed=LISTED, pairs=0, unlisted=UNLISTED, letter="d")
        for seed in (1, 1, 2)
    ]
    assert plans[0] == plans[1] != plans[2]
    assert sorted(each["cause"] in ("none", "unknown") for each in plans[0]) == [False] * LISTED + [True] * 2
