"""Expected information against cases that are known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.seed.tables import expected_information

EVEN = np.array([0.5, 0.5])


@pytest.mark.parametrize(("apart", "bits"), [(0.0, 0.0), (50.0, 1.0)])
def test_two_hypotheses_that_predict_the_same_or_far_apart(apart: float, bits: float) -> None:
    means = np.array([[0.0, 0.0], [apart, 0.0]])
    assert expected_information(means, np.eye(2), EVEN) == pytest.approx(bits, abs=1e-9)


def test_never_more_than_the_measurement_can_tell() -> None:
    """Two Gaussians 2 standard deviations apart: the information by integration, of which the bound lies below."""
    x = np.linspace(-9.0, 11.0, 20001)
    each = [np.exp(-((x - m) ** 2) / 2) / np.sqrt(2 * np.pi) for m in (0.0, 2.0)]
    whole = 0.5 * (each[0] + each[1])
    true = sum(0.5 * np.trapezoid(p * np.log2(np.maximum(p, 1e-300) / whole), x) for p in each)
    bound = expected_information(np.array([[0.0], [2.0]]), np.eye(1), EVEN)
    assert 0.5 * true < bound < true


def test_a_correlated_error_is_counted_once() -> None:
    """What moves both values together tells nothing where only the difference differs less than its error."""
    spread = np.array([[1.0, 0.999], [0.999, 1.0]])
    along = expected_information(np.array([[0.0, 0.0], [1.0, 1.0]]), spread, EVEN)
    across = expected_information(np.array([[0.0, 0.0], [1.0, -1.0]]), spread, EVEN)
    assert along < 0.2 and across > 0.99
