"""Nodes of p_m and amplitudes, and the curves through what is known at them."""

import math
from types import MethodType, SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.unlisted.hats import make_effect
from labsim.effects import HalfNormal, LogNormal, Normal, Parameter, Uniform, list_effects
from labsim.effects.terms import list_terms
from labsim.inference.calibrate import warn_of_range
from labsim.inference.emulation.forward import ResponseTable
from labsim.inference.emulation.grid import (
    FELT_STEPS,
    SAME_SPEED,
    enclosing_weights,
    interpolation_weights,
    own_speeds,
    smooth_weights,
    strength_node,
)
from labsim.inference.emulation.nodes import amplitude_nodes, hold_known, is_farthest, nodes_around
from labsim.inference.problem import Problem


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


def test_runs_farther_off_change_nothing_between_the_enclosing_nodes():
    near, far = [0.0, 1.0, -1.0, 2.0], [0.0, 3.0, 1.0, -3.0, -1.0, 2.0, -2.0]
    values = {node: math.exp(-0.3 * node) + 0.01 * math.sin(5 * node) for node in far}

    def curve(nodes, at):
        return enclosing_weights(nodes, at) @ [values[node] for node in nodes]

    for at in (0.0, 0.3, 0.99, 1.0):
        assert curve(near, at) == pytest.approx(curve(far, at), rel=1e-14)
    for node in far:  # through every node, and no jump where the four are others
        assert curve(far, node) == pytest.approx(values[node], rel=1e-12)
        assert curve(far, node - 1e-9) == pytest.approx(curve(far, node + 1e-9), abs=1e-8)
    assert curve([0.0, 1.0], 0.5) == pytest.approx(0.5 * (values[0.0] + values[1.0]))


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


FACTOR = Parameter("factor", "1", 1.0, (0.05, 20.0), LogNormal(1.0, 0.6), 0.5, "of a strength")


def test_what_is_positive_counts_by_its_ratio_to_null():
    assert FACTOR.grade(-0.5) - FACTOR.grade(-0.75) == pytest.approx(math.log(2.0))
    plain = Parameter("mu", "1", 0.0, (0.0, 2.0), HalfNormal(0.3), 0.15, "friction")
    from_nothing = Parameter("factor", "1", 0.0, (0.0, 6.0), LogNormal(1.0, 0.5), 0.25, "null is a zero")
    for parameter in (FACTOR, plain, from_nothing):
        for amplitude in (0.0, 0.15, 1.2):
            assert parameter.amplitude_at(parameter.grade(amplitude)) == pytest.approx(amplitude, rel=1e-14)
    assert plain.grade(0.7) == from_nothing.grade(0.7) == 0.7
    assert FACTOR.grade(0.0) == 0.0


def test_what_does_nothing_near_its_null_counts_by_what_it_does():
    """A floor 0.6 mm higher than where it is felt first; e times as much every 0.25 mm from there."""
    floor = Parameter(
        "depth", "m", 3e-3, (1e-3, 3e-3), Uniform(1e-3, 3e-3), -6e-4, "of a hard bottom", fades=2.5e-4
    )
    for amplitude in (0.0, -1e-4, -6e-4, -2e-3):
        assert floor.amplitude_at(floor.grade(amplitude)) == pytest.approx(amplitude, rel=1e-12)
    done = [1.0 - floor.grade(amplitude) / floor.fades for amplitude in (-8e-4, -1.05e-3, -1.3e-3)]
    assert done[1] / done[0] == pytest.approx(math.e) and done[2] / done[1] == pytest.approx(math.e)
    assert floor.difference(0.0) == floor.step  # a tangent over a twentieth of it would see next to nothing
    assert floor.grade(floor.difference(-6e-4) - 6e-4) == pytest.approx(1.05 * floor.grade(floor.step))
    assert floor.stretch(4.0) == floor


