"""The command line: what it writes, and one line with status 2 where it cannot."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest

from labsim.cli import list_command_files, main
from labsim.runs.run_file import read_run_file
from labsim.sph import extrapolate

SEED = Path(__file__).parents[2] / "data" / "guettler2009"
TRACKS = SEED.parent / "campaigns" / "p01"
QUICK = [
    "--geometry",
    "planar",
    "--set",
    "material.bulk_modulus_Pa=4500",
    "--spacing-um",
    "125",
    "--speed-m-s",
    "0.3",
]


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return int(left.value.code or 0)


@pytest.fixture(autouse=True)
def own_store(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LABSIM_STORE", str(tmp_path_factory.getbasetemp() / "command-store"))


def test_simulate_writes_what_the_contract_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("simulate", "-o", str(tmp_path / "out"), "--json", "--quiet", *QUICK) == 0
    printed = json.loads(capsys.readouterr().out)
    folder = tmp_path / "out"
    summary = json.loads((folder / "run.json").read_text())
    keys = (
        "penetration_depth_m stopping_time_s particles steps wall_s updates_per_s momentum_error energy_error"
    )
    assert set(keys.split()) <= set(summary) and printed == summary
    shares = ("contact_energy_share", "viscous_energy_share", "exchange_energy_share")
    assert all(abs(summary[key]) < 0.2 for key in shares)
    volumes = [summary["compacted_volume_m3"][phi] for phi in ("0.17", "0.20", "0.22")]
    assert 0.15 < summary["filling_factor_max"] < 0.4 and sorted(volumes, reverse=True) == volumes
    assert summary["setting"]["material"]["bulk_modulus"] == 4500.0
    curve = pd.read_csv(folder / "curve.csv")
    assert list(curve.columns) == ["time_s", "depth_m", "velocity_m_s", "force_N_m"]
    assert curve.depth_m.max() == pytest.approx(summary["penetration_depth_m"], rel=1e-3)
    run = read_run_file(folder / "run.h5")
    assert run.penetration_depth == summary["penetration_depth_m"]
    mesh = meshio.read(folder / "fields" / "stop.vtu")
    assert len(mesh.points) == summary["particles"]
    assert np.allclose(np.ravel(mesh.point_data["filling_factor"]), run.particles.filling_factor)
    assert 'file="stop.vtu"' in (folder / "fields" / "run.pvd").read_text()
    assert (folder / "run.png").stat().st_size > 10_000 and (folder / "field.png").stat().st_size > 10_000


def test_several_spacings_are_extrapolated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("simulate", "-o", str(tmp_path), "--spacings", "2", "--movie", *QUICK) == 0
    out = capsys.readouterr().out
    summary = json.loads((tmp_path / "run.json").read_text())
    assert summary["penetration_depth_m_sigma"] > 0.0 and summary["stopping_time_s_sigma"] > 0.0
    coarse, fine = (each["penetration_depth_m"] for each in summary["spacing_study"])
    ratio = 2**0.5
    assert summary["penetration_depth_m"] == pytest.approx((ratio * fine - coarse) / (ratio - 1))
    spacings = [each["spacing_m"] for each in summary["spacing_study"]]
    same = extrapolate(spacings, [coarse, fine])  # the library's sigma, not one of the command's own
    assert summary["penetration_depth_m_sigma"] == pytest.approx(same.sigma)
    assert "extrapolated from 2 spacings" in out
    assert (tmp_path / "run.mp4").stat().st_size > 20_000


def test_a_drop_of_a_campaign_and_a_model_file(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    model.write_text("[material]\np_m_Pa = 900.0\nbulk_modulus_Pa = 4500.0\n")
    arguments = ["--campaign", str(SEED), "--drop", "S01", "--model", str(model), "--spacing-um", "137"]
    assert call("simulate", "-o", str(tmp_path / "out"), "--quiet", *arguments) == 0
    setting = json.loads((tmp_path / "out" / "run.json").read_text())["setting"]
    assert setting["material"]["p_m"] == 900.0 and setting["material"]["bulk_modulus"] == 4500.0
    assert setting["impact_speed"] == 0.65 and setting["gravity"] == 0.0 and setting["geometry"] == "planar"
    assert setting["projectile"]["tip_radius"] == 0.55e-3
    # a cylinder of the glass bead's density
    assert setting["projectile"]["mass"] == pytest.approx(2540.0 * np.pi * 0.55e-3**2, rel=1e-3)
    assert setting["width"] == pytest.approx(8e-3) and setting["depth"] == pytest.approx(5e-3)


MISTAKES = {
    "no such command": (["nonsense"], ["No such command", "labsim --help"]),
    "a typing error": (
        ["diagnos", "x"],
        ["No such command 'diagnos'", "did you mean diagnose", "labsim --help"],
    ),
    "no such option": (["check", "x", "--nonsense"], ["--nonsense"]),
    "missing folder": (["check", "/nonexistent"], ["/nonexistent", "no such folder"]),
    "no argument": (["calibrate"], ["labsim calibrate", "Missing argument", "labsim calibrate --help"]),
    "500 mm tip": (["simulate", "--tip-radius-mm", "500"], ["--tip-radius-mm", "500", "write 0.5"]),
    "negative mass": (["simulate", "--mass-mg", "-1"], ["--mass-mg", "-1", "negative"]),
    "NaN speed": (["simulate", "--speed-m-s", "nan"], ["--speed-m-s", "nan", "finite"]),
    "unknown key": (["simulate", "--set", "material.phi3=1"], ["material.phi3", "use one of", "phi_2"]),
    "not a number": (["simulate", "--set", "material.delta=x"], ["material.delta", "'x'", "number"]),
    "planar sphere": (["simulate", "--geometry", "planar", "--tip", "sphere"], ["--tip", "sphere", "planar"]),
    "drop alone": (["simulate", "--drop", "D01"], ["--drop", "--campaign"]),
    "drop unknown": (["simulate", "--campaign", str(SEED), "--drop", "D99"], ["D99", "name one of", "S01"]),
    "phi beyond phi2": (["simulate", "--filling-factor", "0.6"], ["filling_factor", "0.6"]),
    "unknown figure": (["calibrate", str(SEED), "--use", "width"], ["--use", "width", "stopping_time"]),
    "figures of tracks": (
        ["calibrate", str(TRACKS), "--use", "depth"],
        ["--use", "has tracks", "leave it out"],
    ),
    "parameters of figures": (
        ["calibrate", str(SEED), "--parameters", "p_m"],
        ["--parameters", "leave it out"],
    ),
    "no figure": (["calibrate", str(SEED), "--use", ","], ["--use", "names no figure"]),
    "unknown factor": (["calibrate", str(SEED), "--planar-correction", "x"], ["multiply_exp"]),
    "into the campaign": (["diagnose", str(SEED), "-o", str(SEED / "out")], ["--out", "lies inside"]),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_status_2(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, words = MISTAKES[name]
    assert (
        call(*arguments, *(["--quiet"] if arguments[0] in ("simulate", "calibrate", "diagnose") else [])) == 2
    )
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: ") and captured.out == ""
    for word in words:
        assert word in lines[0]
    assert not (SEED / "out").exists()


def test_runs_are_listed_verified_and_pruned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = ["--store", str(tmp_path / "store")]
    assert call("simulate", "-o", str(tmp_path / "out"), "--quiet", *QUICK, *store) == 0
    assert call("runs", "list", *store) == 0
    assert "0.3 m/s" in capsys.readouterr().out
    (file,) = (tmp_path / "store").glob("??/*.h5")
    file.write_bytes(file.read_bytes()[:2000])
    assert call("runs", "verify", *store) == 2
    assert "1 of 1 files damaged" in capsys.readouterr().err
    assert call("runs", "prune", *store) == 0
    assert call("runs", "verify", *store, "--json") == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["runs"] == 0


def test_help_fits_a_screen_and_imports_nothing_heavy() -> None:
    shown = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "labsim", "--help"],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(SEED).parents[1],
        env={**os.environ, "COLUMNS": "80"},
    )
    for command in list_command_files():
        line = next(line for line in shown.stdout.splitlines() if line.startswith(f"  {command} "))
        assert len(line.split(maxsplit=1)[1]) > 5
    lines = shown.stdout.splitlines()
    assert len(lines) <= 24 and max(map(len, lines)) <= 80
    imported = {line.rpartition("|")[2].strip() for line in shown.stderr.splitlines()}
    assert not imported & {"numba", "scipy", "matplotlib", "emcee", "cv2", "labsim.cli.diagnose"}


def test_the_default_output_is_a_new_folder_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from labsim.cli.options import make_output_folder

    campaign, here, film = tmp_path / "data" / "series", tmp_path / "here", tmp_path / "data" / "a.b.mp4"
    (campaign / "drops" / "D01").mkdir(parents=True)
    (campaign / "campaign.toml").write_text("")
    (campaign / "drops/D01/video.avi").write_text("")
    film.write_text("")
    here.mkdir()
    monkeypatch.chdir(here)
    first = make_output_folder(None, campaign, "calibrate")
    assert first == here / "series-calibrate"
    (first / "file").write_text("")
    assert make_output_folder(None, campaign, "calibrate") == here / "series-calibrate-2"
    for source, name in (
        (campaign / "campaign.toml", "series-check"),
        (campaign / "drops/D01", "series-D01-check"),
        (campaign / "drops/D01/video.avi", "series-D01-check"),
        (film, "a.b-check"),
        (film.parent, "data-check"),
    ):
        assert make_output_folder(None, source, "check") == here / name
    for place in (campaign, campaign / "drops" / "D01"):  # what lies in a campaign is data
        monkeypatch.chdir(place)
        assert make_output_folder(None, film, "track") == campaign.parent / "a.b-track"
    monkeypatch.chdir(film.parent)
    assert (
        make_output_folder(None, Path(), "track") == tmp_path / "data-track"
    )  # a folder of pictures, standing in it


def test_only_a_campaign_and_a_folder_that_is_the_input_are_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labsim.cli.options import make_output_folder
    from labsim.errors import LabsimError

    (tmp_path / "series").mkdir()
    (tmp_path / "series" / "campaign.toml").write_text("")
    film = tmp_path / "ball.mp4"
    film.write_text("")
    monkeypatch.chdir(tmp_path)
    assert make_output_folder(Path("out"), film, "track") == tmp_path / "out"
    for out, source in ((Path("series/out"), film), (Path("out"), tmp_path), (Path(), tmp_path)):
        with pytest.raises(LabsimError, match="lies inside the input or a campaign"):
            make_output_folder(out, source, "track")


def test_a_new_campaign_needs_only_its_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "series"
    assert call("new", str(folder)) == 0
    assert call("check", str(folder)) == 2
    assert "the track is empty" in capsys.readouterr().err
    with (folder / "drops/D01/track.csv").open("a") as track:
        track.write("".join(f"{i},{280 + 2 * i}\n" for i in range(30)))
    assert call("check", str(folder)) == 2
    assert "holds no TIFF" in capsys.readouterr().err
    shutil.rmtree(folder / "ct")
    assert call("check", str(folder)) == 0
    assert call("new", str(folder)) == 2
    assert "not empty" in capsys.readouterr().err


def test_ctrl_c_stops_at_once_with_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "labsim", "calibrate", str(SEED), "-o", str(tmp_path / "out")]
    process = subprocess.Popen(
        [*command, "--store", str(tmp_path / "store"), "--workers", "2"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(
            signal.SIGINT, signal.SIG_DFL
        ),  # ignored in a shell's background jobs
        cwd=SEED.parents[1],
    )
    assert process.stderr is not None
    assert "calibration runs" in process.stderr.readline()
    time.sleep(2.0)
    os.killpg(process.pid, signal.SIGINT)
    rest = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert any(line.startswith("error: stopped") for line in rest.splitlines())
