"""How far a hypothesis is followed from several strengths: what few runs say in proportion decides whether it has more."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis import explore
from labsim.effects import Normal, Parameter
from labsim.errors import ExtrapolationError

NOMINAL = SimpleNamespace(log_p_m=math.log(1000.0), evidence=0.0)
PARAMETER = Parameter("amount", "1", 0.0, (-10.0, 10.0), Normal(0.0, 2.0), 1.0, "of a test")


@pytest.fixture
def bench(monkeypatch):
    """Fits as a list of (what was asked for, ln p_m at the start); what they find is set by a test."""
    asked = []
    answers = {"known": {1000.0: (10.0, 0.5)}, "followed": (12.0, 0.5), "free": False}

    def fit_hypothesis(problem, names, start, *, sparse, nuisances, known=False):
        assert sparse
        begun = round(math.exp(start[0]), 6)
        asked.append(("known" if known else "followed", begun))
        found = answers["known"].get(begun) if known else answers["followed"]
        if found is None:
            raise ExtrapolationError("simulation", "runs", "fail")
        evidence, value = found
        return SimpleNamespace(
            hypothesis=names, log_p_m=start[0], evidence=evidence, values={names[0]: value}
        )

    def require_runs(problem, fit, *, sparse):
        assert sparse
        asked.append(("runs", round(math.exp(fit.log_p_m), 6)))

    monkeypatch.setattr(explore, "fit_hypothesis", fit_hypothesis)
    monkeypatch.setattr(explore, "require_runs", require_runs)
    monkeypatch.setattr(explore, "_start_at", lambda problem, nominal, names, start: {names[0]: 0.1})
    problem = SimpleNamespace(
        campaign=SimpleNamespace(p_m_range=(300.0, 6000.0)),
        effects={"a": SimpleNamespace(amplitudes=[PARAMETER])},
        acts_on_projectile=lambda name: answers["free"],
    )

    def run(top: float):
        asked.clear()
        return explore.fit_from_strengths(problem, NOMINAL, ("a",), top), list(asked)

    return answers, run


def test_all_strengths_are_begun_from_and_the_best_is_followed(bench):
    answers, run = bench
    answers["known"] = {1000.0: (10.0, 0.5), 2500.0: (30.0, 0.5), 400.0: (20.0, 0.5)}
    found, asked = run(0.0)
    assert asked == [("known", 1000.0), ("known", 2500.0), ("known", 400.0), ("followed", 2500.0)]
    assert found.evidence == 12.0  # what its own runs say, not what was promised


@pytest.mark.parametrize(("top", "followed"), [(60.0, True), (80.0, False), (300.0, False)])
def test_what_is_far_behind_by_few_runs_has_no_more(bench, top, followed):
    _, run = bench
    found, asked = run(top)
    assert (("followed", 1000.0) in asked) is followed
    assert found.evidence == (12.0 if followed else 10.0)


def test_of_a_large_gain_half_is_asked(bench):
    """What runs bend may double a gain: of 500, those that promise 260 are followed, those with 240 are not."""
    answers, run = bench
    for promised, followed in ((260.0, True), (240.0, False)):
        answers["known"] = {1000.0: (promised, 0.5)}
        _, asked = run(500.0)
        assert (("followed", 1000.0) in asked) is followed


def test_a_large_amplitude_is_looked_at_once_more(bench):
    """In proportion to one step, friction of four steps promised 79 where its own runs gave 212."""
    answers, run = bench
    answers["known"] = {1000.0: (10.0, 4.0)}
    _, asked = run(300.0)
    assert asked == [
        ("known", 1000.0),
        ("known", 2500.0),
        ("known", 400.0),
        ("runs", 1000.0),
        ("known", 1000.0),
    ]


def test_a_law_that_takes_no_runs_is_followed_from_everywhere(bench):
    answers, run = bench
    answers.update(free=True, known={1000.0: (10.0, 5.0), 2500.0: (-900.0, 5.0), 400.0: (1.0, 5.0)})
    _, asked = run(300.0)
    assert [each for each in asked if each[0] != "known"] == [
        ("followed", 1000.0),
        ("followed", 2500.0),
        ("followed", 400.0),
    ]


def test_where_no_run_stops_there_is_none(bench):
    answers, run = bench
    answers["known"] = {}
    found, asked = run(0.0)
    assert found is None and {kind for kind, _ in asked} == {"known"}


def test_half_of_a_gain_is_measured_from_the_nominal_model():
    assert explore.allow_behind(100.0, NOMINAL) == 60.0
    assert np.isclose(explore.allow_behind(500.0, NOMINAL), 250.0)
