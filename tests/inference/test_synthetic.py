"""Two hidden effects at once: both are in what was filmed, and only what costs runs is simulated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.truths.measured import QUIET, measure_hidden
from benchmarks.truths.table import Hidden, TruthTable
from labsim.campaign import read_campaign, read_scan
from labsim.ct.reduce import reduce_scan
from labsim.errors import SimulationError
from labsim.inference.emulation.curves import extract_curve
from labsim.inference.observations.compacted_zone import see_dust
from labsim.sph import simulate

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "p01"
FRICTION, PIXELS = {"contact_friction": {"mu": 0.5}}, {"pixel_scale": {"factor": 1.05}}


class TwoRuns:
    """Stands for a store: one run with friction, one without, whatever else is asked for."""

    def __init__(self):
        self.settings, self.runs = [], {}

    def get_many(self, settings, **_):
        self.settings += settings
        for setting in settings:
            friction = setting.material.contact_friction
            if friction not in self.runs:
                spacing = setting.projectile.tip_radius / 4
                self.runs[friction] = simulate(setting.replace(spacing=spacing, impact_speed=0.3))
        return [self.runs[setting.material.contact_friction] for setting in settings]


@pytest.fixture(scope="module")
def truth():
    campaign = read_campaign(CAMPAIGN)
    table = TruthTable(replace(campaign, drops=campaign.drops[:1], scans=()), TwoRuns())
    table.prepare([Hidden({**PIXELS, **FRICTION}), Hidden(PIXELS), Hidden(FRICTION)])
    return table


def film(truth, hidden):
    return measure_hidden(truth, hidden, np.random.default_rng(11), scans=0).drops[0]


def test_a_pair_is_named_in_one_order():
    assert Hidden().cause == "none"
    assert Hidden({**PIXELS, **FRICTION}).cause == Hidden({**FRICTION, **PIXELS}).cause


def test_a_pair_has_the_runs_of_the_one_that_costs_runs(truth):
    frictions = [setting.material.contact_friction for setting in truth.store.settings]
    nodes = len(frictions) // 5  # three strengths without, two with it, once for pair and single
    assert frictions == 3 * nodes * [0.0] + 2 * nodes * [0.5]
    drop = truth.campaign.drops[0]
    plain, rough = (extract_curve(truth.store.runs[mu]) for mu in (0.0, 0.5))
    assert abs(rough[0] - plain[0]) > 0.02  # of ln depth: the friction is felt
    for effects, expected in (({**PIXELS, **FRICTION}, rough), (FRICTION, rough), (PIXELS, plain)):
        features = truth.features(Hidden(effects), drop.projectile, np.log(1300.0), np.log(0.3))
        assert features == pytest.approx(expected, abs=1e-9)


def test_both_of_a_pair_are_in_the_film(truth):
    both, rough, scaled = (film(truth, Hidden(e)) for e in ({**PIXELS, **FRICTION}, FRICTION, PIXELS))
    noise = 0.1 * both.drop.camera.pixel_size  # of the row of the surface and of the deepest frame
    assert both.depth.max() == pytest.approx(rough.depth.max() / 1.05, abs=noise)
    assert both.depth.max() < scaled.depth.max() - 5 * noise


def test_what_was_not_simulated_is_between_what_was(truth):
    projectile, place = truth.campaign.drops[0].projectile, (np.log(1300.0), np.log(0.3))
    plain, half, rough = (
        truth.features(Hidden({"contact_friction": {"mu": mu}}), projectile, *place)
        for mu in (0.0, 0.25, 0.5)
    )
    assert half == pytest.approx((plain + rough) / 2, abs=1e-9)
    with pytest.raises(SimulationError, match="has no runs that far"):
        truth.features(Hidden({"contact_friction": {"mu": 0.6}}), projectile, *place)
    kept = truth.holding(Hidden(FRICTION))
    assert np.array_equal(kept.features(Hidden(FRICTION), projectile, *place), rough)
    with pytest.raises(SimulationError):
        truth.holding(Hidden(PIXELS)).features(Hidden(FRICTION), projectile, *place)


def test_a_blurred_map_says_how_wide_its_point_spread_is():
    """Without noise, the run that a truth is made of leaves nothing of its map: seen through the point spread the map states."""
    labelled = CAMPAIGN.parents[1] / "ct" / "labelled_scans" / "p01-C01"
    campaign = read_campaign(CAMPAIGN)
    scan = replace(read_scan(labelled), name="C01")
    template = reduce_scan(scan, sample_filling_factor=campaign.sample.filling_factor)
    runs = TwoRuns()
    table = TruthTable(
        replace(campaign, drops=campaign.drops[:1], scans=(scan,)), runs, templates=(template,)
    )
    hidden = Hidden({"ct_blur": {"sigma": 1.5e-4}})
    table.prepare([Hidden(), hidden])
    for truth, spread in (
        (Hidden(), template.point_spread),
        (hidden, template.point_spread + 1.5e-4),
    ):
        (found,) = measure_hidden(table, truth, np.random.default_rng(2), laboratory=QUIET).reduced
        assert found.point_spread == pytest.approx(spread)
        seen = see_dust(runs.runs[0.0], found.map, found.point_spread)
        assert seen[found.usable] == pytest.approx(found.map.filling_factor[found.usable], abs=1e-12)
