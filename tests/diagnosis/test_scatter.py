"""Samples that scatter by more than a model allows are neither a cause nor unknown."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import halfnorm, norm

from labsim.diagnosis.scatter import WIDTH, find_larger, find_scatter, weigh_least

DROPS, POINTS = 15, 6


def set_residuals(scatter: float, seed: int, used: float = 0.02):
    """A bench and a fit whose drops differ by ``scatter`` of ln p_m: points of 3e-6 m that p_m moves by 1e-4 m per ln."""
    rng = np.random.default_rng(seed)
    tangent = np.full(DROPS * POINTS, 1e-4)
    sections = {f"D{k}": slice(k * POINTS, (k + 1) * POINTS) for k in range(DROPS)}
    offsets = np.repeat(scatter * rng.standard_normal(DROPS), POINTS)
    covariance = np.diag(np.full(DROPS * POINTS, 3e-7**2))
    for section in sections.values():
        covariance[section, section] += used**2 * np.outer(tangent[section], tangent[section])
    residual = offsets * tangent + 3e-7 * rng.standard_normal(DROPS * POINTS)
    linear = SimpleNamespace(
        tangents={"ln_p_m": tangent}, covariance=covariance, sections=sections, residual=residual
    )
    return SimpleNamespace(terms=SimpleNamespace(scatter=used)), SimpleNamespace(linear=linear)


@pytest.mark.parametrize(("scatter", "least"), [(0.02, 0), (0.06, 95), (0.10, 100)])
def test_a_larger_scatter_is_asked_for_where_samples_have_one(scatter, least):
    first = weigh_least(0.02)
    found = [find_larger(first, *set_residuals(scatter, seed)) for seed in range(100)]
    asked = [each.value for each in found if each is not None]
    print(f"{scatter}: {len(asked)} of 100, {np.mean(asked or [0]):.3f}")
    assert least <= len(asked) <= (100 if least else 10)
    if least:  # the mean of a density that is skew: somewhat more than the truth
        assert np.mean(asked) == pytest.approx(scatter, rel=0.15)


def test_prior_of_a_scatter_is_its_share_of_the_half_normal():
    bench, fit = set_residuals(0.08, 5)
    asked = find_scatter(bench, fit)
    assert 0.05 < asked.value < 0.13
    mean, sigma = (
        asked.value,
        math.exp(asked.log_prior - halfnorm.logpdf(asked.value, scale=WIDTH)) / math.sqrt(2 * math.pi),
    )
    share = quad(
        lambda s: norm.pdf(s, mean, sigma) / norm.pdf(0) * sigma * halfnorm.pdf(s, scale=WIDTH), 0, 1
    )[0]
    assert math.exp(asked.log_prior) == pytest.approx(share, rel=0.2)
    assert math.exp(weigh_least(0.02).log_prior) == pytest.approx(halfnorm.cdf(0.03, scale=WIDTH))
