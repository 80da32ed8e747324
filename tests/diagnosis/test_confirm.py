"""Which of the explored effects are worth finer runs."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis import campaign, explore
from labsim.inference.emulation.forward import ResponseTable


def a_fit(name: str, evidence: float) -> SimpleNamespace:
    return SimpleNamespace(hypothesis=(name,), evidence=evidence, log_p_m=7.0, values={name: 0.1})


@pytest.mark.parametrize(
    ("log_evidence_unknown", "finer"),
    [
        (300.0, ["shear_strength", "pore_gas"]),  # a law without a name gains 200, they 150 and 110
        (310.0, ["shear_strength", "pore_gas"]),
        (330.0, ["shear_strength"]),  # half of its gain is 115
        (450.0, []),
    ],
)
def test_an_effect_far_behind_a_law_without_a_name_is_not_run_finer(monkeypatch, log_evidence_unknown, finer):
    asked = []

    def fit_hypothesis(problem, hypothesis, start, **_):
        asked.append(hypothesis[0])
        return a_fit(hypothesis[0], 260.0)

    monkeypatch.setattr(campaign, "fit_hypothesis", fit_hypothesis)
    explored = {
        name: a_fit(name, evidence) for name, evidence in (("shear_strength", 250.0), ("pore_gas", 210.0))
    }
    fits = campaign.confirm_explored(None, a_fit("", 100.0), [], explored, log_evidence_unknown)
    assert asked == finer
    found = {fit.hypothesis[0]: fit.evidence for fit in fits}
    # what is not run finer stays as it was explored: the nearest listed cause has a name
    assert found["shear_strength"] == (260.0 if "shear_strength" in finer else 250.0)


@pytest.mark.parametrize(("from_null", "kept"), [(-70.0, "null"), (-90.0, "far")])
def test_a_fit_less_likely_than_its_null_is_made_again_from_there(monkeypatch, from_null, kept):
    """A bulk modulus ended at a limit of its amplitude, 8 in ln likelihood below the null that it holds."""
    starts = []

    def fit_hypothesis(problem, hypothesis, start, nuisances=None):
        starts.append(start[1]["bulk_modulus"])
        likelihood = -80.0 if len(starts) == 1 else from_null
        where = "far" if len(starts) == 1 else "null"
        return SimpleNamespace(log_likelihood=likelihood, evidence=likelihood - 3.0, where=where)

    monkeypatch.setattr(campaign, "fit_hypothesis", fit_hypothesis)
    problem = SimpleNamespace(
        effects={"bulk_modulus": SimpleNamespace(amplitudes=[SimpleNamespace(step=10.0)])}
    )
    nominal = SimpleNamespace(log_p_m=7.0, log_likelihood=-75.0)
    score = SimpleNamespace(name="bulk_modulus", amplitude=99.0)
    assert campaign._fit_from_score(problem, nominal, score).where == kept
    assert starts == [20.0, 0.0]
    starts.clear()
    nominal.log_likelihood = -85.0
    assert campaign._fit_from_score(problem, nominal, score).where == "far"
    assert starts == [20.0]


def test_a_cause_whose_runs_fail_is_said_not_to_be_judged():
    """Half the shear strength under a heavy projectile left a true cause without probability, and nobody was told."""
    tables = [
        ResponseTable(np.zeros(1), (0,), fingerprints={"pore_gas": {-2: {8000.0: np.zeros((1, 2))}}})
        for _ in range(2)
    ]
    for table, runs in zip(tables, ({-0.7: np.zeros((1, 2))}, {}), strict=True):
        table.fingerprints["shear_strength"] = {-2: runs}
    problem = SimpleNamespace(
        effects={
            name: SimpleNamespace(amplitudes=[None])
            for name in ("pore_gas", "shear_strength", "shear_strength@0.5", "pixel_scale")
        },
        affects_simulation=lambda name: name != "pixel_scale",
        features=[SimpleNamespace(table=table) for table in tables],
    )
    (said,) = campaign.warn_failed(problem)
    assert said.startswith("shear_strength: is not judged")
    tables[1].fingerprints["shear_strength"][-2] = {0.7: np.zeros((1, 2))}
    assert campaign.warn_failed(problem) == []


@pytest.mark.parametrize(
    ("fitted", "explored"),
    [([], True), ([("viscosity", 98.0)], False), ([("viscosity", 98.0), ("row", 104.0)], True)],
)
def test_a_promise_that_its_own_fit_has_refuted_asks_for_no_search(monkeypatch, fitted, explored):
    """In p01 the tangent of the viscosity promised 3.2 where its fit gained nothing; a thousand runs followed."""
    monkeypatch.setattr(explore, "fit_p_value", lambda fit: 0.5)
    scores = [SimpleNamespace(name="viscosity", log_bayes=3.2), SimpleNamespace(name="row", log_bayes=1.0)]
    problem = SimpleNamespace(effects={"row": SimpleNamespace(kind="material")})
    fits = [a_fit(name, evidence) for name, evidence in fitted]
    screening = SimpleNamespace(scores=scores)
    assert explore.needs_exploration(problem, a_fit("", 100.0), fits, screening, 90.0) is explored
