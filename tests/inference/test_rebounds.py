"""The way back up after a stop: measured on a film, taken from runs, and what it says of the dust's stiffness."""

from __future__ import annotations

import math

import numpy as np
import pytest

from labsim.effects import Instrument
from labsim.inference.emulation.forward import ResponseTable
from labsim.inference.fits.blocks import Block
from labsim.inference.observations import Observation, RunFeatures
from labsim.inference.observations.linearised_drop import ErrorBudget, Perturbation
from labsim.inference.observations.observe import observe_drop
from labsim.inference.observations.rebounds import (
    CHANGE,
    COMMON,
    OWN,
    Rebound,
    Rebounds,
    extract_rebound,
    measure_rebound,
)
from labsim.records import Camera, Drop, Material, Measured, Projectile, Record, Track
from labsim.sph import DropRun, DropSetting, simulate

CONTACT, STOP, DEPTH, SPEED, ROW = 8.1e-3, 2e-3, 1e-3, 0.785, 300.0
CAMERA = Camera(frame_rate=10000.0, pixel_size=20e-6, surface_row=ROW, surface_row_sigma=0.15)


def make_track(lift: float, frames: int = 130) -> tuple[Drop, Track]:
    """A drop that stops after STOP, DEPTH deep, and comes back by ``lift`` (m) within 0.15 of that time."""
    projectile = Projectile("hemisphere", 5e-4, 1.33e-6)
    drop = Drop("D01", projectile, 1, Measured(20e-3, 1e-4), CAMERA, Record("track", None, 0.08))
    time = np.arange(frames) / CAMERA.frame_rate
    clock = time - CONTACT
    fraction = np.clip(clock / STOP, 0.0, 1.0)
    back = np.clip((clock / STOP - 1.0) / 0.15, 0.0, 1.0)
    depth = DEPTH * np.sin(0.5 * math.pi * fraction) - lift * 0.5 * (1.0 - np.cos(math.pi * back))
    above = clock < 0.0
    depth[above] = SPEED * clock[above] + 0.5 * 9.80665 * clock[above] ** 2
    row = ROW + depth / CAMERA.pixel_size + np.random.default_rng(3).normal(0.0, 0.08, frames)
    return drop, Track(
        np.arange(frames), time, row, np.full(frames, 0.08), np.ones(frames, bool), ("",) * frames
    )


def test_a_film_shows_how_far_its_drop_comes_back() -> None:
    for lift in (0.0, 20e-6, 35e-6):
        way, sigma = measure_rebound(observe_drop(*make_track(lift))) or (math.nan, math.nan)
        # around the stop the sine is 0.1 % less deep than at its end, in the mean
        assert way == pytest.approx(lift, abs=3 * sigma + 2e-3 * DEPTH) and 0.5e-6 < sigma < 2e-6


def test_a_film_that_ends_at_the_stop_shows_nothing() -> None:
    until = round((CONTACT + 1.15 * STOP) * CAMERA.frame_rate)
    assert measure_rebound(observe_drop(*make_track(20e-6, until))) is None


def test_softer_dust_springs_back_further() -> None:
    def find_way(bulk_modulus: float) -> tuple[DropRun, np.ndarray]:
        material = Material(bulk_modulus=bulk_modulus)
        projectile = Projectile("hemisphere", 5e-4, 1.33e-6)
        run = simulate(DropSetting(projectile, 0.4, material, spacing=5e-4 / 4, after_stop=0.34))
        return run, extract_rebound(run)

    run, (log_depth, share) = find_way(45e3)
    late = (run.time > 1.2 * run.stopping_time) & (run.time < 1.33 * run.stopping_time)
    assert math.exp(log_depth) == pytest.approx(run.penetration_depth, rel=1e-12)
    # the mean around the stop is a little less than the deepest point
    lift = run.penetration_depth - float(run.depth[late].mean())
    assert share * run.penetration_depth == pytest.approx(lift, abs=0.002 * run.penetration_depth)
    _, (_, soft) = find_way(15e3)
    assert soft > 1.4 * share > 0.0


def make_rebounds(ways: tuple[float, ...]) -> Rebounds:
    """Drops of one projectile whose runs come back by 2 % of the depth, by more with the amplitude of an effect."""
    speeds = np.log([0.7, 0.8, 0.9])
    base = np.tile([math.log(DEPTH), 0.02], (3, 1))
    table = ResponseTable(speeds, (0, 1, 2), {k: base + np.array([-0.2 * k, 0.0]) for k in (-1, 0, 1)})
    table.changes["soft"] = {0: {1.0: np.tile([0.0, 0.01], (3, 1))}}
    features = RunFeatures(0, table, extract_rebound)
    drop = observe_drop(*make_track(20e-6))
    return Rebounds(tuple(Rebound(drop, way, 1e-6, features) for way in ways))


def linearise(rebounds: Rebounds, amplitude: float, pixel_factor: float = 1.0) -> Block:
    def point(soft: float, step: float) -> Perturbation:
        instruments = {"D01": Instrument(pixel_factor=pixel_factor)}
        return Perturbation({"soft": soft}, instruments, {}, lambda name: DropSetting(), step)

    moved = {"soft": point(amplitude + 1e-3, 1e-3)}
    return rebounds.linearise(rebounds.begin(), math.log(1000.0), point(amplitude, 0.0), ErrorBudget(), moved)


def test_ways_are_compared_with_what_codes_differ_by() -> None:
    rebounds = make_rebounds((21e-6, 35e-6))
    assert isinstance(rebounds, Observation) and len(rebounds.features) == 1
    block = linearise(rebounds, 0.5)
    expected = 0.025 * DEPTH
    assert block.residual == pytest.approx(np.array([21e-6, 35e-6]) - expected, rel=1e-9)
    assert block.tangents["soft"] == pytest.approx(0.01 * DEPTH, rel=1e-6)
    # a depth that falls by 0.2 for twice the strength takes its share of the way along
    assert block.tangents["ln_p_m"] == pytest.approx(-0.2 / math.log(2.0) * expected, rel=0.01)
    changed = 0.005 * DEPTH
    variance = 1e-12 + (OWN * expected) ** 2 + (COMMON * expected) ** 2 + (CHANGE * changed) ** 2
    alike = (COMMON * expected) ** 2  # two drops of one projectile to one depth
    assert block.covariance == pytest.approx(np.array([[variance, alike], [alike, variance]]), rel=1e-9)
    assert linearise(rebounds, 0.5, 1.1).residual[0] == pytest.approx(21e-6 - expected / 1.1, rel=1e-9)
