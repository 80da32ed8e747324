"""CT scans that nobody has made: their predictions against another algebra and against runs."""

from __future__ import annotations

import math
from dataclasses import replace

import laws
import numpy as np
import pytest
from scipy.linalg import block_diag

from labsim.campaign import read_campaign
from labsim.diagnosis.next_experiment import expected_weight
from labsim.diagnosis.planned_scans import plan_scans, predict_scans
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.inference.fits.tangents import linearise_at
from labsim.inference.observations.compacted_zone import CompactedZones, see_dust
from labsim.inference.observations.undisturbed import Layering


def open_made(folder, **made):
    campaign = read_campaign(laws.write_campaign(folder / "made", **made))
    return prepare(campaign, laws.LawStore(folder / "store"), workers=1)


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    return open_made(tmp_path_factory.mktemp("scanned"), scan=True)


@pytest.fixture(scope="module")
def dropped(tmp_path_factory):
    return open_made(tmp_path_factory.mktemp("dropped"))


def test_a_scan_made_again_is_the_normal_distribution_given_today_s_data(scanned) -> None:
    """ln p_m as one more normal error, and the joint covariance inverted as a whole."""
    problem, fit = scanned
    before = {name: len(zone.table.base) for name, zone in ((zone.name, zone) for zone in problem.scans)}
    extended, texts = plan_scans(problem, [fit], new=True)
    assert len(texts) == 1 and " ".join(texts[0]).startswith("a CT scan of the 0.999 mm tip")
    ((found,),) = predict_scans(problem, extended, [fit])
    assert {zone.name: len(zone.table.base) for zone in problem.scans} == before

    (place, zones), (of_dust, dust) = problem.find(CompactedZones), problem.find(Layering)
    [zone], [beside] = zones.zones, dust.dust
    speed = fit.nuisances[place]
    again = np.append(speed, math.log(zone.observed.scan.speed.value))
    of_zones, of_layers = linearise_at(extended, (again, np.empty(0)), fit.log_p_m, {})
    others = [block for k, block in enumerate(fit.blocks) if k not in (place, of_dust)]
    cells, layers = of_zones.residual.size // 2, of_layers.residual.size // 2
    names = ["ln_p_m"]
    blocks = [*others, of_zones, of_layers]
    tangent = np.concatenate([block.tangents[names[0]] for block in blocks])
    joint = block_diag(*(block.covariance for block in blocks)) + 30.0**2 * np.outer(tangent, tangent)
    residual = np.concatenate([block.residual for block in blocks])
    first = sum(block.residual.size for block in others)
    planned = np.zeros(residual.size, dtype=bool)
    planned[first + cells : first + 2 * cells] = planned[-layers:] = True
    weights = np.linalg.solve(joint[np.ix_(~planned, ~planned)], joint[~planned][:, planned]).T
    numbers = np.concatenate(
        [
            [*zone.observed.filling_factor, zone.observed.map.tip_depth],
            [*beside.filling_factor, math.log(beside.point_spread)],
        ]
    )
    mean = numbers - residual[planned] + weights @ residual[~planned]
    spread = joint[np.ix_(planned, planned)] - weights @ joint[~planned][:, planned]
    np.testing.assert_allclose(found.mean, mean, atol=2e-5)
    np.testing.assert_allclose(np.sqrt(np.diag(found.spread)), np.sqrt(np.diag(spread)), rtol=5e-3)
    # and it says what the scan that was made showed
    seen = zone.observed.filling_factor
    assert np.mean(np.abs(found.mean[: seen.size] - seen)) < 0.01


def test_a_scan_of_a_campaign_without_any_is_seen_in_a_run_of_its_drop(dropped) -> None:
    problem, fit = dropped
    assert plan_scans(problem, [fit], new=False)[1] == []
    extended, texts = plan_scans(problem, [fit], new=True)
    assert len(texts) == 1 and len(extended.groups) == len(problem.groups) + 1
    ((found,),) = predict_scans(problem, extended, [fit])
    (zone,) = extended.scans
    observed, table = zone.observed, zone.table
    speed = observed.scan.speed.value
    depth = math.exp(table.features(fit.log_p_m, math.log(speed), {})[0])
    assert found.mean[observed.filling_factor.size] == pytest.approx(depth, rel=0.03)
    assert observed.map.tip_depth == pytest.approx(depth, rel=0.03)
    # a run of the very drop, seen through the planned scanner
    setting = extended.grid.setting(extended.groups[-1], speed, math.exp(fit.log_p_m))
    (run,) = laws.LawStore(problem.grid.store.folder).get_many([setting], workers=1)
    cells = see_dust(run, observed.map, observed.point_spread, masked=~observed.cells)[observed.cells]
    contrast = np.abs(cells - observed.undisturbed).max()
    assert np.mean(np.abs(found.mean[: cells.size] - cells)) < 0.1 * contrast
    under, deeper, aside, beside = found.levels.values()
    assert observed.undisturbed - 3 * aside[1] < aside[0] < under[0]
    assert observed.undisturbed < deeper[0] < under[0] < 0.6 and beside[0] == pytest.approx(0.15, abs=0.003)
    # what was never scanned is known by the errors of the solver alone: more than noise, less than the contrast
    assert 5e-4 < under[1] < contrast
    assert found.summarise()["filling_factor_under_the_tip"] == under[0]
    assert "under the tip" in found.text and "a radius deeper" in found.text


def test_dust_beside_the_tip_tells_what_drops_cannot(dropped) -> None:
    """Of a filling factor that p_m makes up for, drops leave as much open as its prior does; the dust beside the tip shows it."""
    problem, fit = dropped
    other = fit_hypothesis(problem, ("filling_factor",), (fit.log_p_m, {"filling_factor": 0.01}))
    extended, _ = plan_scans(problem, [fit, other], new=True)
    (plain,), (denser,) = predict_scans(problem, extended, [fit, other])
    (zone,) = extended.scans
    rows = slice(zone.observed.filling_factor.size + 1, -1)
    known, open_ = (each.spread[rows, rows] for each in (plain, denser))
    stated = problem.campaign.sample.filling_factor_sigma
    assert (
        stated < np.sqrt(np.diag(known)).max() < 1.5 * stated < 5.0 * stated < np.sqrt(np.diag(open_)).min()
    )
    bits = expected_weight([plain.mean, denser.mean], [plain.spread, denser.spread], np.array([0.5, 0.5]))
    assert abs(other.evidence - fit.evidence) < 1.0 and bits > 10.0


def test_no_scan_is_planned_that_nothing_would_be_compared_with(dropped) -> None:
    problem, fit = dropped
    for changed in (
        {"geometry": "planar"},
        {"material": replace(problem.campaign.material, law="von_mises")},
    ):
        other = replace(problem, campaign=replace(problem.campaign, **changed))
        assert plan_scans(other, [fit], new=True)[1] == []
