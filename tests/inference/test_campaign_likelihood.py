"""Codes of curves, nodes, free fall, the linear algebra and the sampler, each against an answer known otherwise."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from benchmarks.truths.video import evaluate_motion
from labsim.effects import Instrument, LogNormal, Parameter
from labsim.errors import ExtrapolationError
from labsim.inference.emulation.curves import FRACTIONS, extract_curve, interpolate_depth, interpolate_rate
from labsim.inference.emulation.forward import Instant, ResponseTable, predict_depth, predict_speed
from labsim.inference.emulation.grid import interpolation_weights, speed_nodes, strength_node
from labsim.inference.emulation.nodes import enclosing_nodes, nearest_nodes
from labsim.inference.fits.blocks import solve_globals
from labsim.inference.fits.evidence import log_share_inside
from labsim.inference.fits.posterior import measure_residual, sample
from labsim.inference.observations.compacted_zone import Block
from labsim.inference.observations.observe import observe_drop
from labsim.records import STANDARD_GRAVITY, Camera, Drop, Material, Measured, Projectile, Record, Track
from labsim.sph import DropSetting, simulate


def sine_features(depth=1e-3, stop=2e-3):
    shape = np.sin(0.5 * math.pi * np.minimum(FRACTIONS, 1.0))
    return np.concatenate([[math.log(depth), math.log(stop)], shape])


def test_weights_sum_to_one_and_reproduce_polynomials():
    nodes = np.log([0.1, 0.17, 0.289, 0.4913])
    weights = interpolation_weights(nodes, math.log(0.2))
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert weights @ nodes**3 == pytest.approx(math.log(0.2) ** 3, rel=1e-12)


@pytest.mark.parametrize(
    ("low", "high", "mean", "sigma"),
    [
        (5.7, 8.7, 7.0, 0.1),
        (5.7, 8.7, 5.6, 0.2),
        (5.7, 8.7, 9.0, 0.1),
        (0.0, 1e-3, 0.5, 1.0),
        (-math.inf, 0.3, 1.0, 0.5),
    ],
)
def test_the_share_of_a_gaussian_between_limits(low, high, mean, sigma):
    inside, _ = quad(norm(mean, sigma).pdf, max(low, mean - 40 * sigma), high, epsabs=0.0, limit=200)
    assert log_share_inside(low, high, mean, sigma) == pytest.approx(math.log(inside), rel=1e-7, abs=1e-9)


def test_the_share_far_outside_is_the_tail():
    assert log_share_inside(30.0, 60.0, 0.0, 1.0) == pytest.approx(norm.logsf(30.0))
    assert log_share_inside(-600.0, -300.0, 0.0, 10.0) == pytest.approx(norm.logcdf(-30.0))


@pytest.mark.parametrize(("slowest", "fastest"), [(0.145, 1.18), (0.3, 0.31), (0.11, 0.9), (0.2, 0.2)])
def test_speed_nodes_enclose_and_are_shared(slowest, fastest):
    nodes = np.array(speed_nodes(slowest, fastest))
    assert nodes[0] <= slowest and nodes[-1] >= fastest
    # the outer ones just beyond, or as near as three nodes that still tell a slope
    assert nodes[-1] / nodes[0] < max(1.145 * 1.001 * fastest / slowest, 1.85)
    assert len(nodes) >= 3 and np.ptp(np.diff(np.log(nodes))) < 2e-3  # evenly apart
    assert 1.29 < nodes[1] / nodes[0] < 1.6
    assert tuple(nodes) == speed_nodes(1.002 * slowest, 0.998 * fastest)  # of another campaign
    assert strength_node(1) == 2000.0


def test_a_run_comes_back_from_its_features():
    setting = DropSetting(Projectile("hemisphere", 5e-4, 1.33e-6), 0.3, Material(), spacing=5e-4 / 4)
    run = simulate(setting)
    features = extract_curve(run)
    time = np.linspace(0, run.stopping_time, 60)
    assert interpolate_depth(features, time) == pytest.approx(
        run.depth_at(time), abs=2e-3 * run.penetration_depth
    )
    speed = interpolate_rate(features, time[5:-5])
    assert speed == pytest.approx(
        np.interp(time[5:-5], run.time, run.velocity), abs=0.02 * setting.impact_speed
    )


def test_prediction_is_continuous_at_contact_and_scales_with_the_instrument():
    features, instant = sine_features(), Instant(5e-3, math.log(0.785), 0.0)
    time = np.array([5e-3 - 1e-9, 5e-3 + 1e-9])
    assert (
        abs(np.diff(predict_depth(features, time, instant, Instrument(), 0.0))[0]) < 2.1e-9 * 0.785
    )  # 2 ns of motion
    grid = np.linspace(0, 7e-3, 50)
    plain = predict_depth(features, grid, instant, Instrument(), 0.0)
    assert predict_depth(features, grid, instant, Instrument(pixel_factor=1.25), 0.0) == pytest.approx(
        plain / 1.25, rel=1e-12
    )
    assert predict_depth(features, grid * 0.8, instant, Instrument(rate_factor=0.8), 0.0) == pytest.approx(
        plain, rel=1e-9, abs=1e-12
    )
    step = 1e-7
    later = predict_depth(features, grid, instant._replace(contact_time=5e-3 + step), Instrument(), 0.0)
    speed = predict_speed(features, grid, instant, Instrument())
    inside = np.abs(grid - 5e-3) > 1e-5
    assert ((plain - later) / step)[inside] == pytest.approx(speed[inside], rel=1e-3, abs=1e-4)


def test_rows_that_are_read_one_after_another_show_a_later_tip():
    """Where it was when its row was read; and frames that come ever later show it ever further on its way."""
    features, instant = sine_features(), Instant(5e-3, math.log(0.785), 0.0)
    grid = np.linspace(0, 7e-3, 50)
    seen = predict_depth(features, grid, instant, Instrument(row_delay=0.3), 0.0)
    assert seen == pytest.approx(
        predict_depth(features, grid + 0.3 * seen, instant, Instrument(), 0.0), abs=2e-7
    )
    later = predict_depth(features, grid, instant, Instrument(clock_drift=20.0), 0.0)
    clock = grid - 5e-3
    assert later == pytest.approx(
        predict_depth(features, grid + 10.0 * clock**2, instant, Instrument(), 0.0), abs=1e-12
    )


def test_effects_add_a_polynomial_that_vanishes_at_null():
    speeds = np.log([0.2, 0.3, 0.4])
    base = np.stack([sine_features(stop=2e-3 + k * 1e-4) for k in range(3)])
    table = ResponseTable(speeds, (0, 1, 2), {0: base, 1: base - 0.2})
    table.changes["e"] = {0: {1.0: 0.1 * np.ones_like(base), 2.0: 0.4 * np.ones_like(base)}}
    plain = table.features(math.log(1200.0), speeds[1], {})
    assert table.features(math.log(1200.0), speeds[1], {"e": 0.0}) == pytest.approx(plain, abs=0)
    # 0.1 a² goes through (0, 0), (1, 0.1), (2, 0.4)
    assert table.features(math.log(1200.0), speeds[1], {"e": 1.5}) - plain == pytest.approx(0.225, rel=1e-12)
    # runs that are added later, and those of another effect that takes the name, count at once
    table.base[2] = base - 0.5
    later = table.features(math.log(4000.0), speeds[1], {})
    assert later == pytest.approx(base[1] - 0.5, rel=1e-12)
    table.changes["f"] = {0: {1.0: 0.3 * np.ones_like(base), 2.0: 1.2 * np.ones_like(base)}}
    table.changes["e"] = table.changes.pop("f")
    assert table.at(math.log(1200.0), speeds[1]).change("e", 1.5) == pytest.approx(0.675, rel=1e-12)


def test_a_law_on_the_projectile_bends_as_it_does_without_runs():
    """One run of it says a tenth more than the trend; between, the trend says how it goes. A run whose trend is not known yet
    counts alone."""
    speeds = np.log([0.2, 0.3, 0.4])
    base = np.stack([sine_features() for _ in speeds])
    table = ResponseTable(speeds, (0, 2), {0: base})
    table.trends["e"] = {0: {a: np.full_like(base, a * a) for a in (1.0, 2.0, 3.0)}}
    table.changes["e"] = {0: {2.0: np.full_like(base, 4.4)}}
    place = table.at(math.log(1000.0), speeds[1])
    assert place.change("e", 1.0) == pytest.approx(2.2, rel=1e-12)
    table.corrections["e"] = {0: {2.0: np.full_like(base, 0.4)}}
    for amplitude in (0.5, 1.0, 2.0, 2.5):
        assert place.change("e", amplitude) == pytest.approx(amplitude**2 + 0.2 * amplitude, rel=1e-12)


def test_a_power_of_a_factor_is_met_from_its_null_to_its_limit():
    """ln D of dust weakened by a factor falls with ln of the factor: exact on that scale, far off on the factor's own."""
    speeds = np.log([0.2, 0.3, 0.4])
    base = np.stack([sine_features() for _ in speeds])
    table = ResponseTable(speeds, (0, 2), {0: base})
    table.changes["e"] = {
        0: {value - 1.0: np.full_like(base, -0.3 * math.log(value)) for value in (0.5, 0.05)}
    }

    def change(value):
        return table.at(math.log(1000.0), speeds[1]).change("e", value - 1.0)

    assert abs(change(0.125) + 0.3 * math.log(0.125)).min() > 0.1
    table.parameters["e"] = Parameter("f", "1", 1.0, (0.05, 20.0), LogNormal(1.0, 0.6), 0.5, "of a strength")
    for value in (0.05, 0.125, 0.3, 0.8, 1.5):
        assert change(value) == pytest.approx(-0.3 * math.log(value), rel=1e-12)


