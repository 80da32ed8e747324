"""A hard floor under the dust: what it does to a drop as another code says it, and that it is looked for where a tip feels it."""

import math
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import confirm_singles, diagnose_campaign
from labsim.diagnosis.screen import screen
from labsim.diagnosis.shapes import lay_out_shapes
from labsim.effects import list_effects, list_places
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import find_leading, fit_p_value
from labsim.records import Projectile
from labsim.runs.store import RunStore
from labsim.sph import DropSetting, simulate
from labsim.sph.particles import WALL_LAYERS, Z, place_particles

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "h01"
RADIUS, MASS = 1.5e-3, 2540.0 * 4.0 / 3.0 * np.pi * 1.5e-3**3
FREE = 1.6137e-3  # m, where this drop stops on the mesh without a floor
# floor below that in tip radii -> change of the depth on the Lagrangian mesh, 12 cells a radius; 18 say 3.23 and 9.49
# (python -m benchmarks.lagrangian_mesh.floor)
MESH = {0.8: -0.0059, 0.4: -0.0315, 0.2: -0.0661, 0.1: -0.0932}
FLOOR = list_effects(None)["hard_floor"]


def make_setting(cells: int) -> DropSetting:
    campaign = read_campaign(CAMPAIGN)
    return DropSetting(
        projectile=Projectile("hemisphere", RADIUS, MASS),
        impact_speed=0.5,
        material=campaign.material.replace(p_m=1300.0),
        spacing=RADIUS / cells,
        width=4 * RADIUS,
        depth=5 * RADIUS,
        monomer_density=2000.0,
        duration=8e-3,
        after_stop=0.0,
    )


@pytest.mark.parametrize("cells", [5, pytest.param(8, marks=pytest.mark.slow)])
def test_a_floor_does_what_the_mesh_says(cells: int) -> None:
    """To a fifth of it, or 0.3 % of the depth, at five spacings a radius; to 6 %, or 0.1 %, at eight."""
    base = make_setting(cells)
    place = next(iter(list_places(read_campaign(CAMPAIGN)).values()))
    free = simulate(base).penetration_depth
    for gap, expected in MESH.items():
        setting = FLOOR.apply(base, {"depth": FREE + gap * RADIUS}, place)
        change = simulate(setting).penetration_depth / free - 1.0
        assert change == pytest.approx(
            expected, rel=0.2 if cells == 5 else 0.06, abs=0.003 if cells == 5 else 0.001
        ), gap


@pytest.mark.parametrize("depth", [1.6e-3, 1.9e-3, 2.03e-3])
def test_still_layers_begin_one_spacing_above_the_floor(depth: float) -> None:
    base = make_setting(5)
    setting = FLOOR.apply(base, {"depth": depth}, next(iter(list_places(read_campaign(CAMPAIGN)).values())))
    state, wall = place_particles(setting)
    top = state[Z][wall & (state[Z] < -setting.extent[1] + WALL_LAYERS * setting.spacing)].max()
    assert -top + setting.spacing / 2 == pytest.approx(depth, abs=1e-9)
    assert 0.8 * base.spacing < setting.spacing <= base.spacing


def test_a_floor_is_looked_for_where_a_tip_feels_it(shared_store: Path) -> None:
    """Small rods do not feel it: what one group of drops does not show is no mere change of p_m, nor of the projectile."""
    problem, _ = prepare(read_campaign(CAMPAIGN), RunStore(shared_store), workers=1)
    floor = problem.effects["hard_floor"].amplitudes[0]
    deepest = max(float(drop.depth.max()) for drop in problem.drops)
    assert floor.null == pytest.approx(deepest + RADIUS, rel=0.02)
    assert floor.limits[0] < deepest < floor.null + floor.step < floor.null
    assert problem.affects_simulation("hard_floor") and not problem.rescales_p_m("hard_floor")
    assert problem.rescales_p_m("sample_drift") and not problem.acts_on_projectile("hard_floor")


def test_a_floor_that_another_code_hid_explains_all(shared_store: Path) -> None:
    """2.2 mm deep, 0.4 mm below the deepest tip. It is found to a tenth of a tip radius."""
    problem, nominal = prepare(read_campaign(CAMPAIGN), RunStore(shared_store), workers=1)
    lay_out_shapes(problem)
    screening = screen(problem, nominal, np.random.default_rng(1))
    fit = find_leading(confirm_singles(problem, nominal, screening), nominal)
    assert fit.hypothesis == ("hard_floor",)
    assert fit_p_value(nominal) < 0.01 and fit_p_value(fit) > 0.05 and fit.evidence > nominal.evidence + 20.0
    found = fit.values["hard_floor"] + problem.effects["hard_floor"].amplitudes[0].null
    assert found == pytest.approx(2.2e-3, abs=0.1 * RADIUS)
    log_p_m, sigma = fit.log_p_m, math.sqrt(fit.covariance[0, 0])
    assert abs(log_p_m - math.log(1300.0)) < 2.6 * sigma


@pytest.mark.slow
def test_and_it_is_named(shared_store: Path) -> None:
    found = diagnose_campaign(read_campaign(CAMPAIGN), RunStore(shared_store), workers=1)
    (first, probability), *_ = found.verdict.probabilities
    assert first == ("hard_floor",) and probability > 0.5
    low, high = np.quantile(found.posterior_extended.samples("p_m_Pa"), [0.005, 0.995])
    assert low < 1300.0 < high
