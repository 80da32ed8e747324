"""A strength is what the nominal fit leaves: nothing of a nominal truth at the fit's own spacing, more the more is hidden."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from benchmarks.truths import strength
from benchmarks.truths.measured import QUIET, measure_hidden
from benchmarks.truths.strength import StrengthCount, hide
from benchmarks.truths.table import Hidden, TruthTable
from labsim.campaign import read_campaign
from labsim.runs.store import RunStore

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "p01"


@pytest.fixture(scope="module")
def count(tmp_path_factory):
    campaign = read_campaign(CAMPAIGN)
    drops = tuple(drop for drop in campaign.drops if drop.name in ("D05", "D06"))
    campaign = replace(campaign, drops=drops, scans=())
    store = RunStore(tmp_path_factory.mktemp("runs"))
    truth = TruthTable(campaign, store, workers=1, cells=(5, 8))
    truth.prepare([])
    return StrengthCount(campaign, store, truth)


def test_a_quiet_laboratory_adds_nothing(count):
    first, second = (
        measure_hidden(count.truth, Hidden(), np.random.default_rng(seed), laboratory=QUIET)
        for seed in (1, 2)
    )
    for one, other in zip(first.drops, second.drops, strict=True):
        assert np.array_equal(one.depth, other.depth)
        assert one.rejected == 0
        assert one.contact_time == pytest.approx(3.5e-3, abs=1e-5)


def test_a_nominal_truth_at_the_same_spacing_leaves_nothing(count):
    assert count.measure(Hidden()) == 0.0
    assert math.sqrt(count.reference) < 1.0


def test_strength_grows_with_the_amplitude(count):
    effect = count.truth.effect("pixel_scale")
    strengths = [count.measure(hide(effect, amplitude)) for amplitude in (0.01, 0.02, 0.04, 0.08)]
    assert strengths[0] > 0.5
    assert all(low < high for low, high in pairwise(strengths))


def test_the_amplitude_found_is_as_strong_as_wanted(count):
    effect = count.truth.effect("pixel_scale")
    for side in (1, -1):
        found = count.find(effect, side, [2.0, 4.0]).found
        for sigma, each in found.items():
            assert each.strength == pytest.approx(sigma, rel=0.03)
            assert count.measure(each.hidden) == pytest.approx(sigma, rel=0.03)
        assert len(found) == 2


def test_a_side_beyond_the_limits_is_left_out(count):
    search = count.find(count.truth.effect("side_friction"), -1, [4.0])
    assert search.found == {} and search.most == 0.0


class Uneven(StrengthCount):
    """Ten standard deviations per unit where runs are interpolated, five where they are made."""

    def measure(self, hidden):
        return 10.0 * hidden.effects["strength_rate"]["eta"]

    def simulate(self, effect, amplitude):
        return 5.0 * amplitude


def test_what_does_not_follow_its_amplitude_is_not_found(count):
    uneven = Uneven(count.campaign, count.store, count.truth)
    effect = count.truth.effect("strength_rate")
    assert uneven._search(effect, {0.2: 2.0, 0.8: 8.0}, 4.0) is None
    uneven.simulate = lambda effect, amplitude: 10.0 * amplitude
    assert uneven._search(effect, {0.2: 2.0, 0.8: 8.0}, 4.0).strength == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(("room", "stopped"), [(strength.ROOM, False), (1.0, True)])
def test_dust_softer_than_the_range_says_is_not_counted(count, monkeypatch, room, stopped):
    """What p_m makes up for leaves nothing, wherever its stated range ends; within the range alone it would."""
    monkeypatch.setattr(strength, "ROOM", room)
    narrow = StrengthCount(
        replace(count.campaign, p_m_range=(1800.0, 6000.0)), count.store, count.truth, reference=0.0
    )
    assert (narrow.measure(Hidden()) > 5.0) == stopped
