"""Drops share runs where everything that a simulation takes from their projectiles is the same, whatever fields that is."""

from dataclasses import dataclass, replace

import pytest

from labsim.errors import InferenceError
from labsim.inference.grid import Family
from labsim.inference.workbench import find_family
from labsim.records import Projectile


@dataclass(frozen=True)
class Cone(Projectile):
    """What somebody may add."""

    half_angle: float = 0.5


def test_a_new_field_of_a_projectile_tells_families_apart():
    blunt = Cone("hemisphere", 5e-4, 1e-6, mass_sigma=1e-9, length=4e-3, half_angle=0.9)
    sharp = replace(blunt, half_angle=0.3)
    families = [Family(each.simulated, (0.1, 0.2, 0.3), False, (0, 1, 2)) for each in (blunt, sharp)]
    assert [find_family(families, each, is_scan=False) for each in (blunt, sharp)] == [0, 1]
    assert families[1].projectile.half_angle == 0.3
    with pytest.raises(InferenceError, match="has no runs"):
        find_family(families, sharp, is_scan=True)
    with pytest.raises(InferenceError, match="has no runs"):
        find_family(families, replace(sharp, half_angle=0.31), is_scan=False)


def test_what_no_simulation_depends_on_does_not():
    rod = Projectile("hemisphere", 5e-4, 1e-6, mass_sigma=1e-9, length=4e-3)
    families = [Family(rod.simulated, (0.1, 0.2, 0.3), False, (0, 1, 2))]
    assert rod.simulated == Projectile("hemisphere", 5e-4, 1e-6)
    assert find_family(families, replace(rod, mass_sigma=0.0, length=1e-2), is_scan=False) == 0
