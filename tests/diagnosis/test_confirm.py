"""Which of the explored effects are worth finer runs."""

from types import SimpleNamespace

import pytest

from labsim.diagnosis import campaign


def a_fit(name: str, evidence: float) -> SimpleNamespace:
    return SimpleNamespace(hypothesis=(name,), evidence=evidence, log_p_m=7.0, values={name: 0.1})


@pytest.mark.parametrize(
    ("without_place", "finer"),
    [
        (300.0, ["shear_strength", "pore_gas"]),  # a law without a name gains 200, they 150 and 110
        (310.0, ["shear_strength", "pore_gas"]),
        (330.0, ["shear_strength"]),  # half of its gain is 115
        (450.0, []),
    ],
)
def test_an_effect_far_behind_a_law_without_a_name_is_not_run_finer(monkeypatch, without_place, finer):
    asked = []

    def fit_hypothesis(bench, hypothesis, start, **_):
        asked.append(hypothesis[0])
        return a_fit(hypothesis[0], 260.0)

    monkeypatch.setattr(campaign, "fit_hypothesis", fit_hypothesis)
    explored = {
        name: a_fit(name, evidence) for name, evidence in (("shear_strength", 250.0), ("pore_gas", 210.0))
    }
    fits = campaign.confirm_explored(None, a_fit("", 100.0), [], explored, without_place)
    assert asked == finer
    found = {fit.hypothesis[0]: fit.evidence for fit in fits}
    # what is not run finer stays as it was explored: the nearest listed cause has a name
    assert found["shear_strength"] == (260.0 if "shear_strength" in finer else 250.0)
