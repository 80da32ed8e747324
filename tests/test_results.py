"""What commands wrote is read again: short in a cell, whole as summary, table, grid and picture."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import laws
import matplotlib.pyplot as plt
import numpy as np
import pytest

import labsim
from labsim.inference.calibrate import calibrate

DATA = Path(__file__).parents[1] / "data"


def command(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "labsim", *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def calibrated(place: Path):
    campaign = labsim.read_campaign(laws.write_campaign(place / "campaign"))
    return calibrate(campaign, store=laws.LawStore(place / "store"))


def test_a_track_is_read_again(place: Path):
    said = command(place, "track", str(labsim.example("p06") / "drops/D03"), "-o", "one")
    found = labsim.load(place / "one")
    assert found.kind == "track" and found.summary() == said.rstrip()
    assert len(repr(found)) < 300 and "mm deep" in repr(found) and "<pre>" in found._repr_html_()
    table = found.to_dataframe()
    assert table["depth_m"].max() == pytest.approx(found.data["penetration_depth_m"], rel=0.02)
    figure, ax = plt.subplots()
    assert found.plot_curve(ax) is ax and ax.yaxis_inverted()
    assert ax.get_xlabel() == "time since contact (ms)"
    assert np.allclose(ax.lines[0].get_ydata(), 1e3 * table["depth_m"])
    plt.close(figure)
    with pytest.raises(labsim.LabsimError, match="no map; a scan has"):
        found.plot_map()
    with pytest.raises(labsim.LabsimError, match="no grid"):
        found.to_xarray()


def test_a_scan_is_read_again(place: Path):
    command(place, "ct", str(DATA / "ct/labelled_scans/p05-C02"), "-o", "scan", "-q")
    found = labsim.load(place / "scan")
    assert found.to_xarray()["phi"].dims == ("z", "r")
    assert list(found.to_dataframe().columns) == ["phi", "volume_m3", "sigma"]
    figure, ax = plt.subplots()
    assert found.plot_map(ax) is ax and "(mm)" in ax.get_ylabel()
    plt.close(figure)
    assert found.summary()


def test_a_calibration_from_python_is_written_and_read(place: Path, calibrated):
    assert len(repr(calibrated)) < 200 and "kPa" in repr(calibrated) and len(repr(calibrated.posterior)) < 200
    folder = labsim.write_report(calibrated, place / "calibration")
    assert (folder / "report.html").is_file()
    found = labsim.load(folder)
    draws = found.to_dataframe()
    assert found.kind == "calibration" and "p_m = " in repr(found) and found.summary().count("\n") >= 3
    assert draws["p_m_Pa"].mean() == pytest.approx(found.data["p_m_Pa"]["mean"])
    figure, ax = plt.subplots()
    found.plot_posterior(ax=ax)
    assert ax.get_xlabel() == "$p_\\mathrm{m}$ (kPa)"
    plt.close(figure)
    with pytest.raises(labsim.LabsimError, match="choose one of p_m_Pa"):
        found.plot_posterior("p_n")


def test_a_folder_without_a_result_is_refused(tmp_path: Path):
    with pytest.raises(labsim.LabsimError, match="holds no result"):
        labsim.load(tmp_path)


def test_examples_ship():
    for name in ("p01", "p03", "p06", "guettler2009"):
        assert labsim.read_campaign(labsim.example(name)).drops
    assert labsim.example("crust").name == "p04" and labsim.example("pixel_scale").name == "p06"
    with pytest.raises(labsim.LabsimError, match=r"choose one of .*crust.*guettler2009"):
        labsim.example("p99")


def test_tab_completion_shows_the_verbs_alone():
    assert "load" in dir(labsim) and not {"os", "importlib", "Any", "annotations"} & set(dir(labsim))
