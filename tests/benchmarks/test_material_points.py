"""The material points of benchmarks/ against another material-point solver, and what each hidden term does to a drop."""

import numpy as np
import pytest

from benchmarks.material_points.drop import (
    SOLID,
    Body,
    Dust,
    Numerics,
    extrapolate_drop,
    lay_points,
    run_drop,
    step,
)
from benchmarks.material_points.dust import tabulate_strengths

SPEED = 0.20  # m/s
COARSE = Numerics(cells=5)


@pytest.fixture(scope="module")
def nominal() -> float:
    return run_drop(Dust(), Body(), SPEED, COARSE).stopping_depth


def test_the_limit_of_no_cell_size_is_that_of_another_solver():
    found = extrapolate_drop(Dust(), Body(), SPEED, Numerics(own=0.98))
    # data/reference/independent_stops.csv, good to 1 % in depth and 1.5 % in time
    assert found.stopping_depth == pytest.approx(0.217e-3, rel=0.015)
    assert found.stopping_time == pytest.approx(1.628e-3, rel=0.025)


def test_points_hold_the_mass_of_the_dust_and_bear_its_weight():
    dust = Dust()
    h, wide, deep = 1e-4, 20, 30
    tables = tabulate_strengths(dust.p_m, dust.phi_1, dust.phi_2, dust.delta, dust.tensile_factor)
    points = lay_points(dust, h, (8, 10), (wide, deep), 2, tables)
    whole = np.pi * (wide * h) ** 2 * deep * h * dust.filling_factor * SOLID
    assert points[:, step.MASS].sum() == pytest.approx(whole, rel=1e-12)
    weight = dust.filling_factor * SOLID * 9.81 * -points[:, step.Z]
    assert points[:, step.PRESSURE] == pytest.approx(weight, rel=1e-12)


@pytest.mark.parametrize(
    ("dust", "body"),
    [
        (Dust(), Body(pull=2e-5)),
        (Dust(), Body(side=0.02)),
        (Dust(), Body(shaft_drag=5.0)),
        (Dust(eta=0.3), Body()),
        (Dust(shear_factor=2.0), Body()),
        (Dust(gas_pressure=2e3), Body()),
        (Dust(crust=(0.05, 2e-4)), Body()),
        (Dust(interface=(0.15e-3, 0.1e-3, 2.0)), Body()),
    ],
    ids=["pull", "side", "shaft", "rate", "shear", "gas", "crust", "layer"],
)
def test_what_resists_holds_a_drop_back(dust, body, nominal):
    assert run_drop(dust, body, SPEED, COARSE).stopping_depth < 0.995 * nominal


@pytest.mark.parametrize(
    ("dust", "body"),
    [(Dust(weakening=0.5), Body()), (Dust(shear_factor=0.5), Body()), (Dust(), Body(accreted=0.5))],
    ids=["weakening", "shear", "mass"],
)
def test_what_gives_way_lets_it_go_deeper(dust, body, nominal):
    assert run_drop(dust, body, SPEED, COARSE).stopping_depth > 1.005 * nominal
