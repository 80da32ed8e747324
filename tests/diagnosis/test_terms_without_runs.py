"""Terms that cost no runs stand beside the laws without a name: what they explain is no scatter of the samples."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.truths.measured import Hidden, TruthTable, measure_hidden
from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import judge_scatters
from labsim.diagnosis.unlisted import hats
from labsim.diagnosis.unlisted.hats import fit_without_runs
from labsim.effects import list_effects
from labsim.effects.terms import list_terms
from labsim.errors import ExtrapolationError
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.inference.open_problem import open_problem
from labsim.runs.store import RunStore

CAMPAIGN = read_campaign(Path(__file__).parents[2] / "data" / "campaigns" / "p01")
DROPS = ("D02", "D03", "D05", "D06", "D11", "D13", "D14")  # of two radii
EFFECT = '''"""Hidden here alone."""

from labsim.effects import Parameter, Uniform
from labsim.effects.terms import list_terms, {verb}_term

title = "hidden"
kind = "{kind}"
parameters = (Parameter("size", "1", null=0.0, limits=(-9, 9), prior=Uniform(-9, 9), step=0.5, text="Of a term."),)
leaves = "What no listed cause leaves."
references = ("None",)
expect = {{}}


def change_{of}({of}, values, place):
    return {verb}_term({of}, list_terms()["{term}"], values["size"]{more})
'''


@pytest.mark.parametrize(
    ("term", "size", "words"),
    [
        ("size_power", 0.5, ("add", "material", "setting")),
        ("rolling_shutter", 4.0, ("see", "measurement", "instrument")),
    ],
)
def test_a_hidden_one_is_unknown_and_has_its_size(term, size, words, shared_store, tmp_path) -> None:
    verb, kind, of = words
    more = ", place" if verb == "see" else ""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "hidden.py").write_text(
        EFFECT.format(verb=verb, kind=kind, of=of, term=term, more=more)
    )
    drops = tuple(drop for drop in CAMPAIGN.drops if drop.name in DROPS)
    campaign, store = replace(CAMPAIGN, drops=drops, scans=()), RunStore(shared_store)
    truth = TruthTable(replace(campaign, folder=tmp_path), store, workers=1)
    hidden = Hidden({"hidden": {"size": size}})
    truth.prepare([hidden])
    seen = measure_hidden(truth, hidden, np.random.default_rng(3), scans=0)
    effects = {
        name: effect for name, effect in list_effects().items() if name in ("contact_friction", "surface_row")
    }

    def open_with(budget):
        problem = open_problem(campaign, store, effects, budget=budget, workers=1, drops=seen.drops)
        return problem, fit_hypothesis(problem, (), (math.log(1300.0), {}))

    found = judge_scatters(campaign, open_with)
    assert found.verdict.word == "unknown" and found.verdict.probabilities[0][1] > 0.9
    assert found.unknown.block == list_terms()[term].title
    fit = fit_without_runs(found.problem, found.nominal)[term]
    assert abs(fit.values[term] - size) < 3 * math.sqrt(fit.covariance[1, 1]) < 0.3 * size
    assert term not in found.problem.effects


def test_a_term_whose_fit_leaves_the_runs_is_left_out(monkeypatch):
    """The others are compared all the same."""

    def fit(problem, names, start, **how):
        if names == ("clock_drift",):
            raise ExtrapolationError("simulation", "runs", "extrapolate")
        return names

    terms = {name: list_terms()[name] for name in ("clock_drift", "rolling_shutter")}
    monkeypatch.setattr(hats, "add_terms", lambda problem: (problem, terms, {}))
    monkeypatch.setattr(hats, "fit_hypothesis", fit)
    assert list(fit_without_runs(None, SimpleNamespace(log_p_m=7.0))) == ["rolling_shutter"]
