"""Faults of a scan whose truth is known: measured right, or within error bars that were widened, or named."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from labsim.ct import reduce_scan

SOURCE = Path(__file__).parents[2] / "benchmarks" / "faults" / "scans.py"
spec = importlib.util.spec_from_file_location("fault_scans", SOURCE)
fault_scans = importlib.util.module_from_spec(spec)
sys.modules["fault_scans"] = fault_scans
spec.loader.exec_module(fault_scans)
CASES = {case.name: case for case in fault_scans.PHANTOMS}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Function: case, seed -> (chi2 of the zone's cells, tip off by m, warnings, reduced scan), each made once."""
    made = {}

    def make(name, seed=0):
        if (name, seed) not in made:
            phantom, grey = fault_scans.render(CASES[name], seed)
            reduced = reduce_scan(phantom.write(tmp_path_factory.mktemp("case") / "slices", grey=grey))
            m = reduced.map
            truth = phantom.truth(m.r, m.z)
            zone = np.isfinite(m.filling_factor) & (m.count >= 50) & (m.z < -4 * phantom.voxel)[:, None]
            zone &= truth - phantom.filling_factor > fault_scans.ZONE
            chi2 = float(np.mean(((m.filling_factor - truth)[zone] / m.sigma[zone]) ** 2))
            depth = (phantom.centre[2] + phantom.radius - phantom.surface) * phantom.voxel
            made[name, seed] = chi2, m.tip_depth - depth, m.warnings, reduced
        return made[name, seed]

    return make


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", ["clean", "clean 8 bit"])
def test_a_clean_scan_is_silent_and_honest(measured, name, seed):
    chi2, tip, warnings, _ = measured(name, seed)
    assert warnings == ()
    assert 0.8 <= chi2 <= 1.2
    assert abs(tip) < 4e-6


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("cupping -15 %", 1.5),
        ("cupping -40 %", 1.5),
        ("rings, one in seven, 0.03", 1.5),
        ("rings at every radius, 0.02", 1.5),
        ("rings at every radius, each slice its own, 0.02", 3.0),
        ("dark streak through the bead 30 %", 1.5),
        ("whole sample leans 2 degrees", 1.5),
        ("whole sample leans 5 degrees", 1.5),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_measured_right_or_within_wider_error_bars(measured, name, most, seed):
    chi2, tip, warnings, _ = measured(name, seed)
    assert chi2 <= most
    assert abs(tip) < 8e-6
    assert warnings  # what was taken off or followed is said


@pytest.mark.parametrize("seed", [0, 1])
def test_the_depth_of_a_leaning_sample_is_counted_along_its_normal(measured, seed):
    for degrees in (2, 5):
        _, tip, warnings, reduced = measured(f"whole sample leans {degrees} degrees", seed)
        assert abs(tip) < 4e-6  # 66 um along the vertical, at 5 degrees
        assert np.rad2deg(np.arctan(reduced.surface.tilt)) == pytest.approx(degrees, abs=0.2)
        assert any("counted along its normal" in text for text in warnings)


@pytest.mark.parametrize("seed", [0, 1])
def test_shared_rings_make_no_lean(measured, seed):
    for name in ("rings, one in seven, 0.03", "rings at every radius, 0.02"):
        assert not measured(name, seed)[3].tilt_followed


def test_strong_cupping_says_that_the_level_is_less_sure(measured):
    assert "level about the bead is only as sure" in "; ".join(measured("cupping -40 %")[2])
    assert "level about the bead" not in "; ".join(measured("cupping -15 %")[2])


@pytest.mark.parametrize(
    ("name", "most", "words"),
    [
        ("missing wedge 30 degrees", 8.0, "opposite sectors agree and others do not"),
        ("dark halo about the bead 20 %", 5.0, "dark halo about the bead"),
        ("slices 1.2 times the pixel apart", 100.0, r"slices lie 1\.(19|20|18)\d pixels apart"),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_what_cannot_be_put_right_is_named(measured, name, most, words, seed):
    import re

    chi2, _, warnings, _ = measured(name, seed)
    assert re.search(words, "; ".join(warnings)), warnings
    assert chi2 <= most


def test_a_zone_that_is_not_round_is_no_artefact_of_the_scanner(measured):
    assert not any("opposite sectors" in text for text in measured("zone leans 5 degrees")[2])
