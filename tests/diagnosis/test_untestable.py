"""What a campaign cannot test is said, with the p_m that it would imply: drops that obey a law in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from laws import LawStore, write_campaign

from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.diagnosis.shapes import lay_out_shapes
from labsim.diagnosis.untestable import find_combination, list_untestable
from labsim.effects.priors import Normal
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.problem import Problem


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> tuple[Problem, Fit]:
    campaign = read_campaign(write_campaign(tmp_path_factory.mktemp("untestable") / "made"))
    problem, fit = prepare(campaign, LawStore(tmp_path_factory.mktemp("store")), workers=1)
    screen(problem, fit, np.random.default_rng(1))  # asks for the runs of every effect
    return problem, fit


def test_what_takes_the_place_of_p_m_is_said_to(opened):
    """Strength goes as p_m f^0.3 φ^4 here, depth as √(mass / strength): no drop tells f, φ or mass from p_m."""
    problem, fit = opened
    found = {each.name: each for each in list_untestable(problem, fit)}
    assert set(found) == {"shear_strength", "filling_factor", "projectile_mass", "strength_rate"}
    shear = found["shear_strength"]
    step = 0.05 * math.log(0.75)  # a twentieth of the screening's, whose runs are made at f = 0.75
    assert shear.traded == pytest.approx(0.3 * step / math.expm1(step), rel=0.02)
    assert found["filling_factor"].traded == pytest.approx(4 / 0.15, rel=0.02)
    assert found["projectile_mass"].traded == pytest.approx(-1.0, rel=0.02)
    rate = found.pop("strength_rate")  # drops tell it from p_m, but less well than p_m alone is measured
    assert rate.trace == pytest.approx(2.0)
    assert all(each.trace < 1.0 for each in found.values())  # of 1 % by which a secant is no tangent
    scale = problem.effects["shear_strength"].amplitudes[0].scale
    assert shear.values == pytest.approx((1 - scale, 1 + scale))  # its prior ends before it could be seen
    assert shear.width == pytest.approx(2 * shear.traded * scale, rel=1e-6)
    assert shear.p_m[0] < math.exp(fit.log_p_m) < shear.p_m[1]


def test_what_is_measured_all_the_same(opened):
    problem, fit = opened
    untestable = list_untestable(problem, fit)
    first = next(each for each in untestable if each.name == "shear_strength")
    held = find_combination(problem, fit, [first])
    assert held is not None
    assert held.expression == f"p_m * shear_strength.factor^{first.traded:.2f}"
    assert held.value == pytest.approx(math.exp(fit.log_p_m))
    assert find_combination(problem, fit, []) is None


def test_what_would_be_seen_at_its_prior_is_taken_as_far_as_it_is_not(opened):
    """With a prior a hundred times as wide every listed cause leaves two standard deviations, and no more."""
    problem, fit = opened
    before = {each.name: each for each in list_untestable(problem, fit)}
    wide = replace(problem, effects=dict(problem.effects))
    effect = problem.effects["filling_factor"]
    broad = replace(
        effect.parameters[0], prior=Normal(effect.parameters[0].null, 100 * effect.parameters[0].scale)
    )
    wide.effects["filling_factor"] = replace(effect, parameters=(broad, *effect.parameters[1:]))
    found = {each.name: each for each in list_untestable(wide, fit)}["filling_factor"]
    assert found.traded == pytest.approx(before["filling_factor"].traded)
    assert found.trace == pytest.approx(2.0)
    assert found.values[1] > before["filling_factor"].values[1]


def test_about_a_cause_that_is_fitted_it_follows_too(opened):
    """The fitted cause itself is not listed; p_m and its amplitude together leave of the others no more than p_m alone. What
    moves p_m inside its interval, which is wider now, is not listed either."""
    problem, fit = opened
    rate = fit_hypothesis(problem, ("strength_rate",), (fit.log_p_m, {"strength_rate": 0.0}), nuisances=fit)
    found = {each.name: each for each in list_untestable(problem, rate)}
    assert "strength_rate" not in found
    before = {each.name: each for each in list_untestable(problem, fit)}
    assert set(found) == {"shear_strength", "filling_factor"} < set(before)
    assert found["shear_strength"].trace < 1.1 * before["shear_strength"].trace


def test_a_variant_of_a_shape_is_no_cause_of_its_own(tmp_path):
    campaign = read_campaign(write_campaign(tmp_path / "made"))
    problem, fit = prepare(campaign, LawStore(tmp_path / "store"), workers=1)
    lay_out_shapes(problem)
    screen(problem, fit, np.random.default_rng(1))
    assert any(name.startswith("strength_rate@") for name in problem.effects)
    names = [each.name for each in list_untestable(problem, fit)]
    assert "strength_rate" in names and not any("@" in name for name in names)
