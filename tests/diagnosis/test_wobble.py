"""A camera that wobbles is told by its films alone, and a law of the dust is not taken for one."""

from __future__ import annotations

import csv
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag

from labsim.campaign import read_campaign
from labsim.diagnosis.unlisted.unknown import WOBBLE, fit_unknown
from labsim.diagnosis.unlisted.wobble import fit_wobble
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import fit_p_value
from labsim.runs.store import RunStore

CAMPAIGNS = Path(__file__).parents[2] / "data" / "campaigns"
AMPLITUDE, FREQUENCY = 0.6, 410.0  # px, Hz


def shake(campaign: Path) -> None:
    """Let every film of a campaign wobble, each with its own phase."""
    rng = np.random.default_rng(5)
    rates = {drop.name: drop.camera.frame_rate for drop in read_campaign(campaign).drops if drop.camera}
    for path in sorted(campaign.glob("drops/*/track.csv")):
        head, *rows = list(csv.reader(path.read_text().splitlines()))
        phase, rate = rng.uniform(0.0, 2 * np.pi), rates[path.parent.name]
        for row in rows:
            angle = 2 * np.pi * FREQUENCY * float(row[0]) / rate + phase
            row[1] = f"{float(row[1]) + AMPLITUDE * np.sin(angle):.3f}"
        with path.open("w", newline="") as stream:
            csv.writer(stream).writerows([head, *rows])


def copy_few(folder: Path) -> Path:
    """The first six drops of p01, all of one rod."""
    campaign = shutil.copytree(CAMPAIGNS / "p01", folder / "campaign")
    for drop in sorted((campaign / "drops").iterdir())[6:]:
        shutil.rmtree(drop)
    return campaign


def test_a_wobble_is_found_with_its_frequency_and_its_size(shared_store, tmp_path) -> None:
    campaign, store = copy_few(tmp_path), RunStore(shared_store)
    _, still = prepare(read_campaign(campaign), store, workers=1)
    shake(campaign)
    problem, fit = prepare(read_campaign(campaign), store, workers=1)
    assert fit_p_value(fit) < 0.01 < fit_p_value(still)
    unknown = fit_unknown(problem, fit)
    assert unknown.block == WOBBLE
    wobble = unknown.find_wobble(fit)
    assert wobble is not None and wobble.explains(fit)
    assert wobble.frequency == pytest.approx(FREQUENCY, abs=8.0)
    assert wobble.amplitude == pytest.approx(AMPLITUDE, rel=0.1)
    # what it takes away is what was added: p_m is that of the films that stand still
    assert wobble.log_p_m == pytest.approx(still.log_p_m, abs=2.0 * wobble.log_p_m_sigma)
    assert wobble.law.size == fit.drops.residual.size


def test_a_drag_that_no_listed_cause_explains_is_no_wobble(shared_store) -> None:
    problem, fit = prepare(read_campaign(CAMPAIGNS / "u01"), RunStore(shared_store), workers=1)
    assert fit_p_value(fit) < 0.01
    wobble = fit_wobble(problem, fit)
    assert wobble is not None and not wobble.explains(fit)
    assert fit_unknown(problem, fit).find_wobble(fit) is None


def test_evidence_is_that_of_the_covariance_of_all_swings(shared_store, tmp_path) -> None:
    """At the best frequency and size, in closed form against the covariance with the swings in it."""
    campaign, store = copy_few(tmp_path), RunStore(shared_store)
    shake(campaign)
    problem, fit = prepare(read_campaign(campaign), store, workers=1)
    wobble = fit_wobble(problem, fit)
    assert wobble is not None
    columns = [
        np.stack([np.cos(angle), np.sin(angle)], axis=1)
        for model in problem.tracks.models
        for angle in [2 * np.pi * wobble.frequency * model.observed.time]
    ]
    residual = np.concatenate([block.residual for block in fit.blocks])
    tangent = np.concatenate([block.tangents["ln_p_m"] for block in fit.blocks])
    swings = np.zeros((residual.size, 2 * len(columns)))
    for k, (model, both) in enumerate(zip(problem.tracks.models, columns, strict=True)):
        begin = fit.drops.sections[model.observed.name].start
        part = model.matrix @ both * model.observed.pixel
        swings[begin : begin + len(part), 2 * k : 2 * k + 2] = part
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    best = -math.inf
    for size in (0.25, 0.5, 1.0):
        covariance = block_diag(*(block.covariance for block in fit.blocks)) + size**2 * swings @ swings.T
        solved, (_, log_determinant) = np.linalg.solve(covariance, tangent), np.linalg.slogdet(covariance)
        information = tangent @ solved
        chi = residual @ np.linalg.solve(covariance, residual) - (solved @ residual) ** 2 / information
        evidence = -0.5 * (chi + log_determinant + (residual.size - 1) * math.log(2 * math.pi))
        evidence -= 0.5 * math.log(information) + math.log(high - low)  # ln p_m far inside its range
        best = max(best, evidence)
    assert float(wobble.evidences.max()) == pytest.approx(best, abs=1e-3)
