"""The judgement on published figures, on numbers made up for it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from labsim.diagnosis.published.campaign import bound_probability, judge_predictions
from labsim.diagnosis.published.prediction import Prediction

RANDOM = np.random.default_rng(3)


def row(kind: str, predicted: float, observed: float = 1.0, sigma: float = 0.05) -> Prediction:
    return Prediction(f"a {kind}", kind, "s", observed, sigma, predicted, 0.0)


def test_a_row_counts_both_errors() -> None:
    both = Prediction("T_s, 1 mm", "stopping_time", "s", 3.0e-3, 0.3e-3, 2.0e-3, 0.4e-3)
    assert both.deviation == pytest.approx(-2.0) and not both.missed
    assert row("stopping_time", 1.11).missed


def test_a_model_that_is_right_is_called_wrong_as_often_as_it_should_be() -> None:
    """p-values of predictions that differ from the truth by their stated errors alone are uniform."""
    found = []
    for _ in range(400):
        shared = 0.03 * RANDOM.standard_normal()  # p_m, common to all rows
        law = (
            math.sqrt(0.5) * 0.05 * RANDOM.standard_normal()
        )  # half of the law's variance is common to the sizes
        rows, samples, diagonal = [], [], []
        for kind in ("depth", "stopping_time", "depth", "stopping_time"):
            own = math.sqrt(0.5) * 0.05 if kind == "depth" else 0.04
            noise = own * RANDOM.standard_normal() + (law if kind == "depth" else 0.0)
            rows.append(row(kind, 1.0))
            samples.append(shared + noise + 0.03 * np.linspace(-1.7, 1.7, 2001))
            diagonal.append(0.0 if kind == "depth" else 0.04)
        found.append(judge_predictions(rows, samples, diagonal))
    below = np.mean(np.array(found) < 0.05)
    assert 0.02 < below < 0.09
    assert 0.4 < np.median(found) < 0.6


def test_a_misfit_that_p_m_could_explain_counts_less_than_one_it_cannot() -> None:
    rows = [row("stopping_time", 1.0), row("stopping_time", 1.0)]
    width = 0.1 * np.linspace(-1.7, 1.7, 2001)
    together = judge_predictions(rows, [0.15 + width, 0.15 + width], [0.03, 0.03])
    apart = judge_predictions(rows, [0.15 + width, -0.15 + width], [0.03, 0.03])
    assert together > 0.05 and apart < 1e-6


def test_the_bound_of_the_probability() -> None:
    assert bound_probability(1.0) == bound_probability(0.5) == 0.5
    values = [bound_probability(p) for p in (0.3, 0.05, 0.01, 1e-6, 0.0)]
    assert values == sorted(values)
    assert bound_probability(0.05) == pytest.approx(1.0 / (1.0 - math.e * 0.05 * math.log(0.05)))
