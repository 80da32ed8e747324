"""The verbs for scripts: quick to import, and the same answers as the layers below."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import labsim
from labsim.ct import compress, make_dataset, open_stack, write_compressed, write_map
from labsim.errors import CampaignError, MeasurementError
from labsim.video import open_frames, write_curve, write_track

DATA = Path(__file__).parents[1] / "data"
VIDEO = DATA / "video/rendered_drops/mjpeg/video.avi"


def test_import_is_quick_and_light() -> None:
    """Half a second is the bound here for a loaded machine; a quiet one needs 0.05 s."""
    code = "import time; b = time.perf_counter(); import labsim, sys; print(time.perf_counter() - b); print(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    first, modules = out.split("\n")[:2]
    assert float(first) < 0.5
    assert not {"numpy", "numba", "pandas", "matplotlib", "labsim.api"} & set(modules.split())


def test_every_public_name_is_there() -> None:
    for name in labsim.__all__:
        assert getattr(labsim, name) is not None
        assert name in dir(labsim)
    for name in ("track", "reduce_scan", "simulate", "calibrate", "diagnose", "tabulate", "read_campaign"):
        assert getattr(labsim, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        labsim.calibrat  # noqa: B018


def test_a_drop_of_a_campaign_as_tables(tmp_path: Path) -> None:
    """Track and curve to pandas and to CSV and back."""
    drop = labsim.read_campaign(DATA / "campaigns/p01").drops[4]
    track, curve = labsim.track(drop)
    again, _ = labsim.track(DATA / "campaigns/p01/drops" / drop.name)
    assert np.array_equal(track.tip_row, again.tip_row)
    assert curve.impact_speed.value == pytest.approx(np.sqrt(2 * 9.81 * drop.height.value), rel=0.02)
    table = labsim.tabulate(curve)
    assert list(table.columns)[:3] == ["time_s", "depth_m", "depth_sigma_m"]
    read = pd.read_csv(write_curve(curve, tmp_path / "curve.csv"))
    assert list(read.columns) == list(table.columns)
    assert np.allclose(read, table, rtol=1e-7, atol=1e-12, equal_nan=True)
    read = pd.read_csv(write_track(track, tmp_path / "track.csv"))
    assert np.allclose(read["tip_row_px"], labsim.tabulate(track)["tip_row_px"], equal_nan=True)


def test_a_file_needs_its_scales() -> None:
    path = DATA / "campaigns/p01/drops/D05/track.csv"
    with pytest.raises(MeasurementError, match="pixel_size"):
        labsim.track(path)
    with pytest.raises(MeasurementError, match="frame_rate, surface_row: are not"):
        labsim.track(path, pixel_size=2e-5)
    with pytest.raises(MeasurementError, match="summary"):
        labsim.track(DATA / "guettler2009/drops/D01")


def test_a_video_without_a_surface_row(tmp_path: Path) -> None:
    track, curve = labsim.track(
        DATA / "video/rendered_drops/mjpeg/video.avi", frame_rate=10000.0, pixel_size=20e-6
    )
    assert len(track.frame) > 50 and curve.penetration_depth.value > 2e-4


def test_python_and_the_command_line_keep_the_same_tracks() -> None:
    """A fall without a scale or a contact is a track without a curve, and says why; options are those of the command."""
    video = DATA / "video/ball_drop_120fps/ball_drop.mp4"
    track, curve = labsim.track(
        video, frame_rate=120.0, frames=(118, 201), rod_diameter=0.04, surface_row=1700.0
    )
    assert curve is None and len(track.frame) == 84 and track.valid.sum() >= 60
    assert any(text.startswith("no curve") and "never reaches the surface" in text for text in track.warnings)


def test_a_table_of_lengths_in_python(tmp_path: Path) -> None:
    fall = [-1.0 + 0.065 * i if i < 15 else 0.0 for i in range(60)]
    (tmp_path / "t.csv").write_text("a;b\n" + "".join(f"{i / 10};{depth}\n" for i, depth in enumerate(fall)))
    with pytest.raises(MeasurementError, match="no such column among a, b"):
        labsim.track(tmp_path / "t.csv")
    with pytest.raises(MeasurementError, match="never reaches the surface"):
        labsim.track(tmp_path / "t.csv", columns={"time_ms": "a", "depth_mm": "b"}, row_sigma=0.5)


def test_a_map_as_netcdf(tmp_path: Path) -> None:
    """map.nc opens with xarray and with a plain netCDF-4 reader's view of HDF5, with units and dimensions."""
    reduced = labsim.reduce_scan(DATA / "ct/labelled_scans/p05-C02")
    path = write_map(reduced, tmp_path / "map.nc")
    with xr.open_dataset(path) as read:
        assert dict(read.sizes) == dict(make_dataset(reduced).sizes)
        assert read["phi"].dims == ("z", "r") and read["r"].attrs["units"] == "m"
        assert np.array_equal(read["phi"].values, reduced.map.filling_factor, equal_nan=True)
        assert read.attrs["tip_depth_m"] == reduced.map.tip_depth
    curve = compress(reduced.map)
    read_back = pd.read_csv(write_compressed(curve, tmp_path / "v.csv"))
    assert np.allclose(read_back, labsim.tabulate(curve), rtol=1e-7)
    with pytest.raises(CampaignError, match="nothing to reduce"):
        labsim.reduce_scan(DATA / "guettler2009/ct/C01")