def test_an_effect_whose_runs_all_failed_is_said_so():
    """A diagnosis that learned a formula whose runs failed ended in a traceback."""
    speeds = np.log([0.2, 0.3, 0.4])
    base = np.stack([sine_features() for _ in speeds])
    table = ResponseTable(speeds, (0, 2), {0: base}, {"e": {0: {}}})
    with pytest.raises(ExtrapolationError, match="every run with it failed"):
        table.features(math.log(1000.0), speeds[1], {"e": 1.0})


def test_what_an_effect_changes_bends_with_strength_through_three_nodes():
    speeds = np.log([0.2, 0.3, 0.4])
    base = np.stack([sine_features() for _ in speeds])
    table = ResponseTable(speeds, (0, 2), {k: base for k in (-1, 0, 1)})

    def bend(lp):
        return 0.2 + 0.1 * (lp - math.log(1000.0)) + 0.05 * (lp - math.log(1000.0)) ** 2

    table.changes["e"] = {k: {1.0: np.full_like(base, bend(math.log(1000.0 * 2.0**k)))} for k in (-1, 0, 1)}
    for p_m in (550.0, 1000.0, 1370.0):
        found = table.at(math.log(p_m), speeds[1]).change("e", 1.0)
        assert found == pytest.approx(bend(math.log(p_m)), rel=1e-9)
    beyond = table.at(math.log(8000.0), speeds[1]).change("e", 1.0)  # held half a node beyond the last
    assert beyond == pytest.approx(bend(math.log(2000.0 * math.sqrt(2.0))), rel=1e-9)


