"""``labsim track`` from the outside: files, keys, words, and one line of error."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tifffile
from campaign_files import CAMPAIGN, DROP, fill_in

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


def write_fall(path: Path, head: str = "frame,tip_row_px", *, lengths: bool = False) -> Path:
    """A fall of 0.65 m/s that the dust stops evenly within 2 ms: 10 000 frames/s, 20 µm, surface at row 300."""
    lines = []
    for i in range(120):
        t = i / 1e4 - 0.006
        depth = 0.65 * t + 4.905 * t * t if t < 0 else 0.65 * (min(t, 2e-3) - min(t, 2e-3) ** 2 / 4e-3)
        depth += 2e-7 * (i * 7919 % 13 - 6)  # scatter of some 0.03 px
        lines.append(
            f"{i / 10:.1f};{1e3 * depth:.6f}".replace(".", ",")
            if lengths
            else f"{i},{300 + depth / 2e-5:.4f}"
        )
    path.write_text("\n".join([head, *lines]) + "\n")
    return path


SCALES = ("--fps", 10000, "--pixel-um", 20, "--surface-row", 300)


def test_everything_that_is_missing_is_named_at_once(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_fall(tmp_path / "fall.csv")
    assert run(path) == 2
    assert f"{path}: --fps, --pixel-um, --surface-row: are not in the file" in capsys.readouterr().err
    assert run(path, "--surface-row", 300, "--fps", 10000) == 2
    assert f"{path}: --pixel-um: is not in the file; state it" in capsys.readouterr().err
    (tmp_path / "pictures").mkdir()
    for k in range(3):
        tifffile.imwrite(tmp_path / "pictures" / f"{k}.tif", np.full((40, 30), 100 + k, np.uint8))
    assert run(tmp_path / "pictures") == 2
    assert "--fps, --pixel-um: are not in the file" in capsys.readouterr().err
    assert sorted(each.name for each in tmp_path.iterdir()) == ["fall.csv", "pictures"], "no folder is left"


def test_a_table_beside_its_output(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    write_fall(tmp_path / "fall.csv")
    assert run("fall.csv", *SCALES, "-o", "out") == 0
    assert run("fall.csv", *SCALES) == 0
    assert (tmp_path / "out/drop.json").is_file() and (tmp_path / "fall-track/drop.json").is_file()
    assert "written to fall-track: " in capsys.readouterr().out


def test_lengths_need_no_camera(tmp_path, monkeypatch, capsys) -> None:
    """The same fall as rows of a camera and as time and depth in mm with decimal commas: the same figures."""
    monkeypatch.chdir(tmp_path)
    rows = write_fall(tmp_path / "rows.csv")
    lengths = write_fall(tmp_path / "lengths.csv", "t (ms);z (mm)", lengths=True)
    mapped = write_fall(tmp_path / "mapped.csv", "Zeit;Tiefe", lengths=True)
    found = {}
    for path, more in ((rows, SCALES), (lengths, ()), (mapped, ("--columns", "time_ms=Zeit,depth_mm=Tiefe"))):
        assert run(path, *more, "--row-sigma", 0.1 if path == rows else 0.2, "--json", "-q") == 0
        found[path.stem] = json.loads(capsys.readouterr().out)
    for key, off in (("impact_speed_m_s", 1e-4), ("penetration_depth_m", 1e-7), ("stopping_time_s", 2e-6)):
        assert found["lengths"][key] == pytest.approx(found["rows"][key], abs=off)
        assert found["mapped"][key] == found["lengths"][key]
    assert found["lengths"]["pixel_size_source"] == "table"
    assert any("the table gives lengths" in text for text in found["lengths"]["warnings"])
    assert run(mapped, "--columns", "time_ms=Zeit") == 2
    assert "no position" in capsys.readouterr().err
    assert run(mapped, "--columns", "bild=Zeit") == 2
    assert "--columns: 'bild' is not known" in capsys.readouterr().err


def test_one_of_several_particles(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    lines = write_fall(tmp_path / "fall.csv").read_text().splitlines()[1:]
    both = [f"{frame},64,{row},{k}" for k in (0, 1) for frame, row in (line.split(",") for line in lines[k:])]
    (tmp_path / "both.csv").write_text("frame,x,y,particle\n" + "\n".join(both) + "\n")
    assert run("both.csv", *SCALES) == 2
    assert "holds 2 tracks (0, 1); choose one with --particle 0" in capsys.readouterr().err
    assert run("both.csv", *SCALES, "--particle", "1", "-q", "--json") == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 119
    assert run("both.csv", *SCALES, "--particle", "2") == 2
    assert "'2' is not among its tracks; name one of 0, 1" in capsys.readouterr().err


def test_a_failed_track_leaves_a_picture(tmp_path, monkeypatch, capsys) -> None:
    """A film without a fall, and a table that never reaches the surface: what was seen, not an empty folder."""
    monkeypatch.chdir(tmp_path)
    assert run(DATA / "cine_phantom" / "cine_legacy.cine", "-q") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "cine_legacy-track/seen.png shows what was seen" in said
    assert [each.name for each in (tmp_path / "cine_legacy-track").iterdir()] == ["seen.png"]
    assert (tmp_path / "cine_legacy-track/seen.png").stat().st_size > 5000
    fall = write_fall(tmp_path / "fall.csv")
    assert run(fall, "--fps", 10000, "--pixel-um", 20, "--surface-row", 900, "-q") == 2
    assert (tmp_path / "fall-track/seen.png").stat().st_size > 5000
    # of a drop of a campaign, too, and of the others the results
    folder = tmp_path / "series"
    for name, surface in (("D01", 300.0), ("D02", 302.0)):
        (folder / "drops" / name).mkdir(parents=True)
        text = DROP.replace("sequence = 3", f"sequence = {name[-1]}")
        (folder / "drops" / name / "drop.toml").write_text(fill_in(text, surface_row_px=surface))
        (folder / "drops" / name / "track.csv").write_text(fall.read_text())
    (folder / "drops/D02/track.csv").write_text(
        "frame,tip_row_px\n" + "".join(f"{i},{i * 35}\n" for i in range(11))
    )
    (folder / "campaign.toml").write_text(CAMPAIGN)
    assert run(folder, "-q", "--workers", 1) == 2
    assert f"{tmp_path / 'series-track' / 'D02'} holds what was seen" in capsys.readouterr().err
    assert [each.name for each in (tmp_path / "series-track/D02").iterdir()] == ["seen.png"]
    assert (tmp_path / "series-track/D01/drop.json").is_file()
    # nothing that could be shown: nothing is left behind
    (tmp_path / "no.mp4").write_bytes(b"\0" * 5000)
    (tmp_path / "no.csv").write_text("frame,tip_row_px\n0,\n")
    for name in ("no.mp4", "no.csv"):
        assert run(name, *SCALES, "-q") == 2
    assert not (tmp_path / "no-track").exists()


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
