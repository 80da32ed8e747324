"""Nodes of p_m and amplitudes, and the curves through what is known at them."""

import math

import numpy as np
import pytest

from labsim.effects import LogNormal, Parameter
from labsim.inference.grid import interpolation_weights, smooth_weights, strength_node
from labsim.inference.nodes import nodes_around


@pytest.mark.parametrize("count", [2, 3, 4, 5, 7])
def test_a_curve_through_nodes_meets_them_in_any_order(count):
    nodes = np.array([3.0, 0.0, -1.0, 8.0, 1.0, 2.0, 5.0])[:count]
    for k, node in enumerate(nodes):
        assert smooth_weights(nodes, node) == pytest.approx(np.eye(count)[k], abs=1e-12)
    assert smooth_weights(nodes, 1.7) @ nodes == pytest.approx(1.7)


def test_up_to_four_nodes_the_curve_is_the_polynomial():
    nodes = np.array([0.0, 2.0, 1.0, 5.0])
    assert smooth_weights(nodes, 3.3) == pytest.approx(interpolation_weights(nodes, 3.3), rel=1e-14)


def test_the_curve_has_no_jumps_where_the_nearest_nodes_change():
    nodes, values = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 6.0]), np.array([0.0, 0.7, 1.2, 1.5, 1.7, 2.0])
    at = np.linspace(0.0, 6.0, 1201)
    curve = np.array([smooth_weights(nodes, x) @ values for x in at])
    assert np.abs(np.diff(curve, 2)).max() < 1e-5  # a jump of 1e-3 would show as 1e-3
    nearest = [sorted(nodes[1:], key=lambda a, x=x: abs(a - x))[:3] for x in at]
    jumping = [
        interpolation_weights(np.array([0.0, *near]), x)[1:] @ np.interp(near, nodes, values)
        for near, x in zip(nearest, at, strict=True)
    ]
    assert np.abs(np.diff(jumping, 2)).max() > 1e-3


def test_an_estimate_lies_well_among_the_nodes_around_it():
    for p_m in (310.0, 794.0, 1000.0, 1300.0, 5200.0):
        below, near, above = (strength_node(index) for index in nodes_around(math.log(p_m)))
        assert near == pytest.approx(p_m, rel=0.19)
        assert below < 0.85 * p_m < p_m < 0.85 * above
    assert nodes_around(math.log(2000.0)) == [0.5, 1.0, 1.5]


def test_an_amplitude_at_a_limit_has_a_prior():
    factor = Parameter("factor", "1", 1.0, (0.1, 6.0), LogNormal(1.0, 0.5), -0.25, "of a strength")
    amplitude = 0.1 - 1.0
    assert 1.0 + amplitude < 0.1  # by rounding
    assert factor.hold(amplitude) == 0.1
    assert factor.log_prior(factor.hold(amplitude)) > -math.inf
