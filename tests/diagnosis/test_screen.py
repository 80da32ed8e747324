"""Linear Bayes factors end where the range of p_m and the limits of amplitudes end: against quadrature of the same integrals."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp

from labsim.diagnosis.screen import Screening, compare_linear, screen_pairs
from labsim.effects import HalfNormal, Normal, Parameter

RANGE = (300.0, 6000.0)
TOLD = 0.15  # of a ln Bayes factor, where two limits cut one Gaussian; its screening asks for 3 and 30
PARAMETERS = {
    "free": Parameter("a", "1", 0.0, (-9.0, 9.0), Normal(0.0, 1.5), 1.0, "of a test"),
    "positive": Parameter("b", "1", 0.0, (0.0, 9.0), HalfNormal(1.5), 1.0, "of a test"),
}
BENCH = SimpleNamespace(
    campaign=SimpleNamespace(p_m_range=RANGE),
    effects={name: SimpleNamespace(amplitudes=[each]) for name, each in PARAMETERS.items()},
)


def see(p_m: float, wanted: float, free: float, positive: float) -> tuple[Screening, np.ndarray, np.ndarray]:
    """A screening at p_m of white data that hold these amplitudes and want ln p_m so far away; the data and their tangents."""
    rng = np.random.default_rng(3)
    tangents = rng.standard_normal((9, 3)) @ np.array([[2.0, 1.2, 1.5], [0.0, 0.8, 0.3], [0.0, 0.0, 0.6]])
    data = tangents @ np.array([wanted, free, positive]) + 0.5 * rng.standard_normal(9)
    length = np.linalg.norm(tangents[:, 0])
    direction = tangents[:, 0] / length
    beside = np.column_stack([data, tangents[:, 1:]])
    along = direction @ beside
    beside = beside - np.outer(direction, along)
    screening = Screening(
        [],
        list(PARAMETERS),
        np.eye(2),
        1.0,
        beside[:, 0],
        beside[:, 1:],
        math.log(p_m),
        along[0] / length,
        1.0 / length,
        along[1:] / length,
    )
    return screening, data, tangents


def integrate(data, tangents, *axes):
    """ln of the integral of likelihood and priors by midpoints; axes : (parameter or None, low, high, points), ln p_m first."""
    middles = [low + (np.arange(n) + 0.5) * (high - low) / n for _, low, high, n in axes]
    total = math.log(math.prod((high - low) / n for _, low, high, n in axes)) - 0.5 * data @ data
    places = np.meshgrid(*middles, indexing="ij", sparse=True)
    pull, information = tangents.T @ data, tangents.T @ tangents
    log = sum(pull[k] * x for k, x in enumerate(places))
    log = log - 0.5 * sum(
        information[i, j] * x * y for i, x in enumerate(places) for j, y in enumerate(places)
    )
    for (parameter, *_), x in zip(axes, places, strict=True):
        if parameter is not None:
            log = log + parameter.log_prior(x)
    return total + float(logsumexp(log))


def ends(p_m):
    return tuple(math.log(p / p_m) for p in RANGE)


@pytest.mark.parametrize(("p_m", "wanted"), [(1300.0, 0.1), (6000.0, 0.8), (6000.0, 1.6), (300.0, -1.0)])
@pytest.mark.parametrize("amplitude", [-0.8, 0.7])
@pytest.mark.parametrize("name", list(PARAMETERS))
def test_bayes_factors_end_with_the_range_and_the_limits(name, amplitude, p_m, wanted):
    place = list(PARAMETERS).index(name)
    hidden = [0.0, 0.0]
    hidden[place] = amplitude
    screening, data, tangents = see(p_m, wanted, *hidden)
    parameter, columns = PARAMETERS[name], tangents[:, [0, 1 + place]]
    strength = (None, *ends(p_m), 2000)
    nominal = integrate(data, columns[:, :1], strength)
    extended = integrate(data, columns, strength, (parameter, *parameter.limits, 700))
    assert compare_linear(BENCH, screening, [place]) == pytest.approx(extended - nominal, abs=TOLD)


def test_what_takes_the_place_of_a_strength_beyond_the_range_gains_what_the_range_costs():
    """As much as p_m itself would, were it free; were it taken to be free, an effect alike to it would gain nothing."""
    screening, *_ = see(6000.0, 1.6, 0.0, 0.0)
    held = compare_linear(BENCH, screening, [0])
    inside, *_ = see(1300.0, 1.6, 0.0, 0.0)
    assert held > 5.0
    assert compare_linear(BENCH, inside, [0]) < 1.0


def test_an_amplitude_on_the_other_side_of_its_limit_promises_nothing():
    screening, *_ = see(1300.0, 0.0, 0.0, -2.0)
    assert compare_linear(BENCH, screening, [1]) < 0.0
    screening, *_ = see(1300.0, 0.0, 0.0, 2.0)
    assert compare_linear(BENCH, screening, [1]) > 3.0


def test_pairs_are_integrated_alike():
    screening, data, tangents = see(6000.0, 0.4, 1.2, 0.9)
    free, positive = PARAMETERS.values()
    nominal = integrate(data, tangents[:, :1], (None, *ends(6000.0), 2000))
    extended = integrate(
        data, tangents, (None, -1.0, 0.0, 150), (free, -5.0, 7.0, 150), (positive, 0.0, 8.0, 120)
    )
    [(names, log_bayes)] = screen_pairs(BENCH, screening)
    assert names == ("free", "positive")
    assert log_bayes == pytest.approx(extended - nominal, abs=TOLD)
