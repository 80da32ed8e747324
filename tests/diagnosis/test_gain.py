"""Held-out drops against the conditional normal distribution worked out another way, and the gain against its formula."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal

from labsim.diagnosis.gain import HeldOut, check_prediction, measure_gain, predict_held_out
from labsim.effects import Normal, Parameter
from labsim.inference.fits.blocks import Block
from labsim.inference.observations.tracks import DropsBlock

POINTS, DROPS, WIDE, SCALE = 6, 5, 100.0, 0.3
NAMES = [f"D{k:02d}" for k in range(1, DROPS + 1)]
EFFECT = "shear_strength"
PARAMETER = Parameter("amplitude", "1", 0.0, (-1e3, 1e3), Normal(0.0, SCALE), 0.1, "of no reason")


def make_fit(seed: int, *, hidden: float = 0.0):
    """Drops of linear response with errors of their own and shared ones, about a fit that is off by some p_m and ``hidden``."""
    random = np.random.default_rng(seed)
    n = POINTS * DROPS
    depth = np.tile(np.linspace(-1e-3, 1e-3, POINTS), DROPS)  # half of the points are above the surface
    tangents = {name: random.normal(0, 1e-5, n) for name in ("ln_p_m", EFFECT)}
    shared = random.normal(0, 3e-6, (n, 3))
    covariance = shared @ shared.T + np.diag(random.uniform(1e-6, 4e-6, n) ** 2)
    residual = (
        random.multivariate_normal(np.zeros(n), covariance)
        + tangents["ln_p_m"] * random.normal()
        + tangents[EFFECT] * hidden
    )
    sections = {name: slice(k * POINTS, (k + 1) * POINTS) for k, name in enumerate(NAMES)}
    drops = DropsBlock(residual, covariance, tangents, sections=sections)
    models = [
        SimpleNamespace(
            data=depth[sections[name]],
            held=depth[sections[name]] > 3e-6,
            lengths=np.eye(POINTS),
            observed=SimpleNamespace(name=name),
        )
        for name in NAMES
    ]
    fit = SimpleNamespace(drops=drops, blocks=(drops,), hypothesis=(EFFECT,), values={EFFECT: 0.0})
    problem = SimpleNamespace(
        effects={EFFECT: SimpleNamespace(amplitudes=[PARAMETER])},
        tracks=SimpleNamespace(models=models, samples={name: [name] for name in NAMES}),
    )
    return problem, fit


def condition(linear: Block, held: np.ndarray, widths: dict[str, float]):
    """Mean and covariance of held-out points given all others: globals are one more normal error each."""
    joint = linear.covariance + sum(
        width**2 * np.outer(linear.tangents[name], linear.tangents[name]) for name, width in widths.items()
    )
    weights = joint[np.ix_(held, ~held)] @ np.linalg.inv(joint[np.ix_(~held, ~held)])
    return weights @ linear.residual[~held], joint[np.ix_(held, held)] - weights @ joint[np.ix_(~held, held)]


@pytest.mark.parametrize("known", [False, True])
def test_a_held_out_drop_is_predicted_as_a_normal_distribution_says(known):
    problem, fit = make_fit(3)
    found = predict_held_out(problem, fit, known=known)
    widths = {} if known else {"ln_p_m": WIDE, EFFECT: SCALE}
    for k in range(DROPS):
        held = np.zeros(POINTS * DROPS, dtype=bool)
        held[k * POINTS + POINTS // 2 : (k + 1) * POINTS] = True  # below the surface
        mean, spread = condition(fit.drops, held, widths)
        data = fit.drops.residual[held]
        assert found.count[k] == POINTS // 2
        assert found.rms[k] == pytest.approx(math.sqrt(np.mean((data - mean) ** 2)), rel=1e-4)
        assert found.expected[k] == pytest.approx(math.sqrt(np.mean(np.diag(spread))), rel=1e-4)
        # in units in which a covariance is not taken for singular
        score = multivariate_normal.logpdf(data * 1e6, mean * 1e6, spread * 1e12) + data.size * math.log(1e6)
        assert found.log_score[k] == pytest.approx(score, abs=1e-2)


def test_two_records_of_a_drop_are_held_out_together():
    problem, fit = make_fit(3)
    problem.tracks.samples = {NAMES[0]: NAMES[:2], NAMES[2]: NAMES[2:]}
    found = predict_held_out(problem, fit)
    assert found.names == (NAMES[0], NAMES[2])
    held = np.zeros(POINTS * DROPS, dtype=bool)
    for k in (0, 1):
        held[k * POINTS + POINTS // 2 : (k + 1) * POINTS] = True
    mean, _ = condition(fit.drops, held, {"ln_p_m": WIDE, EFFECT: SCALE})
    left = fit.drops.residual[held] - mean
    assert found.rms[0] == pytest.approx(math.sqrt(np.mean(left**2)), rel=1e-4)


def test_drops_miss_by_what_is_expected_of_a_true_model_and_by_more_of_a_wrong_one():
    right, wrong = [], []
    for seed in range(60):
        for hidden, ratios in ((0.0, right), (4.0, wrong)):
            problem, fit = make_fit(seed, hidden=hidden)
            fit.hypothesis = ()
            found = predict_held_out(problem, fit)
            ratios.append(np.mean(found.rms**2) / np.mean(found.expected**2))
    assert np.mean(right) == pytest.approx(1.0, abs=3 * np.std(right) / math.sqrt(len(right)))
    assert np.std(right) / math.sqrt(len(right)) < 0.1
    assert np.mean(wrong) > 3.0


def test_the_check_of_a_prediction_is_uniform_for_a_true_model_and_small_for_a_wrong_one():
    true, wrong = [], []
    for seed in range(100):
        for hidden, found in ((0.0, true), (5.0, wrong)):
            problem, fit = make_fit(seed, hidden=hidden)
            fit.hypothesis = ()
            found.append(check_prediction(problem, fit, np.random.default_rng(seed), draws=400))
    assert kstest(true, "uniform").pvalue > 0.01
    assert np.mean(np.array(true) < 0.05) <= 0.12  # 5 % and three standard deviations of a hundred
    assert np.mean(np.array(wrong) < 0.05) > 0.9


def test_what_a_prior_and_a_scan_say_of_the_globals_is_drawn_as_well():
    """An amplitude drawn from its prior, and a scan that tells it: still uniform."""
    found = []
    for seed in range(100):
        random = np.random.default_rng(1000 + seed)
        amplitude = random.normal(0, SCALE)
        problem, fit = make_fit(seed, hidden=amplitude)
        tangents = {"ln_p_m": np.zeros(8), EFFECT: np.full(8, 3.0)}
        block = Block(tangents[EFFECT] * amplitude + random.normal(size=8), np.eye(8), tangents)
        fit.blocks = (fit.drops, block)
        found.append(check_prediction(problem, fit, random, draws=400))
    assert kstest(found, "uniform").pvalue > 0.01


def test_a_single_drop_leaves_nothing_to_check():
    problem, fit = make_fit(1)
    problem.tracks.models = problem.tracks.models[:1]
    problem.tracks.samples = {NAMES[0]: NAMES[:1]}
    assert check_prediction(problem, fit, np.random.default_rng(1)) == 1.0


def test_the_gain_is_the_share_of_the_mean_square_above_the_noise():
    def held_out(rms: float, score: float) -> HeldOut:
        return HeldOut(
            ("D01", "D02"), np.full(2, rms), np.full(2, 4e-6), np.array([score, score + 2]), np.ones(2)
        )

    gain = measure_gain(held_out(10e-6, 100.0), held_out(5e-6, 110.0))
    assert gain.fraction_removed == pytest.approx(1 - (25 - 16) / (100 - 16))
    assert (gain.log_score_difference, gain.log_score_difference_sigma) == (20.0, 0.0)
    assert measure_gain(held_out(3e-6, 0.0), held_out(3e-6, 0.0)).fraction_removed == 0.0  # nothing to remove