@pytest.mark.parametrize("value", [0.051, 0.07, 0.125, 0.3, 0.6, 1.7, 5.0, 19.0])
def test_a_small_factor_lies_between_near_ones(value):
    """A factor of 0.125 used to lie between runs at 0.5 and 0.05, where the depth was off by 14 to 23 %."""
    tensile = list_effects(None)["tensile_strength"]
    nodes = amplitude_nodes(tensile, value - 1.0, around=True)
    simulated = np.sort([1.0, *(1.0 + amplitude for amplitude in nodes)])
    above = int(np.searchsorted(simulated, value))
    assert 0 < above < simulated.size
    assert simulated[above] / simulated[above - 1] < 2.26


def test_a_small_amplitude_beside_rough_runs_lies_on_a_curve():
    """On the line from nothing to 0.08, where accelerometers' steps end, a crust of 0.015 is off by a tenth of itself."""
    crust = SimpleNamespace(
        amplitudes=(Parameter("x", "1", 0.0, (-0.03, 1.0), Normal(0.0, 0.1), 0.08, "x"),), kind="material"
    )
    assert amplitude_nodes(crust, 0.015) == pytest.approx([0.08])
    assert amplitude_nodes(crust, 0.015, bent=True) == pytest.approx([0.04, 0.02])
    assert amplitude_nodes(crust, -0.01, bent=True) == pytest.approx([-0.03, -0.02])
    assert amplitude_nodes(crust, 0.1, bent=True) == pytest.approx([0.08, 0.12])
    assert amplitude_nodes(crust, 0.1) == pytest.approx([0.08, 0.16])


@pytest.mark.parametrize("factor", [0.4, 0.52, 0.62, 0.8])
def test_a_factor_beside_rough_runs_lies_within_a_third_of_the_next(factor):
    """Between 1 and 0.56 a shear factor of 0.62 was off by 0.3 % of the stopping time and 0.7 % of the force."""
    shear = list_effects(None)["shear_strength"].stretch(FELT_STEPS)
    simulated = np.sort(
        [
            1.0,
            *(1.0 + amplitude for amplitude in amplitude_nodes(shear, factor - 1.0, around=True, bent=True)),
        ]
    )
    above = int(np.searchsorted(simulated, factor))
    assert 0 < above < simulated.size
    assert simulated[above] / simulated[above - 1] < 1.34


def test_a_fingerprint_lies_at_the_step_whatever_its_sign():
    weaker = Parameter("factor", "1", 1.0, (0.1, 6.0), LogNormal(1.0, 0.5), -0.25, "of a strength")
    for parameter in (weaker, FACTOR):
        effect = SimpleNamespace(amplitudes=(parameter,), kind="material")
        assert amplitude_nodes(effect, 0.0) == pytest.approx([parameter.step])
        (other,) = amplitude_nodes(effect, 0.0, side=-1.0)
        assert other * parameter.step < 0.0
        nodes = amplitude_nodes(effect, 0.0, bent=True)
        assert all(node * parameter.step > 0.0 for node in nodes)


def test_where_runs_of_one_side_fail_a_fingerprint_lies_on_the_other():
    """A heavy projectile fell through dust of a third of the shear strength, and the verdict did not know of this cause."""
    tables = [ResponseTable(np.log([0.3, 0.4]), (0, 1)) for _ in range(2)]
    asked = []

    def require_changes(wanted, text, *, sparse):
        assert sparse
        for name, amplitude, index in wanted:
            asked.append((name, np.sign(amplitude)))
            for k, table in enumerate(tables):
                entry = table.fingerprints.setdefault(name, {}).setdefault(index, {})
                if name == "tensile_strength" or amplitude > 0.0 or k == 0:
                    entry[amplitude] = np.zeros((2, 3))

    problem = SimpleNamespace(
        effects=list_effects(None),
        features=[SimpleNamespace(table=table) for table in tables],
        require_base_about=lambda log_p_m: None,
        require_changes=require_changes,
    )
    problem._has_fingerprint = MethodType(Problem._has_fingerprint, problem)
    problem._find = lambda name: problem.effects[name]
    Problem.require_fingerprints(problem, ["shear_strength", "tensile_strength"], math.log(340.0), "causes")
    steps = {
        n: np.sign(problem.effects[n].amplitudes[0].step) for n in ("shear_strength", "tensile_strength")
    }
    assert steps["shear_strength"] < 0.0
    assert asked == [*steps.items(), ("shear_strength", 1.0)]
    assert all(any(table.fingerprints["shear_strength"].values()) for table in tables)


