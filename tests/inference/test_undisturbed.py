"""Undisturbed dust and point spread of scans: expectations against exact ones, shapes found where they are shown."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.truths.phantom import Phantom
from labsim.campaign import read_campaign
from labsim.ct.reduce import reduce_scan
from labsim.diagnosis.shapes import lay_out_shapes, shape_parameter
from labsim.effects import list_effects
from labsim.inference.fits.tangents import linearise_alone
from labsim.inference.measure import Measurements, measure
from labsim.inference.observations.compacted_zone import observe_scan
from labsim.inference.observations.undisturbed import UndisturbedDust, observe_undisturbed
from labsim.inference.open_problem import open_problem
from labsim.records import Scan
from labsim.runs.store import RunStore

DEPTH = np.arange(1.6e-4, 3.3e-3, 8e-5)
NOISE = 1.5e-4


@pytest.fixture(scope="module")
def campaign():
    return read_campaign("data/campaigns/p01")


@pytest.fixture(scope="module")
def drops(campaign):
    few = replace(campaign, drops=campaign.drops[:2], scans=())
    return measure(few).drops


def make_dust(scan: Scan, level, rng, spread=1.0) -> UndisturbedDust:
    seen = level + NOISE * rng.standard_normal(DEPTH.size)
    return UndisturbedDust(scan, DEPTH, seen, np.full(DEPTH.size, NOISE), spread * scan.voxel)


def open_bench(campaign, drops, tmp_path, levels, rng, spread=1.0):
    scan = Phantom().scan(tmp_path)
    scans = tuple(replace(scan, name=f"C{k}") for k in range(len(levels)))
    dust = [make_dust(each, level, rng, spread) for each, level in zip(scans, levels, strict=True)]
    seen = Measurements(drops, dust=dust)
    with_scans = replace(campaign, scans=scans)
    return open_problem(
        with_scans, RunStore(tmp_path), list_effects(), drops=seen.drops, undisturbed=seen.dust
    )


def linearise_dust(problem, values, steps):
    return linearise_alone(problem, problem.observations[-1], values, steps)


def chi_square(block) -> float:
    return float(block.residual @ np.linalg.solve(block.covariance, block.residual))


def test_flat_dust_fits_the_nominal_model(campaign, drops, tmp_path):
    values = []
    for seed in range(20):
        problem = open_bench(campaign, drops, tmp_path, [0.15, 0.15], np.random.default_rng(seed))
        block = linearise_dust(problem, {}, {})
        values.append(chi_square(block))
    # no more than the number of data, as the errors hold more than the noise drawn here
    assert np.mean(values) < block.residual.size
    assert np.mean(values) > 0.6 * block.residual.size


def test_tangents_are_the_exact_differences(campaign, drops, tmp_path):
    problem = open_bench(campaign, drops, tmp_path, [0.15], np.random.default_rng(1))
    steps = {"surface_crust": 0.01, "density_gradient": 1.0, "filling_factor": 0.004, "ct_scale": 0.01}
    block = linearise_dust(problem, {}, steps)
    length = shape_parameter(problem.effects["surface_crust"]).null
    assert block.tangents["surface_crust"][:-1] == pytest.approx(np.exp(-DEPTH / length), rel=1e-9)
    assert block.tangents["density_gradient"][:-1] == pytest.approx(DEPTH, rel=1e-9)
    assert block.tangents["filling_factor"][:-1] == pytest.approx(np.ones(DEPTH.size), rel=1e-9)
    assert block.tangents["ct_scale"][:-1] == pytest.approx(np.full(DEPTH.size, 0.15), rel=1e-9)
    assert np.all(block.tangents["ln_p_m"] == 0)
    wide = linearise_dust(problem, {"ct_blur": 2 * problem.undisturbed[0].scan.voxel}, {})
    assert wide.residual[-1] - block.residual[-1] == pytest.approx(-math.log(3.0), rel=1e-9)


def test_the_length_of_a_crust_is_taken_from_the_scans(campaign, drops, tmp_path):
    crust = 0.15 + 0.04 * np.exp(-DEPTH / 4.1e-4)
    problem = open_bench(campaign, drops, tmp_path, [crust, crust], np.random.default_rng(2))
    stated = shape_parameter(problem.effects["surface_crust"]).null
    lay_out_shapes(problem)
    assert shape_parameter(problem.effects["surface_crust"]).null == pytest.approx(4.1e-4, rel=0.03)
    assert stated != pytest.approx(4.1e-4, rel=0.03)
    assert problem.shape_evidence["surface_crust"] < 0
    assert any(name.startswith("strength_rate@") for name in problem.effects)  # no scan shows its exponent


def test_a_flat_sample_leaves_the_length_alone(campaign, drops, tmp_path):
    problem = open_bench(campaign, drops, tmp_path, [0.15, 0.15], np.random.default_rng(3))
    stated = shape_parameter(problem.effects["surface_crust"]).null
    lay_out_shapes(problem)
    assert shape_parameter(problem.effects["surface_crust"]).null == stated
    assert "surface_crust" not in problem.shape_evidence


@pytest.mark.parametrize("blur", [0.7, 1.6])
def test_a_phantom_gives_its_filling_factor_and_its_blur(tmp_path, blur):
    phantom = Phantom(zone_width=0.8, noise=0.02, blur=blur, shape=(110, 124, 124), centre=(61.3, 60.6, 34.4))
    dust = observe_undisturbed(reduce_scan(phantom.write(tmp_path / "slices")))
    assert dust is not None and dust.depth.size > 10
    assert np.mean(dust.filling_factor) == pytest.approx(0.15, abs=3e-4)
    white = (dust.filling_factor - 0.15) / np.hypot(dust.sigma, 3e-4)
    assert np.sqrt(np.mean(white**2)) < 1.5
    assert dust.point_spread / phantom.voxel == pytest.approx(math.hypot(blur, 0.3), rel=0.25)


@pytest.mark.parametrize("blur", [1.6, 3.4])
def test_a_wide_point_spread_moves_neither_the_surface_nor_the_dust_below_it(tmp_path, blur):
    """Air that was mixed into the first rows, up to a hundredth, was called a gradient; the tip seemed 0.7 voxels deeper."""
    phantom = Phantom(
        zone_width=0.8, noise=0.02, blur=blur, shape=(130, 150, 150), centre=(61.3, 60.6, 49.4), radius=16.5
    )
    reduced = reduce_scan(phantom.write(tmp_path / "slices"))
    depth = phantom.centre[2] + phantom.radius - phantom.surface
    assert reduced.map.tip_depth / phantom.voxel == pytest.approx(depth, abs=0.05)
    dust = observe_undisturbed(reduced)
    assert dust is not None and dust.depth[0] > 3.0 * blur * phantom.voxel
    assert np.abs((dust.filling_factor - 0.15) / np.hypot(dust.sigma, 3e-4))[:3].max() < 2.0
    cells = observe_scan(reduced).cells
    assert reduced.map.z[cells.any(axis=1)].max() < -3.0 * blur * phantom.voxel
