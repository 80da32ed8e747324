"""Gauss-Newton where plain steps run away, and where a limit stops one: against exact answers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import dblquad

from labsim.effects import Normal, Parameter
from labsim.inference.calibrate import warn_unsettled
from labsim.inference.fits import fitting, steps
from labsim.inference.fits.blocks import Block
from labsim.inference.observations.linearised_drop import ErrorBudget

RANGE = (300.0, 6000.0)


def a_bench(monkeypatch, predict, data, sigma, limits=(-10.0, 10.0)):
    """A problem of one block: predict(ln p_m, amplitude) -> (n,) prediction and its tangents (n, 2)."""
    parameter = Parameter("amount", "1", 0.0, limits, Normal(0.0, 2.0), 1.0, "of a test")
    seen = []

    def linearise(problem, nuisances, log_p_m, values, further=()):
        prediction, tangents = predict(log_p_m, values.get("effect", 0.0))
        seen.append(log_p_m)
        names = dict(zip(("ln_p_m", "effect"), np.atleast_2d(tangents).T, strict=False))
        return (Block(data - prediction, sigma**2 * np.eye(data.size), names),)

    monkeypatch.setattr(steps, "linearise_at", linearise)
    return SimpleNamespace(
        campaign=SimpleNamespace(p_m_range=RANGE),
        felt=False,
        node_step=1.0,
        effects={"effect": SimpleNamespace(amplitudes=[parameter])},
        observations=[SimpleNamespace(begin=lambda: np.empty(0), follow=lambda own, block, left: (own, 0.0))],
        shape_evidence={},
        budget=ErrorBudget(),
        affects_simulation=lambda name: False,
        require_base_about=lambda log_p_m: None,
        seen=seen,
    )


def bend(monkeypatch):
    """A prediction that saturates on both sides of its middle: from far away the tangent points far beyond it."""
    middle = math.log(1300.0)

    def predict(log_p_m, amplitude):
        x = 5.0 * (log_p_m - middle)
        return np.array([math.atan(x)]), np.array([[5.0 / (1 + x * x)]])

    return a_bench(monkeypatch, predict, np.zeros(1), 0.01), middle


def test_a_step_that_leads_away_is_halved(monkeypatch):
    problem, middle = bend(monkeypatch)
    fit = fitting.fit_hypothesis(problem, (), (middle + 0.33, {}))
    assert fit.log_p_m == pytest.approx(middle, abs=1e-4)
    assert fit.chi_square < 1e-3
    assert fit.unsettled < 0.05 and not warn_unsettled(fit)


def test_plain_steps_run_away_there(monkeypatch):
    problem, middle = bend(monkeypatch)
    monkeypatch.setattr(fitting, "LOWER", math.inf)
    fit = fitting.fit_hypothesis(problem, (), (middle + 0.33, {}))
    assert abs(fit.log_p_m - middle) > 0.3
    assert fit.unsettled > 1.0 and warn_unsettled(fit)[0].startswith("the fit still asks for a step of")


@pytest.mark.parametrize("known", [True, False])
def test_a_fit_on_what_is_known_asks_for_no_runs(monkeypatch, known):
    problem, middle = bend(monkeypatch)
    asked, based = [], []
    monkeypatch.setattr(fitting, "_ask", lambda *_, **__: asked.append(True))
    problem.require_base_about = based.append
    fit = fitting.fit_hypothesis(problem, (), (middle + 0.33, {}), known=known)
    assert fit.log_p_m == pytest.approx(middle, abs=1e-4)
    assert bool(asked) is not known and bool(based) is known


@pytest.mark.parametrize("hidden", [-1.5, -0.1, 0.4])
def test_an_amplitude_stopped_at_its_limit_leaves_p_m_at_its_best_there(monkeypatch, hidden):
    rng = np.random.default_rng(4)
    middle, sigma = math.log(1300.0), 0.3
    tangents = rng.standard_normal((12, 2)) @ np.array([[1.0, 0.8], [0.0, 0.6]])
    data = tangents @ np.array([0.05, hidden]) + sigma * rng.standard_normal(12)

    def predict(log_p_m, amplitude):
        return tangents @ np.array([log_p_m - middle, amplitude]), tangents

    problem = a_bench(monkeypatch, predict, data, sigma, limits=(0.0, 10.0))
    fit = fitting.fit_hypothesis(problem, ("effect",), (middle, {"effect": 1.0}))
    alone = float(tangents[:, 0] @ data / (tangents[:, 0] @ tangents[:, 0]))
    if hidden < 0:
        assert fit.values["effect"] == 0.0
        assert fit.log_p_m - middle == pytest.approx(alone, abs=1e-6)
    low, high = (math.log(p) - middle for p in RANGE)
    parameter = problem.effects["effect"].amplitudes[0]

    def density(amplitude, moved):
        left = data - tangents @ np.array([moved, amplitude])
        return math.exp(-0.5 * left @ left / sigma**2 + float(parameter.log_prior(amplitude)))

    total, _ = dblquad(density, low, high, 0.0, 6.0, epsabs=1e-14, epsrel=1e-6)
    exact = math.log(total / (high - low)) - 12 * math.log(sigma * math.sqrt(2 * math.pi))
    # Laplace's formula takes the prior at the limit for that over the tail, and its curvature with the data's
    assert fit.evidence == pytest.approx(exact, abs=0.1)


def test_p_m_stopped_at_its_end_leaves_an_amplitude_at_its_best_there(monkeypatch):
    """The least squares under the bound, in closed form; and the evidence, by quadrature."""
    rng = np.random.default_rng(7)
    low, high = (math.log(p) for p in (300.0, 6000.0))
    sigma = 0.2
    tangents = rng.standard_normal((15, 2)) @ np.array([[1.0, 0.7], [0.0, 0.7]])
    data = tangents @ np.array([0.4, 0.3]) + sigma * rng.standard_normal(15)  # 0.4 beyond the end

    def predict(log_p_m, amplitude):
        return tangents @ np.array([log_p_m - high, amplitude]), tangents

    problem = a_bench(monkeypatch, predict, data, sigma)
    fit = fitting.fit_hypothesis(problem, ("effect",), (high - 0.6, {"effect": 0.0}))
    parameter = problem.effects["effect"].amplitudes[0]
    column = tangents[:, 1]
    best = float(column @ data / (column @ column + sigma**2 / parameter.scale**2))
    assert fit.log_p_m == pytest.approx(high, abs=1e-9)
    assert fit.values["effect"] == pytest.approx(best, abs=1e-6)

    def density(amplitude, moved):
        left = data - tangents @ np.array([moved, amplitude])
        return math.exp(-0.5 * left @ left / sigma**2 + float(parameter.log_prior(amplitude)))

    total, _ = dblquad(density, low - high, 0.0, -6.0, 6.0, epsabs=1e-14, epsrel=1e-6)
    exact = math.log(total / (high - low)) - 15 * math.log(sigma * math.sqrt(2 * math.pi))
    assert fit.evidence == pytest.approx(exact, abs=0.1)
