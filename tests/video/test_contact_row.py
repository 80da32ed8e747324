"""The row of the surface from the rows alone: a law integrated here, and tracks of an independent simulator."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labsim.campaign import read_campaign
from labsim.inference.observations.observe import read_observed_track
from labsim.records import Camera, DecelerationCurve, Track
from labsim.video.motion.contact_row import find_surface_row
from labsim.video.motion.curve import fit_deceleration

RATE, PIXEL, RADIUS = 10_000.0, 20e-6, 0.5e-3
CAMERA = Camera(RATE, PIXEL, 300.0, 0.15)
CAMPAIGNS = Path(__file__).parents[2] / "data" / "campaigns"


def fall(seed: int, sigma: float, speed: float = 0.8) -> Track:
    """Rows of a round tip in dust that pushes back with its strength and its inertia over the area of contact."""
    contact, count = 6e-3, 110

    def push(_: float, state: np.ndarray) -> list[float]:
        z, v = state
        reach = np.clip(z / RADIUS, 0.0, 1.0)
        return [v, 9.81 - (2 * reach - reach**2) * (330.0 + 400.0 * v**2)]

    time = np.arange(count) / RATE
    stop = lambda _, state: state[1]  # noqa: E731
    stop.terminal = True
    found = solve_ivp(push, (0, 1), [0.0, speed], events=stop, dense_output=True, rtol=1e-9, atol=1e-12)
    depth = found.sol(np.clip(time - contact, 0.0, found.t[-1]))[0]
    s = np.minimum(time - contact, 0.0)
    depth = depth + speed * s + 0.5 * 9.81 * s**2
    row = 300 + depth / PIXEL + np.random.default_rng(seed).normal(0, sigma, count)
    return Track(np.arange(count), time, row, np.full(count, sigma), np.ones(count, bool), ("",) * count)


@pytest.mark.parametrize("sigma", [0.01, 0.08])
@pytest.mark.parametrize("stated", [0.0, 10.0, -10.0])
def test_row_is_found_whatever_is_stated(sigma: float, stated: float) -> None:
    camera = replace(CAMERA, surface_row=300.0 + stated)
    for seed in range(3):
        found = find_surface_row(fall(seed, sigma), camera, RADIUS)
        assert found is not None
        assert abs(found.value - 300.0) < 3 * found.sigma
        assert found.sigma < (0.6 if sigma < 0.05 else 1.5)


def test_rows_of_an_independent_simulator() -> None:
    """Thirteen drops: rms within the stated error bars, and a row stated 10 px wrong is 5 standard deviations off in most."""
    campaign = read_campaign(CAMPAIGNS / "p01")
    pull, sigma = [], []
    for drop in campaign.drops:
        found = find_surface_row(read_observed_track(drop), drop.camera, drop.projectile.tip_radius)
        assert found is not None
        pull.append((found.value - drop.camera.surface_row) / np.hypot(found.sigma, 0.15))
        sigma.append(found.sigma)
    assert np.max(np.abs(pull)) < 3 and np.sqrt(np.mean(np.square(pull))) < 1.2
    assert np.median(sigma) < 1.2


def test_a_curve_that_is_known_is_not_fitted_again(monkeypatch: pytest.MonkeyPatch) -> None:
    track, camera = fall(1, 0.2), replace(CAMERA, surface_row=CAMERA.surface_row + 0.3)
    wanted = find_surface_row(track, camera, RADIUS)
    curve, fits = fit_deceleration(track, camera), []

    def count(*given: object) -> DecelerationCurve:
        fits.append(given)
        return fit_deceleration(*given)

    monkeypatch.setattr("labsim.video.motion.contact_row.fit_deceleration", count)
    assert find_surface_row(track, camera, RADIUS, curve) == wanted
    without = len(fits)
    assert find_surface_row(track, camera, RADIUS) == wanted and len(fits) - without == without + 1


def test_a_track_without_contact_has_no_row() -> None:
    track = fall(0, 0.05)
    short = Track(
        track.frame[:50],
        track.time[:50],
        track.tip_row[:50],
        track.sigma[:50],
        track.valid[:50],
        ("",) * 50,
    )
    assert find_surface_row(short, CAMERA, RADIUS) is None