def make_drop(height=20e-3):
    camera = Camera(frame_rate=10000.0, pixel_size=20e-6, surface_row=300.0, surface_row_sigma=0.15)
    projectile = Projectile("hemisphere", 5e-4, 1.33e-6)
    return Drop("D01", projectile, 1, Measured(height, 1e-4), camera, Record("track", None, 0.08))


def synthetic_track(drop, rng, outliers=()):
    camera = drop.camera
    features, contact, speed = sine_features(), 0.0081, 0.785
    time = np.arange(110) / camera.frame_rate
    depth = predict_depth(features, time, Instant(contact, math.log(speed), 0.0), Instrument(), 0.0)
    row = camera.surface_row + depth / camera.pixel_size + 0.08 * rng.standard_normal(time.size)
    for k in outliers:
        row[k] += 4.0
    n = time.size
    return Track(np.arange(n), time, row, np.full(n, 0.08), np.ones(n, bool), ("",) * n)


def test_free_fall_gives_contact_and_speed_and_outliers_go():
    drop = make_drop()
    track = synthetic_track(drop, np.random.default_rng(3), outliers=(20, 21, 60))
    observed = observe_drop(drop, track)
    assert not set(observed.time) & set(track.time[[20, 21, 60]])
    assert observed.rejected <= 3 + 1  # a good frame in a hundred may go with them
    assert observed.contact_time == pytest.approx(0.0081, abs=1e-5)
    assert observed.impact_speed == pytest.approx(0.785, rel=2e-3)
    assert observed.time.max() < 0.0081 + 2.6e-3  # what follows the stop is left out


def test_a_hard_stop_loses_no_frame():
    """14 px per frame stopped within four frames: every row up to the stop is observed, spikes before contact are not."""
    drop = make_drop()
    camera = drop.camera
    for seed in range(3):
        rng = np.random.default_rng(seed)
        step = 14 * camera.pixel_size * camera.frame_rate
        stop = 4.4 / camera.frame_rate
        time = np.arange(90) / camera.frame_rate
        depth = evaluate_motion(time - 40.3 / camera.frame_rate, step, stop, STANDARD_GRAVITY, -0.3)
        row = camera.surface_row + depth / camera.pixel_size + rng.normal(0, 0.02, 90)
        row[[12, 30]] += [3.0, -20.0]
        track = Track(np.arange(90), time, row, np.full(90, 0.02), np.ones(90, bool), ("",) * 90)
        observed = observe_drop(drop, track)
        kept = set(np.round(observed.time * camera.frame_rate).astype(int))
        assert kept >= set(range(46)) - {12, 30} and not kept & {12, 30}
        assert observed.rejected == 2


