"""The planar stand-in and the readings of its factor."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from labsim.campaign import read_campaign
from labsim.inference.published.calibrate import summarise
from labsim.inference.published.figures import choose_drops, collect_figures
from labsim.inference.published.planar import PLANAR_FACTOR, campaign_setting, expected_raw_depth, round_depth

SEED = read_campaign(Path(__file__).parents[2] / "data" / "guettler2009")


def test_the_factor_is_the_ratio_of_mass_per_area() -> None:
    sphere = 4.0 / 3.0 * math.pi / math.pi  # of R ρ
    cylinder = math.pi / 2.0
    assert pytest.approx(sphere / cylinder) == PLANAR_FACTOR


def test_the_readings_give_the_targets_of_the_seed() -> None:
    (s01,) = choose_drops(SEED, ["depth"])
    values = {}
    for reading in ("multiply_exp", "none", "multiply_sim"):
        (figure,) = collect_figures([s01], ["depth"], reading)
        values[reading] = figure.value
        assert round_depth(figure.value, reading) == pytest.approx(s01.published.penetration_depth.value)
    assert values["multiply_exp"] == pytest.approx(0.822e-3, abs=0.5e-6)
    assert values["none"] == pytest.approx(0.969e-3, abs=0.5e-6)
    assert values["multiply_sim"] == pytest.approx(1.141e-3, abs=0.5e-6)
    assert expected_raw_depth(1.0, "none") == 1.0


def test_sizes_are_scaled_copies_of_each_other() -> None:
    small, large = (next(d for d in SEED.drops if d.name == name).projectile for name in ("D01", "D11"))
    a, b = (campaign_setting(SEED, projectile, 0.5, 1300.0) for projectile in (small, large))
    for name in ("spacing", "width", "depth", "duration"):
        assert getattr(b, name) / getattr(a, name) == pytest.approx(3.0)
    assert b.projectile.mass / a.projectile.mass == pytest.approx(
        9.0, rel=1e-4
    )  # kg per metre of the same glass
    assert a.numerics.alpha <= 0.1 and a.gravity == 0.0


def test_quantiles_carry_the_names_of_the_contract() -> None:
    import numpy as np

    found = summarise(np.linspace(0.0, 1.0, 1001))
    assert list(found) == ["mean", "sd", "q05", "q16", "q50", "q84", "q95"]
    assert found["q16"] == pytest.approx(0.16)
