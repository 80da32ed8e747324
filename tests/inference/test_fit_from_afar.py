"""A nominal fit that is lost is looked for over the whole range of p_m."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from labsim.errors import ExtrapolationError
from labsim.inference import calibrate

RANGE = (300.0, 6000.0)
BENCH = SimpleNamespace(felt=True, campaign=SimpleNamespace(p_m_range=RANGE))


def make_fit(log_p_m: float, evidence: float) -> SimpleNamespace:
    return SimpleNamespace(log_p_m=log_p_m, evidence=evidence)


def test_the_best_place_of_the_range_is_begun_from(monkeypatch):
    """The data hardly speak but near 340 Pa, where the others' slopes do not point; the softest dust cannot be simulated."""
    begun = []

    def fit(problem, hypothesis, start, *, nuisances=None, iterations=40):
        log_p_m, values = start
        assert (problem, hypothesis, values) == (BENCH, (), {})
        if log_p_m < math.log(301.0):
            raise ExtrapolationError("simulation", "runs", "fail")
        off = abs(log_p_m - math.log(340.0))
        if iterations == 0:
            return make_fit(log_p_m, -100.0 * off if off < 0.7 else -1e4)
        begun.append(log_p_m)
        assert nuisances is not None
        return make_fit(math.log(340.0), 0.0) if off < 0.7 else make_fit(log_p_m, -1e4)

    monkeypatch.setattr(calibrate, "fit_hypothesis", fit)
    found = calibrate.fit_from_afar(BENCH, make_fit(math.log(1414.0), -1e4))
    assert math.exp(found.log_p_m) == pytest.approx(340.0)
    assert begun and abs(begun[0] - math.log(340.0)) < 0.7


def test_a_fit_that_was_best_stays(monkeypatch):
    nominal = make_fit(math.log(1000.0), -5.0)
    monkeypatch.setattr(calibrate, "fit_hypothesis", lambda *_, **__: make_fit(0.0, -50.0))
    assert calibrate.fit_from_afar(BENCH, nominal) is nominal