def test_globals_of_which_the_data_say_nothing_are_an_extrapolation():
    """A trial step may go where the simulated drop hardly moves; it is given up as every other that leaves the runs."""
    block = Block(np.ones(4), np.eye(4), {"ln_p_m": np.zeros(4)})
    with pytest.raises(ExtrapolationError, match="p_m"):
        solve_globals([block], ["ln_p_m"], {})


def test_globals_are_generalised_least_squares():
    rng = np.random.default_rng(5)
    root = rng.standard_normal((30, 30))
    covariance = root @ root.T + np.eye(30)
    tangent, residual = rng.standard_normal(30), rng.standard_normal(30)
    blocks = [
        Block(residual[part], covariance[part, part], {"ln_p_m": tangent[part]})
        for part in (slice(0, 18), slice(18, 30))
    ]
    step, spread, chi, logdet, _ = solve_globals(blocks, ["ln_p_m"], {})
    full = np.zeros((30, 30))
    full[:18, :18], full[18:, 18:] = covariance[:18, :18], covariance[18:, 18:]
    inverse = np.linalg.inv(full)
    expected = tangent @ inverse @ residual / (tangent @ inverse @ tangent)
    assert step[0] == pytest.approx(expected, rel=1e-9)
    assert spread[0, 0] == pytest.approx(1 / (tangent @ inverse @ tangent), rel=1e-9)
    assert logdet == pytest.approx(np.linalg.slogdet(full)[1], rel=1e-9)
    left = residual - tangent * expected
    assert chi == pytest.approx(left @ inverse @ left, rel=1e-9)


def test_sampler_recovers_a_known_gaussian_and_goes_on_after_a_stop(tmp_path):
    mean, covariance = np.array([0.3, -1.0]), np.array([[0.04, 0.01], [0.01, 0.09]])
    lower = np.linalg.cholesky(covariance)
    quadratic = measure_residual(lambda theta: np.linalg.solve(lower, theta - mean), mean, covariance)
    found = sample(
        lambda theta: -quadratic(theta), ["a", "b"], mean, covariance, seed=2, backend=tmp_path / "chain.h5"
    )
    error = 1 / math.sqrt(found.ess)
    for k, name in enumerate(("a", "b")):
        sigma = math.sqrt(covariance[k, k])
        assert found.samples(name).mean() == pytest.approx(mean[k], abs=5 * error * sigma)
        assert found.samples(name).std() == pytest.approx(sigma, rel=5 * error)
    assert found.r_hat < 1.05
    again = sample(
        lambda theta: -quadratic(theta), ["a", "b"], mean, covariance, seed=2, backend=tmp_path / "chain.h5"
    )
    assert again.steps >= found.steps


def test_free_fall_has_its_own_gravity():
    instant = Instant(0.0, math.log(0.5), 0.0)
    early = predict_depth(sine_features(), np.array([-1e-3]), instant, Instrument(), 0.0)[0]
    assert early == pytest.approx(-0.5e-3 + 0.5 * STANDARD_GRAVITY * 1e-6, rel=1e-9)


def test_no_base_is_simulated_beyond_the_range_of_p_m():
    """Nodes are 1000 Pa times powers of two; 300 to 6000 Pa lie between 250 and 8000 Pa."""
    limits = (300.0, 6000.0)
    assert enclosing_nodes(math.log(1300.0), limits) == [-1, 0, 1, 2]
    assert enclosing_nodes(math.log(1300.0)) == [-1, 0, 1, 2]
    assert enclosing_nodes(math.log(150.0), limits) == [-2, -1, 0, 1]
    assert enclosing_nodes(math.log(9000.0), limits) == [0, 1, 2, 3]
    assert enclosing_nodes(math.log(150.0)) == [-4, -3, -2, -1]
    # accelerometers: half as far apart
    assert enclosing_nodes(math.log(1300.0), limits, 0.5) == [-0.5, 0.0, 0.5, 1.0]
    assert nearest_nodes(math.log(1300.0), 0.5) == [0.5]
    assert nearest_nodes(math.log(1200.0), 0.5) == [0.0, 0.5]
