"""Effects hidden in data by an independent simulator are found by reading the campaign folder alone."""

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis import campaign
from labsim.diagnosis.campaign import diagnose_campaign
from labsim.diagnosis.judge import PRIOR_PAIRS, TEMPERATURE, judge
from labsim.inference.fits.blocks import Block
from labsim.inference.fits.fitting import Fit
from labsim.inference.observations.linearised_drop import ErrorBudget
from labsim.inference.scatter import Scatter
from labsim.runs.store import RunStore

CAMPAIGNS = Path(__file__).parents[2] / "data" / "campaigns"
TRUTH = json.loads((CAMPAIGNS / "truth.json").read_text())


# Drops of one rod at six or seven speeds: a third of the runs of all four projectiles, and enough to name the cause; the share of
# the discrepancy that the extension takes out is above the noise of these drops with all of them only.
ONE_ROD = tuple(f"D{number:02d}" for number in range(1, 8))


@pytest.mark.parametrize("drops", [ONE_ROD, pytest.param((), marks=pytest.mark.slow)], ids=["one rod", "all"])
@pytest.mark.parametrize(
    "name", sorted(set(TRUTH) - {"u01", "g41", "h01"})
)  # a law that is not listed; static tests; a floor that these rods do not feel
def test_the_hidden_cause_is_named(name, drops, shared_store):
    campaign = read_campaign(CAMPAIGNS / name)
    if drops:
        campaign = replace(campaign, drops=tuple(drop for drop in campaign.drops if drop.name in drops))
    found = diagnose_campaign(campaign, RunStore(shared_store), workers=1)
    truth = TRUTH[name]
    best, probability = found.verdict.probabilities[0]
    assert best == (truth["cause"],)
    assert probability > 0.5
    assert sum(p for _, p in found.verdict.probabilities) == pytest.approx(1.0, abs=1e-9)
    low, high = np.quantile(found.posterior_extended.samples("p_m_Pa"), [0.005, 0.995])
    assert low < truth["pm"] < high
    if truth["cause"] == "none":
        assert found.p_value > 0.05
        assert found.unknown.tangents is None and found.unknown.beside == -math.inf  # no runs for a free law
    else:
        assert found.p_value < 0.01
        assert found.gain.log_score_difference > 4
        # a wrong scale is on the held-out drop's own free fall too
        if not drops and found.gain.rms_nominal > found.gain.rms_noise:
            assert found.gain.fraction_removed > 0.8
        if not found.problem.felt and not found.problem.pushed:
            # a law left free competes though the cause explains all, and finds nothing on top of it
            assert found.unknown.tangents is not None and -10.0 < found.unknown.beside < 2.0


def fake_fit(hypothesis, evidence):
    return Fit(
        hypothesis,
        7.0,
        dict.fromkeys(hypothesis, 0.1),
        np.eye(1 + len(hypothesis)),
        1.0,
        1,
        0.0,
        evidence,
        (),
        (),
    )


def test_probabilities_follow_bayes():
    catalogue = ["a", "b", "c", "d"]
    verdict = judge(fake_fit((), 0.0), [fake_fit(("a",), 3.0)], -1.0, catalogue, {"b": 0.5, "c": -2.0})
    share = (1 - 0.5 - 0.1 - PRIOR_PAIRS) / 4
    something = share * (math.exp(3) + math.exp(0.5) + math.exp(-2)) + 0.1 * math.exp(-1)  # by the evidences
    weight = {
        ("a",): share * math.exp(3 / TEMPERATURE),
        ("b",): share * math.exp(0.5 / TEMPERATURE),
        ("c",): share * math.exp(-2 / TEMPERATURE),
        ("unknown",): 0.1 * math.exp(-1 / TEMPERATURE),
    }
    shared = sum(weight.values())
    weight = {name: value * something / shared for name, value in weight.items()} | {("none",): 0.5}
    total = 0.5 + something
    for hypothesis, probability in verdict.probabilities:
        assert probability == pytest.approx(weight[hypothesis] / total, rel=1e-12)
    assert verdict.word == "effect"


