"""Which forms of a law are tried, and when the search ends: with fits that cost nothing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.unlisted import learned_law
from labsim.diagnosis.unlisted.free_law import SIZES, Tangents, integrate
from labsim.diagnosis.unlisted.hats import FreeLaw
from labsim.diagnosis.unlisted.unknown import UnknownFit, log_mean
from labsim.effects.law_places import LAW_PLACES
from labsim.effects.terms import list_terms
from labsim.errors import ExtrapolationError

EVIDENCE = {"layer_at_1_mm": 100.0, "stuck_cap": 80.0, "stuck_mass": 600.0, "inertial_drag": -1e6}
NOMINAL = SimpleNamespace(hypothesis=(), evidence=0.0, log_p_m=7.0, values={})

PROBLEM = SimpleNamespace(
    effects=list_terms(),
    acts_on_projectile=lambda name: list_terms()[name].place.split()[0] in ("force", "mass"),
    affects_simulation=lambda name: True,
)


def make_fit(name: str, log_p_m: float = 6.0):
    return SimpleNamespace(
        hypothesis=(name,), evidence=EVIDENCE.get(name, 10.0), log_p_m=log_p_m, values={name: 0.2}
    )


@pytest.fixture
def search(monkeypatch):
    """What was asked for, in order; forms of mass fail where the wrong form led, stuck_mass alone explains the data."""
    asked: list[tuple[str, str]] = []

    def fit_there(problem, names, start, **how):
        asked.append((names[0], "there"))
        if list_terms()[names[0]].place == "mass of depth" and how.get("sparse"):
            raise ExtrapolationError("simulation", "runs", "never stop")
        return make_fit(names[0])

    def fit_anew(problem, nominal, names, top):
        asked.append((names[0], "anew"))
        return make_fit(names[0])

    monkeypatch.setattr(learned_law, "fit_hypothesis", fit_there)
    monkeypatch.setattr(learned_law, "fit_from_strengths", fit_anew)
    monkeypatch.setattr(learned_law, "list_large_effects", lambda problem, fit: [])
    monkeypatch.setattr(
        learned_law, "fit_p_value", lambda fit: 0.4 if fit.hypothesis == ("stuck_mass",) else 1e-9
    )
    units = {name: 1.0 for name, term in list_terms().items() if not term.acts.see}

    def run(*names: str, open_places: tuple[str, ...] = ()):
        fits = [make_fit(name) for name in names]
        found = learned_law.fit_siblings(PROBLEM, NOMINAL, fits, fits, units, open_places)
        return sorted(found, key=lambda fit: -fit.evidence), asked

    return run


def test_the_right_form_is_found_at_a_place_whose_first_form_is_far_behind(search) -> None:
    found, asked = search("layer_at_1_mm", "stuck_cap")
    assert found[0].hypothesis == ("stuck_mass",)
    assert ("stuck_mass", "there") in asked and ("stuck_mass", "anew") in asked
    # it explains the data: of the place that led before, which takes most runs, nothing more is simulated
    assert {list_terms()[name].place for name, _ in asked} == {"mass of depth"}


def test_while_nothing_explains_the_data_every_place_is_searched_once(search, monkeypatch) -> None:
    monkeypatch.setitem(EVIDENCE, "stuck_mass", 79.0)
    _, asked = search("layer_at_1_mm", "stuck_cap")
    places = [list_terms()[name].place for name, _ in asked]
    assert places == sorted(places) and set(places) == {"mass of depth", "strength of depth"}
    tried = {name for name, _ in asked}
    assert all(
        sum(list_terms()[name].place == place for name in tried) <= learned_law.MOST_TRIED for place in places
    )


def test_a_place_that_leads_nowhere_is_not_searched(search, monkeypatch) -> None:
    monkeypatch.setitem(EVIDENCE, "stuck_mass", 79.0)
    _, asked = search("layer_at_1_mm", "inertial_drag")
    assert "force of speed" not in {list_terms()[name].place for name, _ in asked}


def test_forms_of_an_open_place_are_tried_though_the_data_are_explained(search) -> None:
    """A place whose free law explains as much as the leading one's: the truth may be another form there."""
    found, asked = search("layer_at_1_mm", "stuck_mass", open_places=("strength of depth", "force of speed"))
    assert found[0].hypothesis == ("stuck_mass",)
    # of the open ones those that a formula was fitted at
    assert {list_terms()[name].place for name, _ in asked} == {"mass of depth", "strength of depth"}


