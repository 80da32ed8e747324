"""``labsim track`` from the outside: files, keys, words, and one line of error."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from labsim.cli import main

DATA = Path(__file__).parents[2] / "data" / "video"


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as stop:
        main(["track", *map(str, arguments)])
    return int(stop.value.code or 0)


def test_video_of_a_drop(tmp_path, capsys) -> None:
    assert run(DATA / "rendered_drops" / "mjpeg_3mm", "-o", tmp_path / "out", "--quiet", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary == json.loads((tmp_path / "out" / "drop.json").read_text())
    for key in ("contact_time_s", "impact_speed_m_s", "penetration_depth_m", "stopping_time_s"):
        assert summary[key] > 0 and summary[f"{key}_sigma"] > 0
    truth = json.loads((DATA / "rendered_drops" / "truth.json").read_text())["mjpeg_3mm"]
    assert summary["impact_speed_m_s"] == pytest.approx(truth["impact_speed_m_s"], rel=0.003)
    error = abs(summary["penetration_depth_m"] - truth["penetration_depth_m"])
    assert error < 3 * summary["penetration_depth_m_sigma"]
    for name in ("track.csv", "curve.csv", "curve_local.csv", "track.png", "overlay.mp4", "overlay.png"):
        assert (tmp_path / "out" / name).stat().st_size > 500
    columns = list(pd.read_csv(tmp_path / "out" / "curve.csv").columns)
    assert columns == [
        "time_s",
        "depth_m",
        "depth_sigma_m",
        "velocity_m_s",
        "velocity_sigma_m_s",
        "acceleration_m_s2",
        "acceleration_sigma_m_s2",
    ]
    assert list(pd.read_csv(tmp_path / "out" / "track.csv").columns)[:4] == [
        "frame",
        "time_s",
        "tip_row_px",
        "sigma_px",
    ]
    # the track goes back in as a table
    again = tmp_path / "again"
    arguments = ("--fps", 5000, "--pixel-um", 40, "--surface-row", 303.54)
    assert run(tmp_path / "out" / "track.csv", *arguments, "-o", again, "-q") == 0
    second = json.loads((again / "drop.json").read_text())
    assert second["penetration_depth_m"] == pytest.approx(summary["penetration_depth_m"], rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere.avi",), "does not exist"),
        ((DATA / "cine_phantom" / "cine_781.cine",), "cine_781"),
        ((DATA / "rendered_drops" / "truth.json",), "of no known format"),
    ],
)
def test_one_line_of_error(tmp_path, capsys, arguments, words) -> None:
    assert run(*arguments, "-o", tmp_path / "out", "-q") == 2
    text = capsys.readouterr().err.strip()
    assert text.startswith("error:") and words in text and "\n" not in text
