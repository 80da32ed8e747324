"""A law that stands free in the equations: its integral, its null, and a hidden force that it has to find."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.truths.measured import Hidden, TruthTable, measure_hidden
from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import judge_campaign
from labsim.diagnosis.gain import predict_held_out
from labsim.diagnosis.unlisted import free_law
from labsim.diagnosis.unlisted.free_law import EMBEDDED, Tangents, average, gather, integrate
from labsim.diagnosis.unlisted.hats import FreeLaw, make_hats
from labsim.diagnosis.unlisted.learned_law import learn_law, list_open_places
from labsim.diagnosis.unlisted.unknown import FREEDOMS, WOBBLE
from labsim.effects import Place, list_effects
from labsim.effects.law_places import LAW_PLACES, combine
from labsim.effects.terms import list_terms
from labsim.inference.emulation.nodes import hold_known
from labsim.inference.fits.blocks import Block, solve_globals
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.inference.open_problem import open_problem
from labsim.runs.store import RunStore
from labsim.sph import DropSetting
from labsim.sph.sirono import tabulate_strengths

CAMPAIGN = read_campaign(Path(__file__).parents[2] / "data" / "campaigns" / "p01")
RADIUS = 0.5e-3  # m
DUST = (0.15, 0.18, 0.22, 0.28)
STRENGTH, DEPTH, SPEED = (
    LAW_PLACES[name] for name in ("strength of filling factor", "force of depth", "force of speed")
)
DEPTHS, (_, *SPEEDS) = DEPTH.knots, SPEED.knots
PRESSURE = DEPTH.scale
LAWS = (
    FreeLaw(STRENGTH, DUST, DUST, (0.15, 0.28)),
    FreeLaw(DEPTH, DEPTHS, DEPTHS, (0.0, 4.0)),
    FreeLaw(SPEED, SPEED.knots, SPEED.knots[1:], (0.0, 1.2)),
)

# ---------------------------------------------------------------- the integral


def a_block(rng: np.random.Generator, n: int, names: list[str]) -> Block:
    root = rng.normal(size=(n, n))
    covariance = root @ root.T / n + 0.3 * np.eye(n)
    return Block(3 * rng.normal(size=n), covariance, {name: rng.normal(size=n) for name in names})


@pytest.mark.parametrize("size", [0.03, 0.5])
def test_the_integral_is_that_of_the_covariance(size: float) -> None:
    """Drops and two maps that share coefficients: one Gaussian of all data with C + size² T Tᵀ says the same."""
    rng = np.random.default_rng(4)
    hats = ["a", "b", "c"]
    scales = {"a": 1.0, "b": 400.0, "c": 0.2}
    blocks = [a_block(rng, n, ["ln_p_m", *hats]) for n in (40, 25, 12)]
    gram, log_determinant, points = gather(blocks, hats, scales)
    found = integrate(
        Tangents((), ("ln_p_m", *hats), gram, log_determinant, points, np.zeros((0, 3)), 0.0), hats, size
    )
    whole = np.zeros((77, 77))
    at = 0
    for block in blocks:
        n = block.residual.size
        whole[at : at + n, at : at + n] = block.covariance
        at += n
    tangents = {
        name: np.concatenate([block.tangents[name] for block in blocks]) for name in ("ln_p_m", *hats)
    }
    free = np.stack([tangents[name] * scales[name] for name in hats], axis=1)
    joint = Block(np.concatenate([b.residual for b in blocks]), whole + size**2 * free @ free.T, tangents)
    step, covariance, chi, logdet, weighted = solve_globals([joint], ["ln_p_m"], {})
    evidence = -0.5 * (chi + logdet + points * math.log(2 * math.pi))
    evidence += 0.5 * math.log(2 * math.pi) + 0.5 * math.log(covariance[0, 0]) - math.log(2e3)
    assert found.evidence == pytest.approx(evidence, rel=1e-10, abs=1e-8)
    assert found.coefficients[0] == pytest.approx(step[0], rel=1e-8)
    assert found.covariance[0, 0] == pytest.approx(covariance[0, 0], rel=1e-8)
    assert found.coefficients[1:] == pytest.approx(size**2 * free.T @ weighted[0], rel=1e-8)


def test_a_law_on_top_of_a_cause_is_weighed_in_what_that_cannot_explain() -> None:
    """ln p_m and the cause are flat: what they can explain is taken out of data and hats by an orthogonal matrix."""
    rng = np.random.default_rng(8)
    names = ["cause", "a", "b"]
    block = a_block(rng, 40, ["ln_p_m", *names])
    gram, log_determinant, points = gather([block], names, dict.fromkeys(names, 1.0))
    found = Tangents((), ("ln_p_m", *names), gram, log_determinant, points, np.zeros((0, 3)), 0.0)
    with_it, without = (integrate(found, hats, 0.5, flat=["cause"]) for hats in (["a", "b"], []))
    white = block.whiten(np.stack([block.residual, *(block.tangents[n] for n in ("ln_p_m", *names))], axis=1))
    left = np.linalg.qr(white[:, 1:3], mode="complete")[0][:, 2:].T @ white[:, [0, 3, 4]]
    residual, hats = left[:, 0], left[:, 1:]
    covariance = np.eye(38) + 0.25 * hats @ hats.T
    gained = 0.5 * residual @ residual - 0.5 * residual @ np.linalg.solve(covariance, residual)
    gained -= 0.5 * np.linalg.slogdet(covariance)[1]
    assert with_it.evidence - without.evidence == pytest.approx(gained, rel=1e-9)
    assert len(with_it.coefficients) == 4 and len(without.coefficients) == 2


def test_all_laws_are_weighed_on_top_of_a_cause_that_the_data_speak_of(monkeypatch) -> None:
    law = LAWS[0]
    names = ["ln_p_m", "cause", *law.hats]
    block = a_block(np.random.default_rng(3), 40, names)
    blocks = [block]
    monkeypatch.setattr(free_law, "linearise_at", lambda *place: blocks)
    problem = SimpleNamespace(
        campaign=SimpleNamespace(p_m_range=(500.0, 3000.0)), require_base_about=lambda log_p_m: None
    )
    fit = SimpleNamespace(hypothesis=("cause",), values={"cause": 0.1}, log_p_m=7.0, nuisances=())
    simulated = free_law.Hats(problem, (law,), 0)
    gram, *rest = gather(blocks, names[1:], simulated.scales | {"cause": 1.0})
    found = Tangents((law,), tuple(names), gram, *rest, np.zeros((0, 1)), 7.0)
    limits = (math.log(500.0), math.log(3000.0))
    each = [integrate(found, law.hats, size, limits, ["cause"]).evidence for size in free_law.SIZES]
    alone = integrate(found, [], 1.0, limits, ["cause"]).evidence
    mean = math.log(np.mean(np.exp(np.array(each) - alone)))
    assert free_law.weigh_beside(simulated, fit) == pytest.approx(mean, abs=1e-9)
    blocks = [replace(block, tangents={**block.tangents, "cause": np.zeros(40)})]
    assert free_law.weigh_beside(simulated, fit) == -math.inf


@pytest.mark.parametrize("limits", [(6.8, 7.1), (8.0, 9.0)])
def test_the_integral_ends_at_the_limits_of_p_m(limits: tuple[float, float]) -> None:
    """Evidence and means, by sums over ln p_m of what the coefficients give there."""
    rng = np.random.default_rng(11)
    blocks = [a_block(rng, 30, ["ln_p_m", "a", "b"])]
    gram, log_determinant, points = gather(blocks, ["a", "b"], {"a": 1.0, "b": 1.0})
    tangents = Tangents(
        (), ("ln_p_m", "a", "b"), gram, log_determinant, points, np.zeros((0, 2)), log_p_m=7.0
    )
    cut, whole = integrate(tangents, ["a", "b"], 0.5, limits), integrate(tangents, ["a", "b"], 0.5)
    log_p_m = np.linspace(*limits, 4001) - 7.0
    sigma = math.sqrt(whole.covariance[0, 0])
    density = np.exp(-0.5 * ((log_p_m - whole.coefficients[0]) / sigma) ** 2) / sigma / math.sqrt(2 * math.pi)
    share = np.trapezoid(density, log_p_m)
    flat = math.log(2e3) - math.log(limits[1] - limits[0])
    assert cut.evidence == pytest.approx(whole.evidence + flat + math.log(share), abs=1e-5)
    mean = np.trapezoid(density * log_p_m, log_p_m) / share
    assert cut.coefficients[0] == pytest.approx(mean, rel=1e-5)
    slope = whole.covariance[1:, 0] / whole.covariance[0, 0]
    assert cut.coefficients[1:] == pytest.approx(
        whole.coefficients[1:] + slope * (mean - whole.coefficients[0]), rel=1e-5
    )
    variance = np.trapezoid(density * (log_p_m - mean) ** 2, log_p_m) / share
    spread = whole.covariance[1:, 1:] - np.outer(slope, slope) * (whole.covariance[0, 0] - variance)
    assert cut.covariance[1:, 1:] == pytest.approx(spread, rel=1e-4)


def test_a_law_over_sizes_is_as_wide_as_they_differ() -> None:
    rng = np.random.default_rng(5)
    law = replace(LAWS[0], knots=DUST[:1])
    name = law.hats[0]
    gram, log_determinant, points = gather([a_block(rng, 30, ["ln_p_m", name])], [name], {name: 1.0})
    found = Tangents((law,), ("ln_p_m", name), gram, log_determinant, points, np.zeros((0, 1)), 0.0)
    each = [integrate(found, [name], size) for size in (0.01, 1.0)]
    (one,), mean = average([law], each)
    share = 1 / (1 + math.exp(each[0].evidence - each[1].evidence))
    values = [one.coefficients[1] for one in each]
    assert mean[1] == pytest.approx((1 - share) * values[0] + share * values[1])
    variance = share * (1 - share) * (values[1] - values[0]) ** 2
    variance += (1 - share) * each[0].covariance[1, 1] + share * each[1].covariance[1, 1]
    assert one.sigma[0] == pytest.approx(math.sqrt(variance))
    assert one.at(np.array([0.15, 0.165, 0.18]))[0] == pytest.approx(mean[1] * np.array([1.0, 0.5, 0.0]))


# ---------------------------------------------------------------- the hats


def a_setting(speed: float = 1.0) -> DropSetting:
    return DropSetting(CAMPAIGN.drops[0].projectile, speed, CAMPAIGN.material)


def a_place() -> Place:
    return Place("D01", 0.0, False, CAMPAIGN.sample, CAMPAIGN.material)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.over)
def test_hats_change_nothing_at_null_and_add_up(law: FreeLaw) -> None:
    setting = a_setting()
    together = setting
    for hat in make_hats(law).values():
        assert hat.apply(setting, {}, a_place()) is setting
        together = hat.apply(together, {"amplitude": 0.1 * law.scale}, a_place())
    area = math.pi * setting.projectile.tip_radius**2
    if law.over == "filling factor":  # all hats together: another p_m
        own = tabulate_strengths(setting.material, together.strength_shape)[0]
        harder = setting.material.replace(p_m=1.1 * setting.material.p_m)
        assert own == pytest.approx(tabulate_strengths(harder)[0], rel=1e-12)
    elif law.over == "depth":  # a pressure everywhere
        table = dict(together.force_of_depth)
        assert list(table) == pytest.approx([knot * RADIUS for knot in DEPTHS])
        assert list(table.values()) == pytest.approx([0.1 * PRESSURE * area] * len(DEPTHS))
    else:  # none at rest
        table = dict(together.force_of_speed)
        assert list(table) == [0.0, *SPEEDS]
        assert list(table.values()) == pytest.approx([0.0] + [0.1 * PRESSURE * area] * len(SPEEDS))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.over)
def test_no_step_asks_for_what_no_run_says(law: FreeLaw) -> None:
    """About a p_m that has run away linear steps of mass that sticks (p12) asked for 34 times the unit of a force."""
    for hat in make_hats(law).values():
        step = hat.amplitudes[0].step
        for asked in (1e9, -1e9, 0.5 * step):
            held = hold_known(hat, asked, sparse=True)
            hat.apply(a_setting(), {"amplitude": held}, a_place())
            assert abs(held) <= 8.0 * step and (held == asked or abs(asked) > step)


def test_a_force_that_a_drop_does_not_meet_costs_no_run() -> None:
    slow = a_setting(0.25)
    deepest = {slow: 0.9 * RADIUS}
    left = []
    for law in LAWS:
        hats = make_hats(law, deepest)
        left += [name for name, hat in hats.items() if hat.apply(slow, {"amplitude": 0.1}, a_place()) is slow]
    assert left == [
        "force of depth at 2",
        "force of depth at 4",
        "force of speed at 0.6",
        "force of speed at 1.2",
    ]


def test_laws_that_are_there_already_are_kept() -> None:
    before, more = ((0.0, 1.0), (1.0, 3.0)), ((0.5, 1.0), (2.0, 2.0))
    assert combine(before, more) == ((0.0, 2.0), (0.5, 3.0), (1.0, pytest.approx(3 + 4 / 3)), (2.0, 5.0))
    assert combine((), more) == more
    assert combine(before, more, product=True)[1] == (0.5, 2.0)


# ---------------------------------------------------------------- a hidden force

BEGIN, MIDDLE, END = (
    0.5,
    1.0,
    2.0,
)  # tip radii: of a film that pushes back, which no effect of the catalogue does
FORCE = 1.6e-4  # N, in its middle
FILM = f'''"""A film in the dust pushes the projectile back while its tip is within it."""

from labsim.effects import Parameter, Uniform

title = "A film"
kind = "sample"
parameters = (
    Parameter("force", "N", null=0.0, limits=(0, 0.01), prior=Uniform(0, 0.01), step=1e-4, text="In its middle."),
)
leaves = "Drops that end in it are too shallow."
references = ("None",)
expect = {{"penetration_depth": -1}}


def change_setting(setting, values, place):
    a = setting.projectile.tip_radius
    if values["force"] == 0.0:
        return setting
    table = ((0.0, 0.0), ({BEGIN} * a, 0.0), ({MIDDLE} * a, values["force"]), ({END} * a, 0.0))
    return setting.replace(force_of_depth=table)
'''
LISTED = ("shear_strength", "strength_rate", "pixel_scale", "surface_row")


def test_a_hidden_film_is_unknown_and_seen_at_its_depth(shared_store, tmp_path) -> None:
    """Truth at another spacing than the fit's, where only the truth's folder lists the film."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "film.py").write_text(FILM)
    drops = tuple(drop for drop in CAMPAIGN.drops if drop.name in ("D01", "D02", "D03", "D05", "D06", "D07"))
    campaign, store = replace(CAMPAIGN, drops=drops, scans=()), RunStore(shared_store)
    truth = TruthTable(replace(campaign, folder=tmp_path), store, workers=1)
    hidden = Hidden({"film": {"force": FORCE}})
    truth.prepare([hidden])
    seen = measure_hidden(truth, hidden, np.random.default_rng(3), scans=0)
    effects = {name: effect for name, effect in list_effects().items() if name in LISTED}
    problem = open_problem(campaign, store, effects, workers=1, drops=seen.drops)
    found = judge_campaign(problem, fit_hypothesis(problem, (), (math.log(1300.0), {})))
    assert found.verdict.word == "unknown" and found.verdict.probabilities[0][1] > 0.5
    unknown = found.unknown
    without_runs = {term.title for term in list_terms().values() if term.acts.see}
    # of one rod a force that goes with its size is as good as a pressure
    untold = {name for name, place in LAW_PLACES.items() if place.value_unit in ("mN", "N/m")}
    assert set(unknown.evidences) - without_runs == {*FREEDOMS, *EMBEDDED, WOBBLE} - untold - {
        name for name in FREEDOMS if "undisturbed dust" in FREEDOMS[name].kinds
    }
    forces = {"force of depth", "force of depth in mm"}
    # six drops of one rod do not tell a film that pushes from a layer that is stronger (docs/learned-law.md)
    assert unknown.tangents is not None and forces & set(list_open_places(unknown))
    (free,) = (law for law in unknown.tangents.laws if law.name == "force of depth")
    each = [integrate(unknown.tangents, free.hats, size) for size in free_law.SIZES]
    (law,), _ = average([free], each)
    place, in_mm = np.linspace(0.0, 2.0, 201), 1e3 * campaign.drops[0].projectile.tip_radius
    mean, sigma = law.at(place)
    assert place[np.argmax(mean)] == pytest.approx(MIDDLE, abs=0.25)
    # its size is not asserted: the prior shrinks a lone hat, and p_m takes what is common to all depths (docs/free-law.md)
    peak = int(np.argmax(mean))
    assert mean[peak] > 1.5 * sigma[peak]
    assert not any(name in found.problem.effects for law in LAWS for name in law.hats)
    # what is learned in its place: a force of depth with its peak in the film, by which held-out drops are predicted
    learned = learn_law(problem, found.nominal, unknown, predict_held_out(problem, found.nominal))
    assert learned is not None
    best = learned.best
    assert {term.place for term in best.terms} <= forces | {"strength of depth"}
    film = next(each for each in learned.formulas if {term.place for term in each.terms} <= forces)
    drawn = sum(
        c * term.shape(place * (in_mm if term.acts.unit == "mm" else 1.0))
        for term, c in zip(film.terms, film.coefficients, strict=True)
    )
    assert BEGIN < place[np.argmax(drawn)] < END
    assert best.fit.evidence > found.nominal.evidence + 10.0
    assert best.gain.log_score_difference > 0.0  # of held-out drops, of which six by one rod show little
    assert sorted(learned.missed) == sorted(drop.name for drop in drops)
    pooled = [math.sqrt(np.mean([each[k] ** 2 for each in learned.missed.values()])) for k in (0, 1)]
    # the drops have about as many rows
    assert pooled == pytest.approx([learned.repeated.rms_nominal, learned.repeated.rms_extended], rel=0.2)
    assert not any(term.name in problem.effects for term in best.terms)
