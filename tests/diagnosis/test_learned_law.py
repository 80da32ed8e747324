"""A formula is chosen among terms: on tangents of a made-up campaign where the answer is known."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.unlisted.free_law import Tangents, gather
from labsim.diagnosis.unlisted.hats import STEP, USUAL, FreeLaw, find_peak, list_laws, make_effect
from labsim.diagnosis.unlisted.learned_law import (
    MOST_WEIGHED,
    choose_formulas,
    share_hats,
    share_places,
    weigh_formulas,
)
from labsim.effects.law_places import LAW_PLACES
from labsim.effects.terms import add_term, list_terms
from labsim.inference.fits.blocks import Block
from labsim.inference.observations.tracks import Tracks
from labsim.records import Material, Projectile
from labsim.sph import DropSetting

DEPTH, SPEED = LAW_PLACES["force of depth"], LAW_PLACES["force of speed"]
SPEEDS = SPEED.knots[1:]
LAWS = (FreeLaw(DEPTH, DEPTH.knots, DEPTH.knots, (0.0, 4.0)), FreeLaw(SPEED, SPEED.knots, SPEEDS, (0.0, 1.2)))
HATS = [hat for law in LAWS for hat in law.hats]
TERMS = {name: term for name, term in list_terms().items() if term.place in {law.name for law in LAWS}}
PEAKS = {
    name: find_peak(term, next(law for law in LAWS if law.name == term.place)) for name, term in TERMS.items()
}
UNITS = {name: TERMS[name].acts.scale / peak for name, peak in PEAKS.items()}
LIMITS = (-50.0, 50.0)


def made_up(hidden: dict[str, float], seed: int = 2) -> Tangents:
    """300 data with errors of 1; each hat leaves a trace of its own of 8 per unit. hidden : term -> units where it is largest."""
    rng = np.random.default_rng(seed)
    tangents = {name: 8.0 * rng.standard_normal(300) for name in ("ln_p_m", *HATS)}
    residual = rng.standard_normal(300)
    for name, size in hidden.items():
        term = TERMS[name]
        law = next(law for law in LAWS if law.name == term.place)
        for hat, share in zip(law.hats, share_hats(term, law) / PEAKS[name], strict=True):
            residual += size * share * tangents[hat]
    block = Block(residual, np.eye(300), tangents)
    gram, log_determinant, points = gather([block], HATS, dict.fromkeys(HATS, 1.0))
    return Tangents(LAWS, ("ln_p_m", *HATS), gram, log_determinant, points, np.zeros((0, len(HATS))), 0.0)


@pytest.mark.parametrize("name", ["inertial_drag", "root_drag", "depth_spring", "film_at_1", "surface_layer"])
def test_the_hidden_term_comes_first_with_its_size(name):
    ranked = weigh_formulas(made_up({name: 0.5}), TERMS, UNITS, LIMITS)
    names, marginal = ranked[0]
    assert names == (name,)
    sigma = np.sqrt(marginal.covariance[1, 1])
    assert abs(marginal.coefficients[1] - 0.5) < 3 * sigma and sigma < 0.05


@pytest.mark.parametrize("name", ["depth_spring", "inertial_drag"])
def test_a_term_many_times_its_usual_size_is_found(name):
    names, marginal = weigh_formulas(made_up({name: 6.0}), TERMS, UNITS, LIMITS)[0]
    assert names == (name,) and marginal.coefficients[1] == pytest.approx(6.0, rel=0.05)


def test_places_are_as_likely_as_one_another_however_many_terms_they_have():
    priors = share_places(TERMS)
    for law in LAWS:
        own = [math.exp(priors[name]) for name, term in TERMS.items() if term.place == law.name]
        assert sum(own) == pytest.approx(1.0) and len(set(own)) == 1


def test_two_hidden_terms_are_named_together():
    ranked = weigh_formulas(made_up({"inertial_drag": 0.5, "film_at_2": -0.4}), TERMS, UNITS, LIMITS)
    assert set(ranked[0][0]) == {"inertial_drag", "film_at_2"}


def test_a_force_along_the_motion_is_never_proposed():
    """It would gain energy on a closed way; of depth either sign is a force that nature has."""
    for names, marginal in weigh_formulas(made_up({"inertial_drag": -0.5}), TERMS, UNITS, LIMITS):
        for name, c in zip(names, marginal.coefficients[1:], strict=True):
            assert c >= 0 or TERMS[name].place == "force of depth"
    names, marginal = weigh_formulas(made_up({"depth_spring": -0.5}), TERMS, UNITS, LIMITS)[0]
    assert names == ("depth_spring",) and marginal.coefficients[1] < 0


def test_every_place_has_its_best_term_simulated():
    """However far behind it stands: what is weighed is linear about a p_m that may be far off."""
    ranked = weigh_formulas(made_up({"inertial_drag": 0.5, "viscous_drag": 0.2}), TERMS, UNITS, LIMITS)
    chosen = choose_formulas(ranked, TERMS)
    assert chosen[:MOST_WEIGHED] == ranked[:MOST_WEIGHED]
    assert {TERMS[names[0]].place for names, _ in chosen if len(names) == 1} == {law.name for law in LAWS}
    assert len({names for names, _ in chosen}) == len(chosen) <= MOST_WEIGHED + len(LAWS)


def test_where_nothing_is_hidden_no_pair_stands_out():
    """A second term has to promise 3 in ln evidence over the better of the two."""
    pairs = 0
    for seed in range(4):
        ranked = weigh_formulas(made_up({}, seed), TERMS, UNITS, LIMITS)
        pairs += len(ranked[0][0]) - 1
    assert pairs <= 1


def test_a_term_is_measured_where_the_data_are():
    """Its unit is that at the fastest drop, not at a knot beyond; a film between two knots is as high as any other."""
    slow = FreeLaw(SPEED, SPEED.knots, SPEEDS, (0.0, 0.7))
    assert find_peak(TERMS["inertial_drag"], slow) == pytest.approx(0.49)
    for name in ("film_at_1_5", "film_at_3"):
        assert PEAKS[name] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", sorted(TERMS))
def test_hats_come_as_near_to_a_term_as_they_can(name):
    """What they leave is at right angles to every hat; its values at the knots leave more, or are the same."""
    term = TERMS[name]
    law = next(law for law in LAWS if law.name == term.place)
    places = np.linspace(0.0, law.knots[-1], 97)
    hats = np.stack([np.interp(places, law.grid, np.equal(law.grid, knot)) for knot in law.knots], axis=1)
    left = term.shape(places) - hats @ share_hats(term, law)
    assert np.abs(hats.T @ left).max() < 1e-9 * (1 + np.abs(term.shape(places)).sum())
    at_knots = term.shape(places) - hats @ term.shape(np.array(law.knots))
    assert left @ left <= at_knots @ at_knots + 1e-9


def test_a_term_as_an_effect_is_the_term():
    term = TERMS["inertial_drag"]
    effect = make_effect(term, 250.0)
    setting = DropSetting(Projectile("hemisphere", 5e-4, 1.33e-6), 0.6, Material())
    assert effect.apply(setting, {"coefficient": 0.0}, None) == setting
    assert effect.apply(setting, {"coefficient": 120.0}, None) == add_term(setting, term, 120.0)
    parameter = effect.amplitudes[0]
    assert parameter.limits[0] == 0.0 and parameter.step == STEP * 250.0
    assert parameter.prior.sd == USUAL * 250.0


@pytest.mark.parametrize("longest", [3.0, 8.0, 40.0])
def test_limits_of_a_strength_lie_on_its_scale_however_long_a_drop_takes(longest):
    """A factor has a logarithm down to its limit: drops of 40 ms, longer than such a law goes on changing, once left none."""
    drop = SimpleNamespace(deepest=longest / 2e3, radius=5e-4)  # of 1 m/s, slowed evenly
    tracks = object.__new__(Tracks)
    object.__setattr__(tracks, "models", (drop,))
    problem = SimpleNamespace(
        observations=(tracks,),
        groups=[SimpleNamespace(projectile=SimpleNamespace(tip_radius=5e-4))],
        campaign=SimpleNamespace(
            sample=SimpleNamespace(filling_factor=0.15), material=SimpleNamespace(phi_2=0.58)
        ),
    )
    place = LAW_PLACES["strength of time"]
    laws = list_laws(problem, SimpleNamespace(nuisances=(np.zeros((1, 4)),)))
    [law] = [law for law in laws if law.place is place]
    assert law.reach[1] == pytest.approx(min(longest, place.reach))
    for term in list_terms().values():
        if term.place == place.name:
            unit = place.scale / find_peak(term, law)
            low, _ = term.limits
            assert math.isfinite(make_effect(term, unit).amplitudes[0].grade(low))