@pytest.mark.parametrize(
    ("speeds", "count"),
    [([0.3], 2), ([0.3, 0.31], 2), ([0.23, 0.314, 0.487], 3), ([0.2, 0.21, 0.4, 0.401], 2)],
)
def test_a_felt_drop_is_simulated_at_its_own_speed_or_between_near_ones(speeds, count):
    nodes = own_speeds(speeds)
    assert list(nodes) == sorted(set(nodes)) and len(nodes) == count
    for speed in speeds:
        assert min(abs(math.log(speed / node)) for node in nodes) < math.log(SAME_SPEED) + 0.005


def test_many_felt_drops_share_a_grid_of_speeds():
    speeds = np.geomspace(0.2, 0.8, 9)
    nodes = own_speeds(speeds)
    assert nodes[0] <= speeds[0] and speeds[-1] <= nodes[-1] and len(nodes) < speeds.size
    assert own_speeds(1.001 * speeds) == nodes


def test_a_step_that_doubles_a_strength_is_not_made_longer():
    """Four such steps make it fourteen times as strong; halfway there a line is off by 3 % of the largest force."""
    eta = list_effects(None)["strength_rate"].amplitudes[0]
    assert eta.stretch(4.0) == eta
    assert FACTOR.stretch(2.0).step == pytest.approx(1.5**2 - 1.0)


@pytest.mark.parametrize("name", ["shear_strength", "pore_gas", "surface_crust", "strength_rate"])
@pytest.mark.parametrize("sparse", [False, True])
def test_no_amplitude_lies_beyond_the_largest_that_runs_are_made_of(name, sparse):
    effect = list_effects(None)[name]
    parameter = effect.amplitudes[0]
    unit = abs(parameter.grade(parameter.step))
    for asked in (1e9, -1e9, 60 * parameter.step, -60 * parameter.step, 0.4 * parameter.step):
        held = hold_known(effect, asked, sparse=sparse)
        assert parameter.hold(held) == pytest.approx(parameter.null + held)
        assert abs(parameter.grade(held)) <= (8 if sparse else 12) * unit * (1 + 1e-12)
        # the farthest node lies at it or beyond
        nodes = [abs(parameter.grade(each)) for each in amplitude_nodes(effect, held, sparse=sparse)]
        assert max(nodes) >= abs(parameter.grade(held)) * (1 - 1e-9)
        if asked == 0.4 * parameter.step:
            assert held == pytest.approx(asked)


def test_a_law_many_times_its_usual_size_lies_between_runs():
    """In p12 half of the tip's mass sticks to it in every radius of depth, 33 steps of that law: a ladder that ended at 12 called
    0.18 ± 0.007 the size."""
    effect = make_effect(list_terms()["stuck_mass"], 0.05)
    step = effect.amplitudes[0].step
    assert 30.0 < 0.5 / step < 36.0
    assert hold_known(effect, 0.5) == 0.5
    near, far = sorted(amplitude_nodes(effect, 0.5))
    assert near < 0.5 < far < 2.0 * near
    assert not is_farthest(effect, 0.5)
    assert is_farthest(effect, hold_known(effect, 100.0))
    assert not is_farthest(effect, 0.0)


def test_a_limit_of_the_parameter_is_not_the_end_of_the_runs():
    friction = list_effects(None)["contact_friction"]
    assert not is_farthest(friction, friction.amplitudes[0].limits[1])


def test_a_fit_that_ends_where_runs_end_says_so():
    effect = make_effect(list_terms()["stuck_mass"], 0.05)
    problem = SimpleNamespace(
        campaign=SimpleNamespace(p_m_range=(300.0, 6000.0)),
        effects={"stuck_mass": effect},
        affects_simulation=lambda name: True,
    )
    for value, said in ((0.5, []), (hold_known(effect, 100.0), ["stuck_mass is at the largest value"])):
        fit = SimpleNamespace(log_p_m=7.0, covariance=1e-3 * np.eye(2), values={"stuck_mass": value})
        assert [line[:34] for line in warn_of_range(problem, fit)] == said
