"""Pairs are simulated where the linear screening promises that they come near what a law without a name explains."""

from types import SimpleNamespace

import pytest

from labsim.diagnosis import campaign
from labsim.diagnosis.screen import Score


def confirm(monkeypatch: pytest.MonkeyPatch, without_place: float, partner: float, joint: float) -> list:
    """Hypotheses asked for: a single 50 above the nominal model, a partner and a pair that promise so much (ln Bayes factors)."""
    asked = []
    monkeypatch.setattr(
        campaign,
        "screen",
        lambda *_: SimpleNamespace(scores=[Score("pore_gas", 1.0, 1.0, 1.0, partner)]),
    )
    monkeypatch.setattr(campaign, "screen_pairs", lambda *_: [(("surface_crust", "pixel_scale"), joint)])
    monkeypatch.setattr(campaign, "fit_hypothesis", lambda bench, pair, *_, **__: asked.append(pair) or pair)
    bench = SimpleNamespace(
        effects={
            name: SimpleNamespace(kind="material")
            for name in ("shear_strength", "pore_gas", "surface_crust", "pixel_scale")
        }
    )
    nominal = SimpleNamespace(evidence=100.0, log_p_m=7.0, values={})
    lead = SimpleNamespace(
        evidence=150.0, hypothesis=("shear_strength",), log_p_m=7.0, values={"shear_strength": 0.1}
    )
    campaign.confirm_pairs(bench, nominal, [lead], SimpleNamespace(scores=[]), without_place)
    return asked


def test_a_promising_partner_and_a_promising_pair_are_simulated(monkeypatch):
    asked = confirm(monkeypatch, without_place=120.0, partner=10.0, joint=60.0)
    assert asked == [("shear_strength", "pore_gas"), ("surface_crust", "pixel_scale")]


def test_what_promises_nothing_is_not(monkeypatch):
    assert confirm(monkeypatch, without_place=120.0, partner=2.0, joint=52.0) == []


@pytest.mark.parametrize(
    ("ahead", "expected"), [(30.0, 2), (45.0, 1), (90.0, 0)]
)  # of the single, in ln evidence
def test_a_law_without_a_name_far_ahead_leaves_none_worth_its_runs(monkeypatch, ahead, expected):
    asked = confirm(monkeypatch, without_place=150.0 + ahead, partner=14.0, joint=70.0)
    assert len(asked) == expected
