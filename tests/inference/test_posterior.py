"""A best fit at the limits of its parameters still has a posterior; one that is impossible all around says so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from labsim.errors import InferenceError
from labsim.inference.fits.posterior import sample

CENTRE, SIGMA = np.array([7.0, 0.4]), np.array([0.1, 1e-3])


def beyond_both_limits(theta: np.ndarray) -> np.ndarray:
    u = (theta - CENTRE) / SIGMA
    return np.where((u <= 0).all(axis=1), -0.5 * (u**2).sum(axis=1), -np.inf)


def test_a_corner_of_the_limits() -> None:
    found = sample(beyond_both_limits, ["a", "b"], CENTRE, np.diag(SIGMA**2), seed=1)
    half = truncnorm(-np.inf, 0)
    for name, centre, sigma in zip(("a", "b"), CENTRE, SIGMA, strict=True):
        u = (found.samples(name) - centre) / sigma
        assert u.max() <= 0
        assert u.mean() == pytest.approx(half.mean(), abs=0.05)
        assert u.std() == pytest.approx(half.std(), abs=0.05)
    assert found.r_hat < 1.05


def test_nowhere_to_begin() -> None:
    with pytest.raises(InferenceError, match="zero all around"):
        sample(lambda theta: np.full(len(theta), -np.inf), ["a"], CENTRE[:1], np.eye(1), seed=1)
