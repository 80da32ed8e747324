"""Extrapolation in the spacing: exact for what is linear, and a sigma that covers what is not."""

import math

import numpy as np
import pytest

from labsim.errors import SimulationError
from labsim.records import Material, Projectile
from labsim.sph import DropSetting
from labsim.sph.convergence import extrapolate, refine, simulate_spacings

RADIUS = 5e-4
BEAD = Projectile("hemisphere", RADIUS, 2540 * 4 / 3 * math.pi * RADIUS**3)
SPACINGS = [9.0, 6.0, 4.0]


def test_a_straight_line_is_extrapolated_exactly():
    limit = extrapolate(SPACINGS, [3 + 0.1 * h for h in SPACINGS])
    assert limit.value == pytest.approx(3.0)
    assert limit.order == pytest.approx(1.0)
    assert limit.sigma == pytest.approx(0.5 * 0.1 * 4)


@pytest.mark.parametrize(
    "curve", [lambda h: 3 + 0.01 * h**2, lambda h: 3 - 0.1 * h + 0.004 * h**2, lambda h: 3 + 0.05 * h**1.5]
)
def test_sigma_covers_what_is_not_a_line(curve):
    limit = extrapolate(SPACINGS, [curve(h) for h in SPACINGS])
    assert abs(limit.value - 3) < 2 * limit.sigma


def test_order_of_a_square():
    assert extrapolate(SPACINGS, [3 + 0.01 * h**2 for h in SPACINGS]).order == pytest.approx(2.0)


def test_no_order_where_values_go_to_and_fro():
    assert extrapolate(SPACINGS, [1.0, 1.1, 1.05]).order is None


@pytest.mark.parametrize(
    ("spacings", "values"), [([1.0], [2.0]), ([1.0, 2.0], [1.0, 1.0]), ([2.0, 1.0], [1.0])]
)
def test_extrapolation_refuses(spacings, values):
    with pytest.raises(SimulationError, match="falling spacings"):
        extrapolate(spacings, values)


def test_spacings_begin_with_the_stated_one_and_fall_by_root_two():
    setting = DropSetting(BEAD, 0.66, Material(), spacing=RADIUS / 5)
    spacings = [each.spacing for each in refine(setting, 3)]
    assert spacings == pytest.approx([RADIUS / 5, RADIUS / 5 / 2**0.5, RADIUS / 10])
    with pytest.raises(SimulationError, match="at least 2"):
        refine(setting, 1)


def test_three_spacings_of_a_drop():
    """The limit agrees with an independent material-point solver of the same equations (0.7012 mm, 1.77 ms)."""
    setting = DropSetting(BEAD, 0.66, Material(), spacing=RADIUS / 5)
    converged = simulate_spacings(setting)
    ratios = np.divide([run.setting.spacing for run in converged.runs], setting.spacing)
    np.testing.assert_allclose(ratios, [1.0, 2**-0.5, 0.5])
    assert converged.finest is converged.runs[-1]
    depth, time, volume = converged.penetration_depth, converged.stopping_time, converged.compacted_volume
    for name, quantity in (("D", depth), ("T_s", time), ("V", volume)):
        print(
            f"{name} {quantity.values} -> {quantity.value:.5g} ± {quantity.sigma:.2g}, order {quantity.order}"
        )
    assert depth.values[-1] == converged.finest.penetration_depth
    assert depth.value == pytest.approx(0.7012e-3, abs=0.015 * 0.7012e-3 + 2 * depth.sigma)
    assert time.value == pytest.approx(1.77e-3, abs=0.02 * 1.77e-3 + 2 * time.sigma)
    assert 0 < depth.sigma < 0.03 * depth.value
    assert volume.value > 0


def test_a_projectile_that_the_coarsest_does_not_resolve():
    with pytest.raises(SimulationError, match="does not resolve"):
        simulate_spacings(DropSetting(BEAD, 0.66, Material(), spacing=RADIUS / 3))
    with pytest.raises(SimulationError, match="at least 2"):
        simulate_spacings(DropSetting(BEAD, 0.66, Material(), spacing=RADIUS / 8), count=1)
