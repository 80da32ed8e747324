"""Several scans are one part of the data: what the solver and the scanner get wrong in one of them they get wrong in all."""

import math
from dataclasses import replace

import laws
import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.effects import Instrument
from labsim.inference.calibrate import prepare
from labsim.inference.fits.steps import ParameterPoint, solve_at
from labsim.inference.observations.compacted_zone import CompactedZones
from labsim.inference.observations.linearised_drop import ErrorBudget, Perturbation, measure_distances


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """Block of one map, and of the same map twice over, about the nominal fit."""
    campaign = read_campaign(laws.write_campaign(tmp_path_factory.mktemp("scans") / "made", scan=True))
    problem, fit = prepare(campaign, laws.LawStore(tmp_path_factory.mktemp("store")), workers=1)
    place, known = problem.find(CompactedZones)
    [zone] = known.zones
    scan = replace(zone.observed.scan, name="C02")
    zones = CompactedZones((zone, replace(zone, observed=replace(zone.observed, scan=scan))))
    names = ["D01", zone.name, scan.name]
    perturbation = Perturbation({}, dict.fromkeys(names, Instrument()), {}, problem.campaign, 1.0)
    one = solve_at(problem, ParameterPoint(fit.log_p_m, {}, fit.nuisances)).blocks[place]
    speed = float(fit.nuisances[place][0])
    both = zones.linearise(np.array([speed, speed]), fit.log_p_m, perturbation, ErrorBudget(), {})
    return one, both, zones, zone.linearise(speed, fit.log_p_m, perturbation, ErrorBudget(), {})


def test_each_map_by_itself_is_what_it_was(twice):
    one, both, _, _ = twice
    assert list(both.sections) == ["C01", "C02"]
    for section in both.sections.values():
        np.testing.assert_allclose(both.residual[section], one.residual, rtol=1e-12)
        np.testing.assert_allclose(both.covariance[section, section], one.covariance, rtol=1e-9, atol=1e-18)
        np.testing.assert_allclose(both.free()[section, section], one.free(), rtol=1e-9)


def test_two_maps_of_like_drops_differ_by_their_own_errors_alone(twice):
    """Noise, speed, sample and lift of each: nothing of the solver or of the grey level is left in their difference."""
    one, both, _, part = twice
    n = one.residual.size
    first, second = both.sections.values()
    difference = np.zeros((n, 2 * n))
    difference[:, first], difference[:, second] = np.eye(n), -np.eye(n)
    left = difference @ both.covariance @ difference.T
    np.testing.assert_allclose(left, 2 * part.own, rtol=1e-6, atol=1e-15)
    assert np.trace(left) < np.trace(
        one.covariance
    )  # with errors drawn anew for each map it would be twice that


def test_scans_of_other_depth_share_less():
    """Two drops an e-fold apart in depth share exp(-½ / 0.8²) of the solver's error; the grey level is shared in full."""
    distances = measure_distances([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, math.log(3.0), 0.0)])
    assert distances[0, 1] == pytest.approx(1 / 0.8**2)
    assert distances[0, 2] == pytest.approx((math.log(3.0) / 2.0) ** 2)
    assert np.all(np.diag(distances) == 0.0)


def test_speeds_of_scans_follow_each_its_own(twice):
    _, both, zones, _ = twice
    weighted = both.solve(both.residual)
    moved, _ = zones.follow(zones.begin(), both, weighted)
    expected = zones.begin() + np.array(
        [part.spread * (both.nuisances[:, k] @ weighted) for k, part in enumerate(zones.zones)]
    )
    np.testing.assert_allclose(moved, expected)
