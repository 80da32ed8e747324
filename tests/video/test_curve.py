"""From rows to contact, speed, depth and stop: synthetic motions with known figures."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.truths.video import evaluate_motion
from labsim.errors import MeasurementError
from labsim.records import Camera, Measured, Track
from labsim.video import check_drop_height, fit_deceleration, fit_local_polynomial, read_track, write_track
from labsim.video.motion.segments import Ending, Motion, design_motion, join_parameters

RATE, PIXEL = 10_000.0, 20e-6
CAMERA = Camera(RATE, PIXEL, 300.0, 0.0)


def make_track(
    seed=0, sigma=0.02, *, speed=0.8, stop=3e-3, contact=6.0e-3, count=150, rebound=0.0, shape=0.4, drop=()
):
    rng = np.random.default_rng(seed)
    t = np.arange(count) / RATE
    z = evaluate_motion(t - contact, speed, stop, 9.81, shape)
    if rebound:
        after = np.clip(t - contact - stop, 0, None)
        z = z - (rebound * after - 0.5 * 9.81 * after**2)
    keep = np.setdiff1d(np.arange(count), drop)
    row = 300 + z / PIXEL + rng.normal(0, sigma, count)
    n = len(keep)
    track = Track(keep, t[keep], row[keep], np.full(n, sigma), np.ones(n, bool), ("",) * n)
    return track, float(evaluate_motion(np.array([stop]), speed, stop, 9.81, shape)[0])


def test_figures_of_a_drop() -> None:
    """T13: v0 0.3 %, t0 and T_s 0.02 ms, D 0.5 %, a(t) 2 % rms of the mean deceleration, at 0.03 px."""
    for seed in range(10):
        track, depth = make_track(seed, 0.03)
        curve = fit_deceleration(track, CAMERA)
        assert curve.impact_speed.value == pytest.approx(0.8, rel=0.003)
        assert curve.contact_time.value == pytest.approx(6e-3, abs=2e-5)
        assert curve.stopping_time.value == pytest.approx(3e-3, abs=2e-5)
        assert curve.penetration_depth.value == pytest.approx(depth, rel=0.005)
        inside = (curve.time > 1e-4) & (curve.time < 2.9e-3)
        truth = -(0.8 / 3e-3) * (1 + 0.4 * (1 - 2 * curve.time[inside] / 3e-3))
        assert np.sqrt(np.mean((curve.acceleration[inside] - truth) ** 2)) < 0.02 * 0.8 / 3e-3
        assert curve.stopping_time_2_percent.value < curve.stopping_time.value
        assert curve.apparent_gravity.value == pytest.approx(9.81, abs=4 * curve.apparent_gravity.sigma)


def test_one_sigma_holds_about_two_thirds(record_property) -> None:
    """T14: coverage of the stated 1 σ over 200 falls is 60 to 76 % for all four figures.

    The speed goes as 1 - u^m with m drawn for each fall: none of the laws is one of the fit's own (where it is, the spread
    between the models makes the stopping time's error bar too wide, never too narrow).
    """
    hits = {"contact_time": 0, "impact_speed": 0, "penetration_depth": 0, "stopping_time": 0}
    for seed in range(200):
        rng = np.random.default_rng(1000 + seed)
        power, speed, stop, contact = rng.uniform(1.3, 2.7), 0.8, 3e-3, 6e-3
        t = np.arange(110) / RATE - contact
        u, s = np.clip(t / stop, 0, 1), np.minimum(t, 0)
        z = speed * stop * (u - u ** (power + 1) / (power + 1)) + speed * s + 0.5 * 9.81 * s**2
        row = 300 + z / PIXEL + rng.normal(0, 0.05, 110)
        clock = np.arange(110) / RATE
        track = Track(np.arange(110), clock, row, np.full(110, 0.05), np.ones(110, bool), ("",) * 110)
        curve = fit_deceleration(track, CAMERA)
        truth = {
            "contact_time": contact,
            "impact_speed": speed,
            "penetration_depth": speed * stop * power / (power + 1),
            "stopping_time": stop,
        }
        for key, value in truth.items():
            figure = getattr(curve, key)
            hits[key] += abs(figure.value - value) < figure.sigma
    shares = {key: count / 200 for key, count in hits.items()}
    record_property("T14 cover", shares)
    assert all(0.60 <= share <= 0.76 for share in shares.values()), shares


def test_seed_law_from_fifteen_drops(record_property) -> None:
    """T13: stopping time independent of speed and D ∝ v come back: slope of D against v within 1 %."""
    speeds = np.linspace(0.15, 1.1, 15)
    found = []
    for seed, speed in enumerate(speeds):
        track, _ = make_track(seed, 0.03, speed=speed, contact=8e-3, count=160)
        found.append(fit_deceleration(track, CAMERA).penetration_depth.value)
    truth = evaluate_motion(np.array([3e-3]), 1.0, 3e-3, 9.81, 0.4)[0]
    record_property(
        "T13 slope of D against v, relative", np.sum(speeds * found) / np.sum(speeds**2) / truth - 1
    )
    assert np.sum(speeds * found) / np.sum(speeds**2) == pytest.approx(truth, rel=0.01)


def test_rebound_is_found_and_does_not_spoil_the_depth() -> None:
    track, depth = make_track(1, 0.03, rebound=0.05, count=130)
    curve = fit_deceleration(track, CAMERA)
    assert curve.rebound_speed is not None
    assert curve.penetration_depth.value == pytest.approx(depth, rel=0.005)


def test_stopping_time_before_a_kick() -> None:
    track, _ = make_track(1, 0.03, rebound=0.05, count=130)
    curve = fit_deceleration(track, CAMERA)
    assert curve.stopping_time.value == pytest.approx(3e-3, abs=6e-5)


def make_rebound(loose: float) -> tuple[Track, float]:
    """A fall whose push is as good as constant, and the dust that unloads as a spring within ``loose`` s: track, stop (s)."""
    stop, speed = 3e-3, 0.8
    t = np.arange(-60, 90) / CAMERA.frame_rate + 0.3 / CAMERA.frame_rate
    push = speed / stop
    z = np.where(t < 0, speed * t + 0.5 * 9.81 * t**2, speed * t - 0.5 * push * np.clip(t, 0, stop) ** 2)
    z = np.where(t > stop, 0.5 * speed * stop, z)
    e, phase = np.clip(t - stop, 0, None), 0.5 * np.pi / loose
    late = np.clip(e - loose, 0, None)
    z -= (
        push / phase**2 * (1 - np.cos(phase * np.minimum(e, loose)))
        + push / phase * late
        - 0.5 * 9.81 * late**2
    )
    row = CAMERA.surface_row + z / CAMERA.pixel_size + np.random.default_rng(5).normal(0, 0.01, t.size)
    n = t.size
    number = np.arange(n)
    return Track(number, number / CAMERA.frame_rate, row, np.full(n, 0.01), np.ones(n, bool), ("",) * n), stop


@pytest.mark.parametrize("frames", [0.5, 2.0, 6.0])
def test_dust_that_unloads_as_a_spring_does_not_move_the_stop(frames: float) -> None:
    track, stop = make_rebound(frames / CAMERA.frame_rate)
    curve = fit_deceleration(track, CAMERA)
    assert abs(curve.stopping_time.value - stop) < 4 * curve.stopping_time.sigma
    assert curve.stopping_time.sigma < 0.01 * stop
    assert curve.rebound_speed is not None
    expected = 0.8 / stop * frames / CAMERA.frame_rate * 2 / np.pi
    assert curve.rebound_speed.value == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("ending", ["rest", "ease", "rebound", "bounce", "open"])
def test_derivatives_of_a_motion_are_those_of_its_depth(ending: Ending) -> None:
    ends = np.array([0.03, 1.1, 0.4][: 3 if ending == "rebound" else 2])
    t = np.linspace(-1.0, 3.0, 200)
    many = design_motion(t, ends, 3, ending, 1)[0].shape[0]
    p = join_parameters(ends, np.random.default_rng(1).normal(size=many))
    motion = Motion(3, ending, p, np.eye(p.size), 0.0, 1)
    step = 1e-6 * np.eye(p.size)
    apart = [(motion.evaluate(t, p + one)[0] - motion.evaluate(t, p - one)[0]) / 2e-6 for one in step]
    np.testing.assert_allclose(motion.differentiate(t), np.transpose(apart), atol=1e-7)


def test_outliers_and_gaps() -> None:
    track, depth = make_track(2, 0.03, drop=(20, 21, 75, 76, 77))
    row = track.tip_row.copy()
    row[[10, 60, 90]] += [4.0, -7.0, 1.0]
    curve = fit_deceleration(
        Track(track.frame, track.time, row, track.sigma, track.valid, track.reason), CAMERA
    )
    assert any("outliers" in text for text in curve.warnings)
    assert not curve.used[[10, 60]].any()
    assert curve.penetration_depth.value == pytest.approx(depth, rel=0.005)
    assert curve.stopping_time.value == pytest.approx(3e-3, abs=2e-5)


def test_a_wrong_first_frame_is_not_where_the_track_begins() -> None:
    """A spike of the first frame to below the surface: the frames after it show the free flight."""
    track, depth = make_track(3, 0.03)
    row = track.tip_row.copy()
    row[0] = 300 + 0.5 * depth / PIXEL
    curve = fit_deceleration(
        Track(track.frame, track.time, row, track.sigma, track.valid, track.reason), CAMERA
    )
    assert not curve.used[0]
    assert curve.penetration_depth.value == pytest.approx(depth, rel=0.005)
    assert curve.stopping_time.value == pytest.approx(3e-3, abs=2e-5)


def test_wrong_frame_rate_shows_in_free_fall_and_drop_height() -> None:
    track, _ = make_track(3, 0.02)
    fast = Track(track.frame, track.time / 1.06, track.tip_row, track.sigma, track.valid, track.reason)
    curve = fit_deceleration(fast, CAMERA)
    assert any("free flight falls with" in text for text in curve.warnings)
    assert check_drop_height(curve, Measured(0.8**2 / 2 / 9.81, 1e-4)) is not None
    assert check_drop_height(fit_deceleration(track, CAMERA), Measured(0.8**2 / 2 / 9.81, 1e-4)) is None


def test_record_that_ends_too_early_gives_no_depth() -> None:
    track, _ = make_track(4, 0.02, count=80)
    curve = fit_deceleration(track, CAMERA)
    assert np.isnan(curve.penetration_depth.value) and np.isnan(curve.stopping_time.value)
    assert any("ends before the projectile stops" in text for text in curve.warnings)


def test_surface_uncertainty_goes_into_the_depth() -> None:
    track, _ = make_track(5, 0.02)
    loose = fit_deceleration(track, Camera(RATE, PIXEL, 300.0, 0.3))
    assert loose.penetration_depth.sigma == pytest.approx(0.3 * PIXEL, rel=0.2)


def test_scale_uncertainty_goes_into_lengths_not_times() -> None:
    """A pixel size known to 1 % leaves depth and speed 1 % uncertain, with the noise in quadrature, and no time."""
    track, _ = make_track(5, 0.02)
    sure = fit_deceleration(track, CAMERA)
    loose = fit_deceleration(track, Camera(RATE, PIXEL, 300.0, 0.0, 0.01 * PIXEL))
    for name in ("penetration_depth", "impact_speed", "apparent_gravity"):
        figure, before = getattr(loose, name), getattr(sure, name)
        assert figure.value == pytest.approx(before.value)
        assert figure.sigma == pytest.approx(np.hypot(before.sigma, 0.01 * figure.value), rel=1e-3)
    for name in ("contact_time", "stopping_time"):
        assert getattr(loose, name).sigma == pytest.approx(getattr(sure, name).sigma, rel=1e-6)
    assert loose.depth_sigma[-1] > 0.99e-2 * loose.depth[-1]


def test_frames_that_err_alike_widen_the_figures() -> None:
    """Errors that last for several frames: 1 σ of depth and speed still holds about two thirds, and it is said."""
    hits = said = 0
    for seed in range(60):
        clean, depth = make_track(seed, 1e-6, count=110)
        rng = np.random.default_rng(seed)
        error = np.zeros(110)
        for i in range(1, 110):
            error[i] = 0.8 * error[i - 1] + rng.normal(0, 0.03)
        track = Track(
            clean.frame, clean.time, clean.tip_row + error, np.full(110, 0.05), clean.valid, clean.reason
        )
        curve = fit_deceleration(track, CAMERA)
        said += any("err alike" in text for text in curve.warnings)
        hits += abs(curve.penetration_depth.value - depth) < curve.penetration_depth.sigma
        hits += abs(curve.impact_speed.value - 0.8) < curve.impact_speed.sigma
    assert said >= 54
    assert 0.5 <= hits / 120 <= 0.85, hits / 120


def test_local_polynomial_agrees_inside() -> None:
    track, _ = make_track(6, 0.02)
    curve = fit_deceleration(track, CAMERA)
    local = fit_local_polynomial(track, CAMERA, curve)
    inside = (local["time_s"] > 3e-4) & (local["time_s"] < 2.5e-3)
    fit = np.interp(local["time_s"][inside], curve.time, curve.velocity)
    score = (local["velocity_m_s"][inside] - fit) / local["velocity_sigma_m_s"][inside]
    assert np.sqrt(np.mean(score**2)) < 1.6


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("", "track"),
        ("frame,speed\n1,2\n", "tip_row_px"),
        ("frame,tip_row_px\n", "the track is empty"),
        ("frame,tip_row_px\n0,1\n0,2\n", "frame"),
        ("frame,tip_row_px\n0,1\n1,abc\n", "tip_row_px"),
        ("frame,tip_row_px\n0.5,1\n1,2\n", "frame"),
    ],
)
def test_bad_tables_are_named(tmp_path, text, key) -> None:
    path = tmp_path / "track.csv"
    path.write_text(text)
    with pytest.raises(MeasurementError, match=key):
        read_track(path, CAMERA, 0.05)


def test_never_reaching_the_surface_is_an_error() -> None:
    track, _ = make_track(7)
    with pytest.raises(MeasurementError, match="never reaches the surface"):
        fit_deceleration(track, Camera(RATE, PIXEL, 900.0, 0.1))


def test_track_survives_its_file(tmp_path) -> None:
    track, _ = make_track(8, drop=(5,))
    again = read_track(write_track(track, tmp_path / "track.csv"), CAMERA, None)
    assert np.allclose(again.tip_row, track.tip_row, atol=1e-5) and np.allclose(again.sigma, track.sigma)
    assert np.array_equal(again.frame, track.frame)
