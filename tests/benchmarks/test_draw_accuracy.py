"""Counts of verdicts against values by hand."""

import pandas as pd
import pytest

from benchmarks.accuracy.draw_accuracy import expect_calibration_error, find_calibration_error, weigh_rows
from labsim.diagnosis.judge import PRIOR_NONE


def test_calibration_error_is_the_distance_of_each_bin_by_weight() -> None:
    said = pd.Series([0.6, 0.6, 0.95, 0.95])
    right = pd.Series([True, False, True, True])
    even = pd.Series(1.0, said.index)
    assert find_calibration_error(said, right, even) == pytest.approx((0.1 + 0.05) / 2)
    assert find_calibration_error(said, right, pd.Series([1.0, 3.0, 1.0, 1.0])) == pytest.approx(
        (abs(0.4 - 3 * 0.6) + 0.1) / 6
    )


def test_rows_of_a_kind_count_together_what_the_prior_gives_it() -> None:
    hidden = pd.Series(["none", "none", "unknown", "pore_gas", "frame_rate", "pore_gas + frame_rate"])
    weight = weigh_rows(hidden)
    assert weight.sum() == pytest.approx(1.0)
    assert weight[0] == weight[1] == pytest.approx(PRIOR_NONE / 2)
    assert weight[3] == weight[4]


def test_few_verdicts_are_off_by_chance_many_are_not() -> None:
    few, many = (pd.Series([0.8] * number) for number in (5, 2000))
    low, high = expect_calibration_error(few, few * 0 + 1)
    assert low >= 0 and high > 0.2
    assert expect_calibration_error(many, many * 0 + 1, 100)[1] < 0.02
