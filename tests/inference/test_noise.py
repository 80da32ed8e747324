"""The noise of a drop's rows is judged in the dust, where its depth is measured, and in free fall, each by itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.inference.emulation.forward import ResponseTable
from labsim.inference.observations.drop_model import make_drop_model
from labsim.inference.observations.observe import (
    ObservedDrop,
    join_alike,
    judge_noise,
    observe_drop,
    read_observed_track,
)

CAMPAIGN = read_campaign(Path(__file__).parents[2] / "data" / "campaigns" / "p01")


@pytest.fixture(scope="module")
def plain() -> list[ObservedDrop]:
    drops = [drop for drop in CAMPAIGN.drops if drop.record.kind == "track"][:5]
    return [observe_drop(drop, read_observed_track(drop)) for drop in drops]


def spoil(drop: ObservedDrop, factor: float, rng: np.random.Generator, flying: float = 1.0) -> ObservedDrop:
    """The drop with what its motion leaves of the rows drawn anew: ``factor`` times the stated noise from contact on, ``flying``
    times it before."""
    curve = drop.curve
    assert curve.residual is not None and curve.clock is not None
    sigma = np.where(curve.clock > drop.contact_time, factor, flying) * np.median(drop.track.sigma)
    drawn = np.where(np.isfinite(curve.residual), sigma * rng.standard_normal(sigma.size), np.nan)
    return replace(drop, curve=replace(curve, residual=drawn))


def compare(seen: list[ObservedDrop], where: str = "sigma") -> list[float]:
    """Judged over stated noise."""
    pairs = zip(seen, judge_noise(seen), strict=True)
    return [getattr(after, where) / getattr(before, where) for before, after in pairs]


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.4])
def test_noise_that_grows_or_falls_along_the_films_is_found(plain, factor):
    rng = np.random.default_rng(4)
    flying = 2.0 - factor
    spoiled = [[spoil(drop, factor, rng, flying) for drop in plain] for _ in range(20)]
    for where, true in (("sigma", factor), ("flight_sigma", flying)):
        ratios = [ratio for each in spoiled for ratio in compare(each, where)]
        # the stated noise counts too, and degrees of freedom that no motion took from these rows
        assert np.mean(ratios) == pytest.approx(true, rel=0.12)
        assert np.std(ratios) < 0.12 * true


def test_rows_of_free_fall_count_by_its_own_noise(plain):
    """Films whose light gets better as they go on: rows above the dust taken for as good as those in it would be a misfit."""
    (drop,) = judge_noise([spoil(plain[0], 0.7, np.random.default_rng(7), 1.5)])
    model = make_drop_model(drop, ResponseTable(np.zeros(1), (0,)))
    frames = 1.0 / np.sum(model.matrix**2, axis=1)
    flying = model.data < -drop.pixel
    assert flying.any() and model.below.any()
    assert model.data_variance[flying] * frames[flying] == pytest.approx(drop.flight_sigma**2)
    assert model.data_variance[model.below] == pytest.approx(drop.sigma**2)
    assert drop.flight_sigma > 1.3 * drop.sigma


def test_one_noisy_film_does_not_spoil_the_others(plain):
    rng = np.random.default_rng(5)
    first, *others = compare([spoil(drop, 3.0 if k == 0 else 1.0, rng) for k, drop in enumerate(plain)])
    assert first > 1.8 > 1.6 > max(others)


def test_a_film_whose_motion_was_not_found_leaves_the_others_alone(plain):
    """One fit that runs off by thousands of standard deviations made every drop say nothing."""
    rng = np.random.default_rng(6)
    first, *others = compare([spoil(drop, 1e4 if k == 0 else 1.0, rng) for k, drop in enumerate(plain)])
    assert first > 1e3
    assert others == pytest.approx([1.0] * len(others), abs=0.3)


def test_the_stated_noise_stands_where_no_row_says_otherwise(plain):
    bare = [
        replace(drop, curve=replace(drop.curve, residual=np.full_like(drop.curve.residual, np.nan)))
        for drop in plain
    ]
    assert compare(bare) == pytest.approx([1.0] * len(bare))


def test_what_is_said_of_many_drops_is_said_once() -> None:
    """Numbers from the least to the largest; what names frames, or is said of one drop, stands by itself."""
    scatter = "rows scatter {} times their error bars about the fit; errors were raised"
    said = [(f"D{k:02d}", scatter.format(3.5 + 0.25 * k)) for k in range(1, 10)]
    said[3:3] = [("D04", "a gap before frame 12"), ("D05", "a gap before frame 14"), ("D06", "ratio = 0.7")]
    assert join_alike(said) == [
        "drops D01, D02, D03, D04, D05, D06 and 3 more: rows scatter 3.75 to 5.75 times their error bars about the fit; "
        "errors were raised",
        "drop D04: a gap before frame 12",
        "drop D05: a gap before frame 14",
        "drop D06: ratio = 0.7",
    ]
    assert join_alike([("D01", "p = 1e-5"), ("D02", "p = 1e-5")]) == ["drops D01, D02: p = 1e-5"]
