"""Drops that nobody has made: their predictions against runs and against another algebra, their evidence against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from labsim.campaign import read_campaign
from labsim.diagnosis import campaign as diagnosing
from labsim.diagnosis.campaign import suggest_next
from labsim.diagnosis.gain import HeldOut, measure_gain
from labsim.diagnosis.next_experiment import (
    MOST,
    Suggestion,
    expected_weight,
    suggest,
    suggest_between_formulas,
)
from labsim.diagnosis.planned_drops import HEAVIER, LARGER, plan_drops, predict_drops
from labsim.diagnosis.unlisted.hats import make_effect
from labsim.diagnosis.unlisted.learned_law import Formula, LearnedLaw
from labsim.effects import list_effects
from labsim.effects.terms import list_terms
from labsim.errors import ExtrapolationError
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.fits.tangents import linearise_at
from labsim.inference.observations.linearised_drop import ErrorBudget
from labsim.inference.observations.observe import observe_drops
from labsim.inference.open_problem import open_problem
from labsim.inference.problem import Problem
from labsim.runs.store import RunStore
from labsim.sph import simulate

CAMPAIGN = read_campaign(Path(__file__).parents[2] / "data" / "campaigns" / "p01")
EVEN = np.array([0.5, 0.5])
NOTHING = HeldOut((), *[np.ones(1)] * 4)
GAIN = measure_gain(NOTHING, NOTHING)


@pytest.fixture(scope="module")
def fitted(shared_store) -> tuple[Problem, Fit, Fit]:
    drops = tuple(drop for drop in CAMPAIGN.drops if drop.name in ("D01", "D02", "D03", "D05", "D06", "D07"))
    # a rod that is known exactly, and samples that scatter a little more: the friction is small, and at work
    rod = replace(drops[0].projectile, mass_sigma=0.0)
    campaign = replace(CAMPAIGN, drops=tuple(replace(drop, projectile=rod) for drop in drops), scans=())
    chosen = {name: list_effects(campaign)[name] for name in ("pixel_scale", "side_friction")}
    chosen["side_friction"] = replace(chosen["side_friction"], without="with a waisted rod")
    problem = open_problem(
        campaign,
        RunStore(shared_store),
        chosen,
        budget=ErrorBudget(scatter=0.025),
        workers=1,
        drops=observe_drops(campaign)[0],
        cells=4,
    )
    nominal = fit_hypothesis(problem, (), (math.log(1300.0), {}))
    begin = nominal.log_p_m, {"side_friction": 0.3}
    return problem, nominal, fit_hypothesis(problem, ("side_friction",), begin)


@pytest.fixture(scope="module")
def planned(fitted):
    problem, nominal, friction = fitted
    before = {name: len(table) for name, table in list_tables(problem)}
    extended, texts = plan_drops(problem, [nominal, friction], new=True)
    drops = list(zip(map(" ".join, texts), extended.tracks.models[6:], strict=True))
    predictions = [predict_drops(problem, extended, [fit])[0] for fit in (nominal, friction)]
    assert {name: len(table) for name, table in list_tables(problem)} == before
    assert len(problem.tracks.models) == 6 and len(problem.places) == 6 and len(problem.campaign.drops) == 6
    return extended, drops, predictions


def list_tables(problem: Problem):
    for number, each in enumerate(problem.features):
        yield f"base {number}", each.table.base
        yield f"changes {number}", each.table.changes.get("side_friction", {})


def test_every_planned_drop_goes_as_deep_as_a_run_of_it(fitted, planned) -> None:
    problem, nominal, _ = fitted
    extended, drops, (predictions, _) = planned
    (usual,) = problem.groups
    radii = [model.radius for _, model in drops]
    assert (
        len(drops) == 2 * (len(usual.speeds) - 1) + 2 and max(radii) == LARGER * usual.projectile.tip_radius
    )
    masses = [model.observed.drop.projectile.mass for _, model in drops]
    assert sorted({round(mass / usual.projectile.mass) for mass in masses}) == [1, HEAVIER, LARGER**3]
    for k in (0, len(drops) - 2, len(drops) - 1):
        text, model = drops[k]
        number = next(each.group for each in extended.features if each.table is model.table)
        speed = math.exp(model.start.log_speed)
        assert f"{speed:.2f} m/s" in text
        setting = extended.grid.setting(extended.groups[number], speed, math.exp(nominal.log_p_m))
        run = simulate(setting)
        # drops so far correct the simulation, within twice its errors of contact and of depth
        corrected = 0.03 * model.radius + 0.02 * run.penetration_depth
        assert predictions[k].depth == pytest.approx(run.penetration_depth, abs=corrected)
        assert predictions[k].stop == pytest.approx(run.stopping_time, rel=0.02)
        assert 0.002 < predictions[k].depth_sigma / predictions[k].depth < 0.05


def test_a_prediction_is_the_normal_distribution_given_today_s_data(fitted, planned) -> None:
    """Globals as one more normal error each, and the joint covariance inverted as a whole."""
    problem, _, friction = fitted
    extended, _, (_, predictions) = planned
    starts = [model.start for model in extended.tracks.models[6:]]
    nuisances = np.vstack([friction.nuisances[0], np.array(starts)])
    (linear,) = linearise_at(extended, (nuisances,), friction.log_p_m, friction.values)
    parameter = problem.effects["side_friction"].amplitudes[0]
    width, _ = parameter.stand_in(friction.values["side_friction"])
    widths = {"ln_p_m": 30.0, "side_friction": width}
    # how far the drops came back up says something of the globals too
    blocks = [linear, *friction.blocks[1:]]
    tangents = {name: np.concatenate([block.tangents[name] for block in blocks]) for name in widths}
    joint = block_diag(*(block.covariance for block in blocks)) + sum(
        each**2 * np.outer(tangents[name], tangents[name]) for name, each in widths.items()
    )
    model = extended.tracks.models[6]
    first, time = linear.sections[model.observed.name], model.observed.time
    dust = np.arange(len(joint))[first][time > 0.0]
    seen = np.arange(len(joint)) < first.start
    seen[first] = time < 0.0
    seen[linear.residual.size :] = True
    # the prior of the effect is about its null, not about the fit
    away = -friction.values["side_friction"]
    residual = np.concatenate([block.residual for block in blocks]) - tangents["side_friction"] * away
    # what is seen of the planned drop is its free fall, as planned; its data are nought
    fall = time * (math.exp(model.start.log_speed) + 0.5 * 9.81 * time)
    data = np.zeros(len(joint))
    data[first] = np.where(time < 0.0, fall, 0.0)
    weights = np.linalg.solve(joint[np.ix_(seen, seen)], joint[seen][:, dust]).T
    mean = weights @ (residual + data)[seen] - residual[dust]
    spread = joint[np.ix_(dust, dust)] - weights @ joint[seen][:, dust]
    scale = predictions[0].depth
    assert predictions[0].mean == pytest.approx(mean, abs=2e-4 * scale)
    assert np.sqrt(np.diag(predictions[0].spread)) == pytest.approx(np.sqrt(np.diag(spread)), rel=0.01)


def test_a_drop_without_the_cause_is_a_drop_of_the_nominal_model(fitted, planned) -> None:
    _, nominal, friction = fitted
    extended, drops, (of_nominal, of_friction) = planned
    speeds = len(drops) // 2 - 1
    for k in range(speeds):
        (_, usual), (text, without) = drops[k], drops[speeds + k]
        assert text.startswith("a drop with a waisted rod, with the 1 mm tip")
        assert without.start == usual.start and without.table.base is usual.table.base
        # it tells nothing new of the hypothesis that does not know the cause
        assert of_nominal[speeds + k].mean == pytest.approx(of_nominal[k].mean, rel=1e-9)
        plain = usual.table.features(friction.log_p_m, usual.start.log_speed, {})
        at_work = usual.table.features(friction.log_p_m, usual.start.log_speed, friction.values)
        deeper = math.exp(plain[0]) - math.exp(at_work[0])
        gone = of_friction[speeds + k].depth - of_friction[k].depth
        assert gone == pytest.approx(deeper, rel=0.1) and deeper > 1.5e-3 * math.exp(plain[0])
    assert friction.log_p_m < nominal.log_p_m and extended.tracks.models[-1].radius > 0.0


def test_suggestions_say_what_each_cause_predicts(fitted) -> None:
    problem, nominal, friction = fitted
    found = suggest(problem, [nominal, friction], {("none",): 0.4, ("side_friction",): 0.6})
    assert found and found[0].information_bits == max(each.information_bits for each in found)
    names, predictions = zip(*found[0].predictions, strict=True)
    assert names == ("side_friction", "none")
    assert all(0.0 < each.depth_sigma < 0.1 * each.depth for each in predictions)
    assert all(5e-4 < each.stop < 2e-2 for each in predictions)
    # of drops that differ in speed alone the best is told
    kinds = [each.change.split(" at ")[0] for each in found]
    assert (
        len(set(kinds)) == len(kinds) and "a drop with a waisted rod, with the 1 mm tip of 1.33 mg" in kinds
    )
    # where the first is certain no other projectile is asked for
    sure = suggest(problem, [nominal, friction], {("none",): 0.02, ("side_friction",): 0.98})
    assert not any("another projectile" in each.change for each in sure)
    assert suggest(problem, [nominal], {("none",): 1.0}) == []


def test_the_same_hypothesis_about_another_point_tells_nothing(fitted, planned) -> None:
    """A model that is linear has one prediction, wherever it is taken for a straight line."""
    problem, nominal, _ = fitted
    extended, _, (here, _) = planned
    (there,) = predict_drops(problem, extended, [replace(nominal, log_p_m=nominal.log_p_m + 0.02)])
    for one, other in zip(here, there, strict=True):
        assert expected_weight([one.mean, other.mean], [one.spread, other.spread], EVEN) < 0.2


@pytest.mark.parametrize("apart", [0.0, 2.0, 50.0])
def test_evidence_goes_on_growing_where_all_is_decided(apart: float) -> None:
    """Of two normal distributions alike: half of their squared distance."""
    means = [np.zeros(2), np.array([apart, 0.0])]
    found = expected_weight(means, [np.eye(2)] * 2, EVEN)
    assert found == pytest.approx(0.5 * apart**2 / math.log(2), abs=1e-12)


def test_evidence_of_two_spreads_is_their_divergence() -> None:
    wide, narrow = np.array([[4.0]]), np.array([[1.0]])
    # ∫ p ln(p/q), of N(0, 4) from N(0, 1) and the other way round
    from_narrow, from_wide = 0.5 * (4.0 - 1.0 - math.log(4.0)), 0.5 * (0.25 - 1.0 + math.log(4.0))
    found = expected_weight([np.zeros(1)] * 2, [wide, narrow], np.array([0.3, 0.7]))
    assert found == pytest.approx((0.3 * from_narrow + 0.7 * from_wide) / math.log(2))


def test_a_third_hypothesis_that_predicts_the_same_leaves_little_to_tell() -> None:
    means = [np.zeros(1), np.zeros(1), np.array([9.0])]
    found = expected_weight(means, [np.eye(1)] * 3, np.array([0.45, 0.45, 0.1]))
    # the twins cannot be told apart, the third can from both
    alike = -math.log(0.45 / 0.55 + 0.1 / 0.55 * math.exp(-40.5))
    assert found == pytest.approx((0.9 * alike + 0.1 * 40.5) / math.log(2))


@pytest.fixture(scope="module")
def learned(fitted) -> LearnedLaw:
    """Two drags, either 300 Pa at 0.65 m/s, as formulas that the data tell apart by 1 in ln evidence."""
    problem, nominal, _ = fitted
    terms = [list_terms()[name] for name in ("inertial_drag", "viscous_drag")]
    effects = {**problem.effects, **{term.name: make_effect(term, 500.0) for term in terms}}
    free = replace(problem, effects=effects, budget=ErrorBudget())  # samples that scatter by 2 %
    formulas = []
    for term, evidence, size in zip(terms, (-1.0, -2.0), (300.0 / 0.65**2, 300.0 / 0.65), strict=True):
        begin = nominal.log_p_m, {term.name: size}
        fit = fit_hypothesis(free, (term.name,), begin, nuisances=nominal, iterations=0)
        formulas.append(Formula((term,), replace(fit, evidence=evidence), NOTHING, GAIN))
    return LearnedLaw(tuple(formulas), free, GAIN)


def test_formulas_are_told_apart_by_the_drops_that_they_differ_in(learned) -> None:
    found = suggest_between_formulas(learned)
    assert 0 < len(found) <= MOST
    told = ", to tell a drag that grows with the square of the speed from a drag that grows with the speed"
    assert all(each.text.endswith(told) for each in found)
    (drop,) = [each for each in found if each.change.startswith("one more drop")]
    assert "at 1.22 m/s" in drop.change  # the fastest: they were made alike at 0.65 m/s
    (first, of_first), (second, of_second) = drop.predictions
    assert (first, second) == ("inertial_drag", "viscous_drag")
    assert of_first.depth < of_second.depth - of_first.depth_sigma and of_first.stop < of_second.stop
    assert {"depth_mm", "stopping_time_ms"} <= set(of_first.summarise())
    # three in four of the time one is right: other projectiles are asked for
    assert any("another projectile" in each.change for each in found)


def test_formulas_with_one_term_are_told_apart_by_the_causes_beside_it(learned) -> None:
    first, second = learned.formulas
    friction = replace(second, terms=first.terms, causes=(list_effects()["side_friction"],))
    found = suggest_between_formulas(replace(learned, formulas=(first, friction)))
    assert found[0].tells == (
        ("a drag that grows with the square of the speed",),
        (list_effects()["side_friction"].title, "a drag that grows with the square of the speed"),
    )


def test_a_formula_that_stands_alone_asks_for_nothing(learned) -> None:
    best, second = learned.formulas
    far = replace(second, fit=replace(second.fit, evidence=best.fit.evidence - 20.0))
    assert suggest_between_formulas(replace(learned, formulas=(best, far))) == []
    assert suggest_between_formulas(replace(learned, formulas=(best,))) == []


def test_causes_are_told_apart_where_formulas_cannot_be(fitted, learned, monkeypatch) -> None:
    problem, nominal, friction = fitted
    judged = SimpleNamespace(
        problem=problem,
        nominal=nominal,
        rivals=[friction],
        verdict=SimpleNamespace(
            probabilities=[(("unknown",), 0.9), (("none",), 0.05), (("side_friction",), 0.05)]
        ),
    )
    assert all(each.tells for each in suggest_next(judged, learned))
    of_causes = suggest_next(judged, None)
    assert of_causes and not any(each.tells for each in of_causes)
    alone = replace(learned, formulas=learned.formulas[:1])
    assert [each.text for each in suggest_next(judged, alone)] == [each.text for each in of_causes]

    def fail(learned):
        raise ExtrapolationError("p01", "runs", "do not come to rest")

    monkeypatch.setattr(diagnosing, "suggest_between_formulas", fail)
    assert [each.text for each in suggest_next(judged, learned)] == [each.text for each in of_causes]


def test_of_many_formulas_three_are_named() -> None:
    tells = tuple((name,) for name in ("v", "v²", "√v", "v³"))
    assert Suggestion("one more drop", 1.0, tells).text == "one more drop, to tell v from v² or √v or 1 more"