def test_a_run_is_simulated_once(tmp_path: Path) -> None:
    setting = labsim.DropSetting(
        labsim.Projectile("hemisphere", 5e-4, 1.33e-6), 0.4, labsim.Material(p_m=4000.0), spacing=1.25e-4
    )
    run = labsim.simulate(setting, store=tmp_path, workers=1)
    again = labsim.simulate([setting, setting], store=tmp_path, workers=1)
    assert again[0].penetration_depth == again[1].penetration_depth == run.penetration_depth > 1e-4
    assert list(labsim.tabulate(run).columns) == ["time_s", "depth_m", "velocity_m_s", "force_N"]
    with pytest.raises(labsim.LabsimError, match="spacing"):
        labsim.simulate(setting.replace(spacing=5e-4), store=tmp_path)


def test_the_example_of_the_package_runs_on_the_campaign_that_ships(
    shared_store: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lines of ``labsim.__doc__`` as they stand there; published figures answer as tracks do."""
    assert labsim.__doc__ is not None
    lines = [line.strip() for line in labsim.__doc__.splitlines() if line.startswith("    ")]
    assert len(lines) == 3 and 'read_campaign("my-drops")' in lines[0]
    monkeypatch.setenv("LABSIM_STORE", shared_store)
    shipped = f"read_campaign({str(DATA / 'guettler2009')!r})"
    exec("\n".join(lines).replace('read_campaign("my-drops")', shipped), {"labsim": labsim})
    p_m, word = capsys.readouterr().out.split()
    assert 500.0 < float(p_m) < 4000.0 and word == "unknown"


def test_a_diagnosis_of_published_figures_takes_a_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """It went to the predictions too, which draw nothing, and ended in a TypeError."""
    said = {}
    monkeypatch.setattr(
        "labsim.inference.published.calibrate.calibrate_summary",
        lambda *_, **how: said.setdefault("p_m", how),
    )
    monkeypatch.setattr(
        "labsim.diagnosis.published.campaign.diagnose_summary",
        lambda *_, workers, scheduler, progress: said.setdefault("verdict", workers),
    )
    assert labsim.diagnose(labsim.example("guettler2009"), seed=3, workers=1) == 1
    assert said["p_m"] == {"workers": 1, "scheduler": None, "seed": 3, "progress": None}


def test_tabulate_says_what_it_takes() -> None:
    with pytest.raises(TypeError, match="int is no table"):
        labsim.tabulate(3)


def test_records_show_themselves_in_a_line_and_in_a_notebook() -> None:
    track, curve = labsim.track(VIDEO, frame_rate=1e4, pixel_size=20e-6)
    campaign = labsim.read_campaign(labsim.example("crust"))
    scan = labsim.reduce_scan(campaign.scans[0])
    for record, word in (
        (track, "85 frames"),
        (curve, "mm deep"),
        (campaign, "2 CT scans"),
        (scan, "cells"),
        (scan.map, "cells"),
    ):
        assert word in repr(record) and len(repr(record)) < 250
        assert record._repr_html_().startswith("<pre>") and labsim.summarise(record) == record.summary()
    with pytest.raises(TypeError, match="int is neither"):
        labsim.summarise(3)


def test_pictures_in_memory_are_measured_like_those_on_disk() -> None:
    pictures = np.array(list(open_frames(VIDEO)))
    same, other = (labsim.track(each, frame_rate=1e4, pixel_size=20e-6)[0] for each in (pictures, VIDEO))
    assert (
        np.abs(same.tip_row - other.tip_row).max() < 0.05
    )  # one knows that its codec is lossy, the other does not
    scan = labsim.read_campaign(labsim.example("crust")).scans[0]
    volume = np.array(list(open_stack(scan.slices)))
    grey = scan.calibration
    stated = {
        "voxel": scan.voxel, "grey_air": grey.grey_air, "grey_per_density": grey.grey_per_density,
        "solid_density": grey.density_solid, "bead_radius": scan.projectile.tip_radius, "bead_mass": scan.projectile.mass,
    }  # fmt: skip
    np.testing.assert_array_equal(
        labsim.reduce_scan(volume, **stated).map.filling_factor, labsim.reduce_scan(scan).map.filling_factor
    )
    with pytest.raises(labsim.LabsimError, match="float64"):
        labsim.track(pictures.astype(float))
    with pytest.raises(labsim.LabsimError, match=r"give voxel, grey_air.*bead_mass"):
        labsim.reduce_scan(volume)


def test_pictures_of_records_are_matplotlib_axes() -> None:
    tracked = labsim.track(VIDEO, frame_rate=1e4, pixel_size=20e-6)
    figure, (left, right) = plt.subplots(1, 2)
    assert labsim.plot(tracked, left) is left and "depth (mm)" in left.get_ylabel()
    assert labsim.plot(labsim.reduce_scan(labsim.example("crust") / "ct/C01"), right) is right
    assert "axis (mm)" in right.get_xlabel()
    plt.close(figure)
    with pytest.raises(TypeError, match="Track has no picture"):
        labsim.plot(tracked[0])


def test_the_posterior_of_another_law_is_drawn_by_its_own_name() -> None:
    draws = np.random.default_rng(1).normal(9e4, 5e3, 400)
    posterior = SimpleNamespace(names=("cohesion_Pa",), calibrated=draws, samples=lambda name: draws)
    found = SimpleNamespace(posterior=posterior)
    figure, ax = plt.subplots()
    labsim.plot(found, ax)
    assert ax.get_xlabel() == "cohesion (kPa)"
    plt.close(figure)
    assert list(labsim.tabulate(found)) == ["cohesion_Pa"]