def test_open_places_are_those_whose_free_law_explains_as_much() -> None:
    """Hats of three places in made-up data: two explain a bump alike, the third does not."""
    rng = np.random.default_rng(2)
    shapes = rng.normal(size=(60, 2))
    residual = 5.0 * shapes[:, 0] + rng.normal(size=60)
    columns = [residual, shapes[:, 1], 3.0 * shapes[:, 0], 3.1 * shapes[:, 0], rng.normal(size=60)]
    gram = np.stack(columns).dot(np.stack(columns).T)
    knots = {"force of depth": (1.0,), "strength of depth": (0.5,), "force of speed": (0.3,)}
    laws = tuple(FreeLaw(LAW_PLACES[name], at, at, (0.0, 2.0)) for name, at in knots.items())
    names = ("ln_p_m", *(law.hat(0) for law in laws))
    tangents = Tangents(laws, names, gram, 0.0, 60, np.zeros((60, 3)), 7.0)
    evidences = {
        law.name: log_mean([integrate(tangents, law.hats, size, (4.0, 9.0)).evidence for size in SIZES])
        for law in laws
    }
    unknown = UnknownFit(0.0, "", 0.0, np.zeros(1), evidences)
    assert set(learned_law.list_open_places(unknown)) == {"force of depth", "strength of depth"}


# ---------------------------------------------------------------- a term beside another part

TOGETHER = {  # ln evidence of what stands together
    ("surface_crust", "viscous_drag"): 900.0,
    ("surface_crust", "inertial_drag"): 940.0,
    ("surface_crust", "inertial_drag", "stuck_mass"): 950.0,
}
CRUST = SimpleNamespace(
    hypothesis=("surface_crust",), evidence=700.0, log_p_m=7.2, values={"surface_crust": 0.04}
)


@pytest.fixture
def beside(monkeypatch):
    """Hypotheses that were fitted, and on few runs or not; the set of those that explain the data."""
    asked: list[tuple[tuple[str, ...], bool]] = []
    explained: set[tuple[str, ...]] = set()

    def fit(problem, names, start, *, nuisances, sparse=False):
        asked.append((names, sparse))
        evidence = TOGETHER.get(names, EVIDENCE.get(names[0], 10.0) if len(names) == 1 else 650.0)
        values = {name: start[1].get(name, 0.0) or 0.2 for name in names}
        return SimpleNamespace(hypothesis=names, evidence=evidence, log_p_m=start[0], values=values)

    monkeypatch.setattr(learned_law, "fit_hypothesis", fit)
    monkeypatch.setattr(
        learned_law, "fit_from_strengths", lambda problem, nominal, names, top: make_fit(names[0])
    )
    monkeypatch.setattr(learned_law, "fit_anew", lambda *given: [])
    monkeypatch.setattr(learned_law, "_begin_anew", lambda *given: [])
    monkeypatch.setattr(learned_law, "list_large_effects", lambda problem, fit: [])
    monkeypatch.setattr(learned_law, "fit_p_value", lambda fit: 0.4 if fit.hypothesis in explained else 1e-9)
    return asked, explained


UNITS = {name: 1.0 for name, term in list_terms().items() if not term.acts.see}


def test_a_law_is_told_about_the_listed_cause_that_explains_more_than_any_formula(beside) -> None:
    asked, explained = beside
    explained.add(("surface_crust", "inertial_drag"))
    chosen = [("viscous_drag",), ("stuck_mass",), ("layer_at_1_mm",)]
    fits = learned_law.fit_formulas(PROBLEM, NOMINAL, chosen, UNITS, (), [CRUST])
    # the form of the drag is found among those of its place, though another one was chosen alone
    assert fits[0].hypothesis == ("surface_crust", "inertial_drag")
    # what was tried alone is what was chosen: no form of every place
    assert {names for names, _ in asked if len(names) == 1} <= set(chosen)
    assert (("surface_crust", "inertial_drag"), True) in asked


def test_what_takes_no_runs_is_searched_before_what_does(beside) -> None:
    """The right form of mass is not the one that is weighed first; once it explains the data, nothing dear has its own runs."""
    asked, explained = beside
    explained.add(("stuck_mass",))
    chosen = [("layer_at_1_mm",), ("hardening",), ("stuck_cap",), ("viscous_drag",)]
    fits = learned_law.fit_formulas(PROBLEM, NOMINAL, chosen, UNITS)
    assert fits[0].hypothesis == ("stuck_mass",)
    own = [names for names, sparse in asked if not sparse]
    assert ("stuck_mass",) in own
    assert all(PROBLEM.acts_on_projectile(name) for names in own for name in names)


def test_a_formula_has_three_parts_at_most(beside) -> None:
    base = SimpleNamespace(**{**vars(CRUST), "hypothesis": ("surface_crust", "inertial_drag"), "evidence": 940.0,
                              "values": {"surface_crust": 0.04, "inertial_drag": 300.0}})  # fmt: skip
    known = [make_fit("stuck_mass"), make_fit("viscous_drag")]
    [found] = learned_law.fit_further(PROBLEM, [base], known, UNITS)
    assert found.hypothesis == ("surface_crust", "inertial_drag", "stuck_mass")
    assert learned_law.fit_further(PROBLEM, [found], known, UNITS) == []


def test_a_part_that_is_not_clearly_ahead_is_left_out(beside) -> None:
    assert learned_law.fit_further(PROBLEM, [CRUST], [make_fit("layer_at_1_mm")], UNITS) == []