@pytest.mark.parametrize(
    ("predicted", "word"),
    [(1.0, "effect"), (0.06, "effect"), (0.03, "effect"), (0.01, "unknown"), (1e-300, "unknown")],
)
def test_a_cause_that_does_not_predict_held_out_drops_stands_back_behind_unknown(predicted, word):
    catalogue = ["a", "b", "c", "d"]
    verdict = judge(fake_fit((), 0.0), [fake_fit(("a",), 90.0)], -1.0, catalogue, {"b": 2.0}, predicted)
    found = dict(verdict.probabilities)
    assert verdict.word == word
    if (
        predicted < 0.05
    ):  # prior odds of what is not listed, times the bound of Sellke, Bayarri & Berger (2001), their eq. 2
        odds = 0.1 / 0.4 / (-math.e * predicted * math.log(predicted))
        assert found["unknown",] / found["a",] == pytest.approx(odds)
    else:
        share = (1 - 0.5 - 0.1 - PRIOR_PAIRS) / 4
        odds = 0.1 / share * math.exp(-91.0 / TEMPERATURE)
        assert found["unknown",] / found["a",] == pytest.approx(odds)
    assert sum(found.values()) == pytest.approx(1.0)


def test_a_cause_that_does_not_fit_its_own_data_is_doubted(monkeypatch):
    """A thousand residuals of 1 and of 1.4 standard deviations, both with held-out drops that are predicted."""
    monkeypatch.setattr(campaign, "check_prediction", lambda problem, fit, rng: 0.4)

    def check(size):
        block = Block(size * np.tile([1.0, -1.0], 500), np.eye(1000), {})
        fit = replace(fake_fit(("a",), 90.0), blocks=(block,))
        return campaign.check_leading(None, fit, np.random.default_rng(1))

    assert check(1.0) == 0.4
    assert check(1.4) < 1e-12


def test_a_pair_must_earn_its_second_effect():
    catalogue = ["a", "b", "c", "d"]
    single = fake_fit(("a",), 50.0)

    def ratio(gain: float) -> float:
        verdict = judge(
            fake_fit((), 0.0), [single, fake_fit(("a", "b"), 50.0 + gain)], -1.0, catalogue, {"c": 50.0}
        )
        found = dict(verdict.probabilities)
        prior = (1 - 0.5 - 0.1 - PRIOR_PAIRS) / 4 / (PRIOR_PAIRS / 6)
        assert found["c",] == pytest.approx(
            found["a",]
        )  # what explains as much as a part of the pair stands with it
        better = judge(
            fake_fit((), 0.0), [single, fake_fit(("a", "b"), 50.0 + gain)], -1.0, catalogue, {"c": 51.0}
        )
        found_better = dict(better.probabilities)
        assert found_better["a", "b"] / found_better["c",] == pytest.approx(
            math.exp((gain - 1.0) / TEMPERATURE) / prior
        )
        return found["a", "b"] / found["a",] * prior

    assert ratio(6.0) == pytest.approx(math.exp(6.0 / TEMPERATURE))
    assert ratio(8.0) == pytest.approx(math.exp(8.0 / TEMPERATURE))


@pytest.mark.parametrize(("p_value", "judged"), [(0.3, [0.4]), (1e-9, [0.02])])
def test_a_scatter_that_does_not_explain_the_data_spares_no_search(monkeypatch, p_value, judged):
    """In p12 mass sticks to the tip. Samples of 42 % scatter are far ahead of those of 2 % and explain nothing: the
    search for what is missing goes on with those of 2 %."""
    asked, seen = Scatter(0.4, -18.0), []
    loose = SimpleNamespace(evidence=1000.0)
    monkeypatch.setattr(campaign, "set_error_budget", lambda campaign: ErrorBudget())
    monkeypatch.setattr(campaign, "find_larger", lambda least, problem, fit: asked)
    monkeypatch.setattr(campaign, "fit_with", lambda scatter, problem, fit: (None, loose))
    monkeypatch.setattr(campaign, "fit_p_value", lambda fit: p_value)
    monkeypatch.setattr(campaign, "_promise", lambda problem, nominal, seed: 500.0)
    monkeypatch.setattr(campaign, "_find_larger", lambda found, least: None)
    monkeypatch.setattr(campaign, "judge_campaign", lambda problem, nominal, **_: seen.append(problem))
    campaign.judge_scatters(None, lambda budget: (budget.scatter, None))
    assert seen == judged
