"""The main job end to end: its numbers, its files, and that a second time costs seconds."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
AGAIN = 3.0  # processor time of the second time, over that of importing its libraries in the same minute: machines differ
TRIES = 3  # others on the machine make a time longer, never shorter: the least of so many is labsim's own
# xarray imports distributed for a posterior.nc where that is installed, as it is for tests
LIBRARIES = "import labsim.cli.demo, arviz, corner, distributed, jinja2, matplotlib.pyplot"


def run_python(arguments: list[str]) -> tuple[str, float]:
    """What it printed, and s of processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=ROOT, timeout=1500
    )
    assert done.returncode == 0, done.stderr
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run_demo(store: str, folder: Path, *options: str) -> tuple[str, float]:
    return run_python(["-m", "labsim", "demo", "-o", str(folder), "--store", store, *options])


@pytest.fixture(scope="module")
def first(shared_store: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("demo")
    return folder, run_demo(shared_store, folder)[0]


def load(folder: Path, name: str) -> dict:
    return json.loads((folder / name).read_text())


def reading(calibration: dict, use: list[str], correction: str, k0: float) -> dict:
    return next(
        r
        for r in calibration["readings"]
        if (r["use"], r["planar_correction"], r["bulk_modulus_Pa"]) == (use, correction, k0)
    )


def test_p_m_of_the_seed_is_inside_the_posterior(first: tuple[Path, str]) -> None:
    calibration = load(first[0], "calibration.json")
    assert calibration["use"] == ["depth"] and calibration["planar_correction"] == "multiply_exp"
    assert calibration["bulk_modulus_Pa"] == 300e3
    p_m = calibration["p_m_Pa"]
    assert p_m["q05"] < 1300.0 < p_m["q95"]
    assert calibration["r_hat"] < 1.05 and calibration["ess"] > 500
    # the chain and the quadrature of the same likelihood agree
    same = reading(calibration, ["depth"], "multiply_exp", 300e3)["p_m_Pa"]
    for name in ("q05", "q50", "q95"):
        assert p_m[name] == pytest.approx(same[name], rel=0.03)


def test_the_other_readings_stand_beside_it(first: tuple[Path, str]) -> None:
    calibration = load(first[0], "calibration.json")
    for k0 in (4.5e3, 300e3):
        a, none, b = (
            reading(calibration, ["depth"], name, k0)["p_m_Pa"]["q50"]
            for name in ("multiply_exp", "none", "multiply_sim")
        )
        assert a > none > b
    stop = reading(calibration, ["stopping_time"], "multiply_exp", 300e3)["p_m_Pa"]
    depth = reading(calibration, ["depth"], "multiply_exp", 300e3)["p_m_Pa"]
    assert 600.0 < stop["q50"] < 850.0
    assert stop["q95"] < depth["q05"], "depth and stopping time exclude each other"
    both = reading(calibration, ["depth", "stopping_time"], "multiply_exp", 300e3)
    assert both["misfit_chi2"] > 6.63, "no p_m fits both"


@pytest.mark.parametrize("k0", [4.5e3, 300e3])
def test_raw_depth_and_stopping_time_at_the_seed_s_p_m(first: tuple[Path, str], k0: float) -> None:
    study = next(s for s in load(first[0], "calibration.json")["spacing_study"] if s["bulk_modulus_Pa"] == k0)
    assert study["p_m_Pa"] == 1300.0 and study["artificial_viscosity"] <= 0.1
    assert study["spacings_m"] == pytest.approx([1e-4, 0.5e-4])
    (depth, fine_depth), (stop, fine_stop) = study["penetration_depth_m"], study["stopping_time_s"]
    assert 0.78e-3 < depth < 0.95e-3 and 2.2e-3 < stop < 2.8e-3
    # soft dust with so little viscosity does not settle as the spacing shrinks (docs/published-figures.md); stiff dust does
    most = {4.5e3: (0.03, 0.10), 300e3: (0.01, 0.01)}[k0]
    assert abs(fine_depth / depth - 1) < most[0] and abs(fine_stop / stop - 1) < most[1]
    # two independent planar codes gave -0.26 to -0.32; this one gives -0.30 (soft) to -0.34 (stiff)
    assert -0.35 < study["dlnD_dlnp_m"] < -0.22


def test_the_simulation_has_no_length_of_its_own(first: tuple[Path, str]) -> None:
    diagnosis = load(first[0], "diagnosis.json")
    ratio = diagnosis["stopping_time_ratio"]
    assert ratio["published"] == pytest.approx(6.2 / 3.0)
    assert ratio["equal_speed"] == pytest.approx(3.0, rel=0.01)
    assert ratio["equal_speed_exponent_of_radius"] == pytest.approx(1.0, abs=0.01)


def test_the_diagnosis_says_what_is_missed(first: tuple[Path, str]) -> None:
    folder, out = first
    diagnosis = load(folder, "diagnosis.json")
    rows = {row["figure"]: row for row in diagnosis["predictions"]}
    assert rows["D of S01"]["used"] and not rows["D of S01"]["missed"]
    assert rows["T_s, 1 mm"]["missed"] and rows["T_s, 1 mm"]["simulation"] < 3.0e-3
    for row in rows.values():
        away = (row["simulation"] - row["published"]) / np.hypot(
            row["simulation_sigma"], row["published_sigma"]
        )
        assert row["deviation_sigma"] == pytest.approx(away) and row["missed"] == (abs(away) > 2.0)
    assert diagnosis["verdict"] == "unknown" and diagnosis["p_value"] < 0.05
    assert sum(cause["probability"] for cause in diagnosis["causes"]) == pytest.approx(1.0)
    assert diagnosis["sentence"] in out and "T_s, 1 mm" in diagnosis["sentence"]


def test_every_file_is_there(first: tuple[Path, str]) -> None:
    folder, _out = first
    pictures = "penetration depth_law compacted_volume density_field corner fit".split()
    for name in [f"{picture}.png" for picture in pictures] + [
        "calibration.json",
        "diagnosis.json",
        "model.toml",
    ]:
        assert (folder / name).stat().st_size > 300
    assert "What other readings" in (folder / "summary.txt").read_text()
    page = (folder / "report.html").read_text()
    assert page.count('src="data:image/png;base64,') == 6 and page.count("src=") == 6 and "<link" not in page
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz
    posterior = arviz.from_netcdf(folder / "posterior.nc")
    p_m = load(folder, "calibration.json")["p_m_Pa"]
    assert float(np.median(posterior.posterior["p_m_Pa"])) == pytest.approx(p_m["q50"])


def test_real_soundings_come_first_and_their_cause_is_found(first: tuple[Path, str]) -> None:
    folder, out = first
    assert len(out.splitlines()) <= 25 and out.index("clay") < out.index("dust")
    found = load(folder / "clay", "diagnosis.json")
    best = found["causes"][0]
    assert found["campaign"] == "tiller" and best["causes"] == ["strength_rate"]
    assert found["inclusion_probability"]["strength_rate"] >= 0.95
    # a straight regression of ln net resistance on log10 of the speed: 0.141 a decade (benchmarks/accuracy/soundings.py)
    assert best["parameters"]["strength_rate.per_decade"]["q50"] == pytest.approx(0.141, abs=0.015)
    gain = found["gain"]
    assert gain["rms_extended"] < 0.5 * gain["rms_nominal"]
    assert gain["fraction_of_discrepancy_removed"] >= 0.8
    assert found["made_by"]["command"][-2:] == ["--case", "clay"]
    for name in "pushes misfit causes held_out posterior".split():
        assert (folder / "clay" / f"{name}.png").stat().st_size > 300


@pytest.mark.parametrize("case", ["dust", "clay"])
def test_a_second_time_takes_seconds_and_gives_the_same(
    case: str, shared_store: str, first: tuple[Path, str], tmp_path: Path
) -> None:
    """Each of the two campaigns that the demo shows, by itself."""
    importing = seconds = np.inf
    for _ in range(TRIES):
        importing = min(importing, run_python(["-c", LIBRARIES])[1])
        seconds = min(seconds, run_demo(shared_store, tmp_path, "--case", case)[1])
        print(f"{case}: {seconds:.1f} s, importing {importing:.1f} s")
        if seconds < AGAIN * importing:
            break
    assert seconds < AGAIN * importing
    folder = first[0] if case == "dust" else first[0] / case
    before, after = load(folder, "diagnosis.json"), load(tmp_path, "diagnosis.json")
    assert after["runs_new"] == 0 and after["runs_reused"] >= 40
    same = {"dust": ("predictions", "sentence", "stopping_time_ratio"), "clay": ("causes", "gain", "verdict")}
    for key in ("p_m_Pa" if case == "dust" else "cohesion_Pa", "p_value", *same[case]):
        assert after[key] == before[key]
