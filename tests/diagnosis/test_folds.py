"""Drops that are held out while the fit is repeated without them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.gain import FOLDS, hold_out_folds, predict_held_out
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.observations.observe import observe_drops
from labsim.inference.open_problem import open_problem
from labsim.inference.problem import Problem
from labsim.runs.store import RunStore

CAMPAIGN = read_campaign(Path(__file__).parents[2] / "data" / "campaigns" / "p01")


@pytest.fixture(scope="module")
def fitted(shared_store) -> tuple[Problem, Fit]:
    drops = tuple(drop for drop in CAMPAIGN.drops if drop.name in ("D01", "D02", "D03", "D05", "D06", "D07"))
    campaign = replace(CAMPAIGN, drops=drops, scans=())
    problem = open_problem(
        campaign, RunStore(shared_store), {}, workers=1, drops=observe_drops(campaign)[0], cells=4
    )
    return problem, fit_hypothesis(problem, (), (math.log(1300.0), {}))


def test_every_drop_is_in_one_fold(fitted) -> None:
    problem, fit = fitted
    held = hold_out_folds(problem, fit)
    assert len(held.names) == FOLDS
    names = [name for fold in held.names for name in fold.split(", ")]
    assert sorted(names) == sorted(problem.tracks.samples)
    assert np.all(held.rms > 0) and np.all(held.rms < 5 * held.expected)
    # every record by itself: together they miss as much as their fold
    rows = {model.observed.name: np.count_nonzero(model.held) for model in problem.tracks.models}
    assert set(held.by_record) == set(rows)
    for fold, rms in zip(held.names, held.rms, strict=True):
        records = fold.split(", ")
        square = sum(rows[name] * held.by_record[name] ** 2 for name in records)
        assert square == pytest.approx(rms**2 * sum(rows[name] for name in records))
    assert len({round(rms, 12) for rms in held.by_record.values()}) == len(rows)


def test_where_the_fit_is_linear_repeating_it_says_the_same(fitted) -> None:
    """Of one drop at a time the algebra of the likelihood is the fit without it: p_m bends little within its error."""
    problem, fit = fitted
    alone = predict_held_out(problem, fit)
    lone = [name for name in hold_out_folds(problem, fit).names if ", " not in name]
    held = hold_out_folds(problem, fit)
    for name in lone:
        here, there = held.names.index(name), alone.names.index(name)
        assert held.rms[here] == pytest.approx(alone.rms[there], rel=0.05, abs=2e-7)
        assert held.log_score[here] == pytest.approx(alone.log_score[there], abs=0.3)


def test_what_is_held_out_does_not_tell_the_fit(fitted) -> None:
    """A drop that is shifted by a tenth is missed by that: the fit was repeated without it."""
    problem, fit = fitted
    held = hold_out_folds(problem, fit)
    name = next(name for name in held.names if ", " not in name)
    models = tuple(
        replace(
            model,
            observed=replace(
                model.observed, depth=np.where(model.observed.depth > 0, 1.1, 1.0) * model.observed.depth
            ),
        )
        if model.observed.name == name
        else model
        for model in problem.tracks.models
    )
    moved = replace(problem, observations=(replace(problem.tracks, models=models), *problem.observations[1:]))
    again = hold_out_folds(moved, fit_hypothesis(moved, (), (fit.log_p_m, {})))
    deepest = next(model.deepest for model in models if model.observed.name == name)
    k = held.names.index(name)
    assert again.rms[k] > 0.02 * deepest > 3 * held.rms[k]
