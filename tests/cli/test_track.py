"""``labsim track`` from the outside: files, keys, words, and one line of error."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
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


def test_a_fall_without_a_contact_is_still_a_track(tmp_path, capsys) -> None:
    """A ball that never reaches the stated surface: all files but the curve, one line that says so, no error."""
    out = tmp_path / "out"
    video = DATA / "ball_drop_120fps" / "ball_drop.mp4"
    arguments = ("--fps", 120, "--frames", "118-201", "--rod-diameter-mm", 40, "--surface-row", 1700)
    assert run(video, *arguments, "-o", out, "-q", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    said = [text for text in summary["warnings"] if text.startswith("no curve")]
    assert len(said) == 1 and "never reaches the surface" in said[0]
    assert summary["penetration_depth_m"] is None and summary["frames"] == 84
    assert summary["pixel_size_source"] == "rod diameter" and summary["pixel_size_m_sigma"] > 0
    assert pd.read_csv(out / "track.csv")["tip_row_px"].notna().sum() >= 60
    for name in ("track.png", "overlay.mp4", "overlay.png", "drop.json"):
        assert (out / name).stat().st_size > 500
    assert not (out / "curve.csv").exists()
    # a table has nothing but its curve to give
    table = ("--fps", 120, "--pixel-um", 40, "--surface-row", 1700)
    assert run(out / "track.csv", *table, "-o", tmp_path / "again", "-q") == 2
    assert "never reaches the surface" in capsys.readouterr().err


def test_damaged_videos_speak_with_one_voice(tmp_path) -> None:
    """What the decoder thinks of a damaged file never reaches the terminal: only labsim's own lines do."""
    source = (DATA / "h264" / "h264_crf35.mp4").read_bytes()
    rng = np.random.default_rng(1)
    for number in range(5):
        data = bytearray(source)
        for _ in range(30):
            data[int(rng.integers(40, len(data)))] = int(rng.integers(0, 256))
        if number > 2:
            data = data[: len(data) // number]
        (tmp_path / f"in{number}").mkdir()
        (tmp_path / f"in{number}" / "damaged.mp4").write_bytes(bytes(data))
    program = (
        "import sys\n"
        "from labsim.cli import main\n"
        "for file in sys.argv[2:]:\n"
        "    try:\n"
        "        main(['track', file, '--fps', '10000', '-o', sys.argv[1] + '/out', '-q'])\n"
        "    except SystemExit as stop:\n"
        "        assert stop.code in (0, 2, None), stop.code\n"
    )
    files = sorted(tmp_path.glob("in*/damaged.mp4"))
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path), *map(str, files)],
        capture_output=True,
        text=True,
        check=True,
    )
    lines = (done.stdout + done.stderr).splitlines()
    assert all(line.startswith("error: ") and ".mp4: " in line for line in lines), lines
    assert len(lines) <= len(files)
