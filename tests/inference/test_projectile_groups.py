"""Drops share runs where everything that a simulation takes from their projectiles is the same, whatever fields that is."""

from dataclasses import dataclass, replace

import laws

from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.open_problem import group_alike
from labsim.records import Projectile


@dataclass(frozen=True)
class Cone(Projectile):
    """What somebody may add."""

    half_angle: float = 0.5


def test_a_new_field_of_a_projectile_tells_families_apart():
    blunt = Cone("hemisphere", 5e-4, 1e-6, mass_sigma=1e-9, length=4e-3, half_angle=0.9)
    sharp = replace(blunt, half_angle=0.3)
    groups = group_alike([(blunt, "blunt"), (sharp, "sharp")])
    assert list(groups.values()) == [["blunt"], ["sharp"]]
    assert list(groups)[1].half_angle == 0.3
    assert replace(sharp, half_angle=0.31).simulated not in groups


def test_what_no_simulation_depends_on_does_not():
    rod = Projectile("hemisphere", 5e-4, 1e-6, mass_sigma=1e-9, length=4e-3)
    assert rod.simulated == Projectile("hemisphere", 5e-4, 1e-6)
    assert list(group_alike([(rod, 1), (replace(rod, mass_sigma=0.0, length=1e-2), 2)]).values()) == [[1, 2]]


def test_drops_and_scans_of_one_size_have_runs_of_their_own(tmp_path):
    campaign = read_campaign(laws.write_campaign(tmp_path / "made", scan=True))
    problem, _ = prepare(campaign, laws.LawStore(tmp_path / "store"), workers=1)
    groups = {seen.kind: [each.group for each in seen.features] for seen in problem.observations}
    assert groups["drops"] == [0, 1, 2] and groups["map"] == [3]
    assert set(groups["rebounds"]) <= {0, 1, 2}
    assert [group.is_scan for group in problem.groups] == [False, False, False, True]
