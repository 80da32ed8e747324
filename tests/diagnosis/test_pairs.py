"""Pairs are simulated where the linear screening promises that they come near what a law without a name explains."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis import pairs
from labsim.diagnosis.screen import Score


def confirm(
    monkeypatch: pytest.MonkeyPatch, log_evidence_unknown: float, partner: float, joint: float
) -> list:
    """Hypotheses asked for: a single 50 above the nominal model, a partner and a pair that promise so much (ln Bayes factors)."""
    asked = []
    monkeypatch.setattr(
        pairs,
        "screen",
        lambda *_: SimpleNamespace(scores=[Score("pore_gas", 1.0, 1.0, 1.0, partner)]),
    )
    monkeypatch.setattr(pairs, "screen_pairs", lambda *_: [(("surface_crust", "pixel_scale"), joint)])
    monkeypatch.setattr(pairs, "fit_hypothesis", lambda problem, pair, *_, **__: asked.append(pair) or pair)
    problem = SimpleNamespace(
        effects={
            name: SimpleNamespace(kind="material")
            for name in ("shear_strength", "pore_gas", "surface_crust", "pixel_scale")
        }
    )
    nominal = SimpleNamespace(evidence=100.0, log_p_m=7.0, values={})
    lead = SimpleNamespace(
        evidence=150.0, hypothesis=("shear_strength",), log_p_m=7.0, values={"shear_strength": 0.1}
    )
    pairs.confirm_pairs(problem, nominal, [lead], SimpleNamespace(scores=[]), log_evidence_unknown)
    return asked


def test_a_promising_partner_and_a_promising_pair_are_simulated(monkeypatch):
    asked = confirm(monkeypatch, log_evidence_unknown=120.0, partner=10.0, joint=60.0)
    assert asked == [("shear_strength", "pore_gas"), ("surface_crust", "pixel_scale")]


def test_what_promises_nothing_is_not(monkeypatch):
    assert confirm(monkeypatch, log_evidence_unknown=120.0, partner=2.0, joint=52.0) == []


@pytest.mark.parametrize(
    ("ahead", "expected"), [(30.0, 2), (45.0, 1), (90.0, 0)]
)  # of the single, in ln evidence
def test_a_law_without_a_name_far_ahead_leaves_none_worth_its_runs(monkeypatch, ahead, expected):
    asked = confirm(monkeypatch, log_evidence_unknown=150.0 + ahead, partner=14.0, joint=70.0)
    assert len(asked) == expected


def test_partners_of_a_single_that_explains_little_are_not_even_asked_for(monkeypatch):
    """To screen them takes runs about the single: it gains 50, a law without a name 124 or 126."""
    assert confirm(monkeypatch, log_evidence_unknown=224.0, partner=50.0, joint=0.0) == [
        ("shear_strength", "pore_gas")
    ]
    assert confirm(monkeypatch, log_evidence_unknown=226.0, partner=50.0, joint=0.0) == []


def a_fit(evidence: float, values: dict[str, float], sigma: float = 0.1) -> SimpleNamespace:
    covariance = np.diag([0.01, *(sigma**2 for _ in values)])
    return SimpleNamespace(
        hypothesis=tuple(values), evidence=evidence, values=values, covariance=covariance, log_p_m=7.0
    )


@pytest.mark.parametrize(
    ("second", "pair", "again", "expected"),
    [
        (0.05, 60.0, 62.0, 62.0),  # the pair's other effect is absent: its single lies better from there
        (0.05, 60.0, 40.0, 50.0),  # but not always
        (0.5, 60.0, 62.0, 50.0),  # both are at work
        (0.05, 45.0, 62.0, 50.0),  # the single leads as it is
    ],
)
def test_a_pair_whose_other_effect_is_absent_says_where_its_single_lies(
    monkeypatch, second, pair, again, expected
):
    fits = [a_fit(50.0, {"strength_slope": -0.2})]
    leading = a_fit(pair, {"strength_slope": -0.4, "pore_gas": second})
    monkeypatch.setattr(pairs, "fit_hypothesis", lambda *_, **__: a_fit(again, {"strength_slope": -0.4}))
    (single,) = pairs.return_to_singles(None, fits, [leading])
    assert single.evidence == expected


@pytest.mark.parametrize(
    ("evidence", "log_evidence_unknown", "large", "settled"),
    [
        (60.0, 70.0, True, True),
        (45.0, 70.0, True, False),  # a single leads
        (60.0, 95.0, True, False),  # a law without a name is far ahead
        (60.0, 70.0, False, False),  # nothing of it is large
    ],
)
def test_the_leading_pair_is_settled_where_it_is_large(
    monkeypatch, evidence, log_evidence_unknown, large, settled
):
    best, other = a_fit(evidence, {"a": 1.0, "b": 1.0}), a_fit(40.0, {"a": 1.0, "c": 1.0})
    monkeypatch.setattr(pairs, "list_large_effects", lambda *_: ["a"] if large else [])
    monkeypatch.setattr(pairs, "refine", lambda problem, fit: a_fit(fit.evidence + 5.0, fit.values))
    found = pairs.refine_leading(None, [a_fit(50.0, {"a": 1.0})], [other, best], log_evidence_unknown)
    assert sorted(fit.evidence for fit in found) == [40.0, evidence + 5.0 * settled]
