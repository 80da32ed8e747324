"""Tables as spreadsheets and other programs write them: column names, units, commas; and what is no table of a drop."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
from campaign_files import CAMPAIGN, DROP

import labsim
from labsim.campaign import read_campaign
from labsim.errors import CampaignError, MeasurementError
from labsim.inference.observations.observe import read_observed_track
from labsim.records import Camera
from labsim.tracks import place_points, read_points, read_rows
from labsim.tracks.table import read_mapping
from labsim.video import read_track

CAMERA = Camera(frame_rate=10000.0, pixel_size=20e-6, surface_row=300.0, surface_row_sigma=0.2)
FRAMES = range(40)
ROWS = [280.0 + i for i in FRAMES]
DEPTHS = [(row - 300.0) * 0.02 for row in ROWS]  # mm


def write(head: str, line: str, *, comma: bool = False) -> str:
    """A table of the same fall; ``line`` takes frame, ms, row, depth, height."""
    lines = [
        line.format(frame=i, ms=f"{i / 10:.1f}", row=row, depth=f"{depth:.3f}", height=f"{-depth:.3f}")
        for i, row, depth in zip(FRAMES, ROWS, DEPTHS, strict=True)
    ]
    body = "\n".join(lines)
    return f"{head}\n{body.replace('.', ',') if comma else body}\n"


SAME = {
    # file, text, --columns
    "own": ("t.csv", write("frame,tip_row_px", "{frame},{row}"), None),
    "other case": ("t.csv", write("Frame,Y", "{frame},{row}"), None),
    "semicolons": ("t.csv", write("Frame;Row (px)", "{frame};{row}"), None),
    "decimal commas, time and depth": ("t.csv", write("t (ms);z (mm)", "{ms};{depth}", comma=True), None),
    "units by underscores": ("t.csv", write("time_ms,depth_mm", "{ms},{depth}"), None),
    "units by strokes": ("t.tsv", write("t/ms\tz/mm", "{ms}\t{depth}"), None),
    "heights": ("t.csv", write("Time [ms],Height [mm]", "{ms},{height}"), None),
    "blanks, after numpy.savetxt": ("t.txt", write("# frame row", "{frame} {row}"), None),
    "quotes": ("t.csv", write('"frame","tip_row_px"', '"{frame}","{row}"'), None),
    "more columns": ("t.csv", write(",no,Frame,x,Y", "0,a,{frame},64,{row}"), None),
    "trackpy": ("t.csv", write(",y,x,ep,frame,particle", "0,{row},64,0.05,{frame},0"), None),
    "mapped": ("t.csv", write("Bild;Zeile", "{frame};{row}"), "frame=Bild,row=zeile"),
    "mapped with units": ("t.csv", write("a,b", "{ms},{depth}"), "time_ms=a, depth_mm=b"),
    "unit of the header kept": ("t.csv", write("frame,Tiefe in mm", "{frame},{depth}"), "depth=Tiefe in mm"),
    "a column of the same name left": ("t.csv", write("frame,y,Y2", "{frame},7,{row}"), "row=Y2"),
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_the_same_fall_in_other_tables(name: str, tmp_path: Path) -> None:
    file, text, columns = SAME[name]
    path = tmp_path / file
    path.write_text(text, encoding="utf-8")
    points = read_points(path, columns=read_mapping(columns) if columns else None)
    found = place_points(path, *points, CAMERA)
    assert np.array_equal(found.frame, FRAMES) and found.warnings == ()
    assert np.allclose(found.row, ROWS, rtol=0, atol=1e-9)
    assert np.allclose(found.time, np.arange(40) / 1e4, rtol=0, atol=1e-15)
    assert name != "trackpy" or np.all(found.sigma == 0.05)


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252", "utf-8-sig"])
def test_what_windows_writes(encoding: str, tmp_path: Path) -> None:
    text = write("t (ms);z (µm)", "{ms};{frame}", comma=True).replace("\n", "\r\n")
    (tmp_path / "t.csv").write_bytes(text.encode(encoding))
    assert np.allclose(read_rows(tmp_path / "t.csv", CAMERA).row, 300.0 + np.arange(40) / 20)


def test_times_without_a_rate_count_frames(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("time_ms,depth_mm\n5.00,-1\n5.03,0\n5.06,1\n5.12,2\n5.15,3\n")
    camera = Camera(float("nan"), 1e-5, 0.0, 0.1)
    found = read_rows(tmp_path / "t.csv", camera)
    assert list(found.frame) == [0, 1, 2, 4, 5] and np.allclose(found.time[[0, 3]], [5.00e-3, 5.12e-3])
    assert np.allclose(found.row, [-100, 0, 100, 200, 300])


def test_errors_in_lengths_become_pixels(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(write("time_ms,depth_mm,depth_sigma_mm", "{ms},{depth},0.002"))
    assert np.allclose(read_rows(tmp_path / "t.csv", CAMERA).sigma, 0.1)


def test_own_times_that_are_no_times_of_the_rate_are_said(tmp_path: Path) -> None:
    """A column of replay times beside the frames: they are the camera's own for all that labsim knows, and it says so."""
    (tmp_path / "t.csv").write_text(
        "frame,time_s,tip_row_px\n" + "".join(f"{i},{i / 30},{280 + i}\n" for i in range(20))
    )
    found = read_track(tmp_path / "t.csv", CAMERA, 0.1)
    assert any("30 frames a second, 10000 are stated" in text for text in found.warnings)


WRONG = {
    "no header": ("1,2\n2,3\n", ["has no header line", "write frame,tip_row_px"]),
    "no column": ("frame,speed\n1,2\n", ["tip_row_px", "frame, speed", "--columns"]),
    "time without a unit": ("time,y\n1,2\n", ["time", "has no unit", "time_ms"]),
    "depth without a unit": ("frame,z\n1,2\n", ["z", "has no unit", "depth_mm"]),
    "a row in mm": ("frame,y (mm)\n1,2\n", ["y (mm)", "depth_mm", "height_mm"]),
    "two rows": ("frame,row,y\n1,2,3\n", None),  # labsim's own name wins where it is there
    "two likely rows": ("frame,row,Row\n1,2,3\n", ["row and Row", "--columns row="]),
    "upwards": (write("frame,depth_mm", "{frame},{height}"), ["goes up by 0.78 mm", "heights count upwards"]),
    "sigma in another unit": (write("frame,y,sigma_mm", "{frame},{row},1"), ["sigma_mm", "both alike"]),
    "frames backwards": ("frame,y\n2,1\n1,2\n", ["frame", "line 3", "1 does not follow 2"]),
    "no frame": ("frame,y\n2,1\n,2\n", ["frame", "line 3", "number every frame"]),
    "a formula": ("frame,y\n0,1\n1,=A1+1\n", ["y", "line 3", "'=A1+1' is not a number"]),
    "underscores in a number": ("frame,y\n0,1\n1,1_000\n", ["y", "line 3", "1_000"]),
    "beyond all numbers": ("frame,y\n0,1\n1,1e999\n", ["y", "line 3", "not finite"]),
    "frames beyond all": ("frame,y\n0,1\n1e30,2\n", ["frame", "2^53"]),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(name: str, tmp_path: Path) -> None:
    text, words = WRONG[name]
    path = tmp_path / "t.csv"
    path.write_text(text)
    if words is None:
        with pytest.raises(MeasurementError, match="row and y may both"):
            read_rows(path, CAMERA)
        return
    with pytest.raises(MeasurementError) as caught:
        read_rows(path, CAMERA)
    for word in [str(path), *words]:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400 + len(str(path))


@pytest.mark.parametrize("text", ["frame", "frame=", "bild=Frame", "time_px=t", "row_mm=y"])
def test_a_mapping_that_says_nothing(text: str) -> None:
    with pytest.raises(ValueError, match=r"write|known"):
        read_mapping(text)


def test_a_mapping_to_a_column_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("a,b\n1,2\n")
    with pytest.raises(MeasurementError, match="no column 'c' among a, b"):
        read_points(tmp_path / "t.csv", columns={"frame": "a", "row": "c"})


HUGE = {
    "a stray quote before 12 000 lines": (
        lambda: 'frame,y\n0,"280\n' + "".join(f"{i},{280 + i}\n" for i in range(1, 12000)), None
    ),
    "a cell of 50 MB": (lambda: "frame,y\n0," + "1" * 50_000_000 + "\n", "longer than 10000 characters"),
    "five million rows": (lambda: "frame,y\n" + "".join(f"{i},{i}\n" for i in range(5_000_000)), "at most 1000000 frames"),
    "200 MB": (lambda: "frame,y\n" + ("0,1" + " " * 996 + "\n") * 200_000, "bytes; a record of a drop"),
}  # fmt: skip


@pytest.mark.parametrize("name", HUGE)
def test_what_is_too_large_is_refused_at_once(name: str, tmp_path: Path) -> None:
    """Ten seconds are the promise; two are enough on a machine that is busy."""
    make, words = HUGE[name]
    path = tmp_path / "t.csv"
    path.write_text(make())
    began = time.process_time()
    if words is None:
        assert len(read_rows(path, CAMERA).frame) == 12000
    else:
        with pytest.raises(MeasurementError, match=words):
            read_rows(path, CAMERA)
    assert time.process_time() - began < 2.0


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    (tmp_path / "c/drops/D01").mkdir(parents=True)
    (tmp_path / "c/campaign.toml").write_text(CAMPAIGN)
    (tmp_path / "c/drops/D01/drop.toml").write_text(DROP)
    (tmp_path / "c/drops/D01/track.csv").write_text(write("frame,tip_row_px", "{frame},{row}"))
    return tmp_path / "c"


def test_a_pipe_is_no_file(campaign: Path) -> None:
    """Nobody writes into it: to open it would wait for ever."""
    path = campaign / "drops/D01/track.csv"
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(CampaignError, match=r"track\.csv is not there"):
        read_campaign(campaign)
    for read in (lambda: read_rows(path, CAMERA), lambda: labsim.track(path)):
        with pytest.raises(MeasurementError, match="is no plain file"):
            read()


def test_frames_without_a_position_are_read_alike(campaign: Path) -> None:
    """labsim leaves the rows of rejected frames empty; every command takes them as frames without a position."""
    path = campaign / "drops/D01/track.csv"
    lines = path.read_text().splitlines()
    lines[6], lines[7] = "5,", "6, "
    path.write_text("\n".join(lines) + "\n")
    drop = read_campaign(campaign).drops[0]
    found = read_observed_track(drop)
    assert list(found.frame[~found.valid]) == [5, 6] and "2 frames have no position" in found.warnings
    assert found.reason[5] == "no position in the file"


def test_a_table_of_another_program_is_a_campaigns_track(campaign: Path) -> None:
    before = read_observed_track(read_campaign(campaign).drops[0])
    path = campaign / "drops/D01/track.csv"
    camera = read_campaign(campaign).drops[0].camera
    assert camera is not None
    lines = [
        f"{i / 10:.1f};{(row - camera.surface_row) * 0.02:.6f}" for i, row in zip(FRAMES, ROWS, strict=True)
    ]
    path.write_text("Zeit t (ms);z (mm)\n".replace("Zeit ", "") + "\n".join(lines).replace(".", ",") + "\n")
    after = read_observed_track(read_campaign(campaign).drops[0])
    assert np.allclose(after.tip_row, before.tip_row, atol=1e-4) and np.array_equal(after.time, before.time)


@pytest.mark.parametrize(
    "name", ["own", "decimal commas, time and depth", "trackpy", "blanks, after numpy.savetxt"]
)
def test_damaged_tables_end_in_one_line(name: str, tmp_path: Path) -> None:
    """Bytes changed, cut, doubled: rows, or one line with the file in it; and rows are finite and in their order."""
    file, text, _ = SAME[name]
    whole, random, path = text.encode(), np.random.default_rng(5), tmp_path / file
    for number in range(150):
        damaged = bytearray(whole[: random.integers(1, len(whole))] if number % 3 == 0 else whole)
        for place in random.integers(0, len(damaged), 4):
            damaged[place] = random.integers(0, 256)
        if number % 3 == 1:
            at = int(random.integers(0, len(damaged)))
            damaged[at:at] = damaged[at : at + 40]
        path.write_bytes(damaged)
        try:
            found = read_rows(path, CAMERA)
        except MeasurementError as trouble:
            assert str(path) in str(trouble) and len(str(trouble)) < 600 + len(str(path))
        else:
            assert np.all(np.diff(found.frame) > 0) and np.all(np.diff(found.time) > 0)
            assert np.all(np.isfinite(found.time))
