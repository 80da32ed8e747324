"""Tracks of other programs: what they wrote is what labsim reads, and what is wrong is said in one line."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labsim.campaign import read_campaign
from labsim.cli import main
from labsim.errors import CampaignError, LabsimError, MeasurementError
from labsim.inference.observations.observe import observe_drops
from labsim.records import Camera
from labsim.tracks import find_format, list_formats, read_rows
from labsim.video import read_track

DATA = Path(__file__).parents[2] / "data"
CAMERA = Camera(frame_rate=10000.0, pixel_size=20e-6, surface_row=300.0, surface_row_sigma=0.2)
P = "org.opensourcephysics."


def write_project(path: Path, tracks: dict[str, dict[int, float]]) -> Path:
    """A project as Tracker 6 writes it, cut to the parts that matter, with axes and an empty track among the marks."""

    def mark(frame: int, row: float) -> str:
        return (
            f'<property name="[{frame}]" type="object"><object class="{P}cabrillo.tracker.PointMass$FrameData">'
            f'<property name="x" type="double">64.5</property><property name="y" type="double">{row!r}</property>'
            "</object></property>"
        )

    items = "".join(
        f'<property name="item" type="object"><object class="{P}cabrillo.tracker.PointMass">'
        f'<property name="mass" type="double">1.0</property><property name="name" type="string">{name}</property>'
        f'<property name="framedata" type="array" class="[L{P}cabrillo.tracker.PointMass$FrameData;">'
        + "".join(mark(frame, row) for frame, row in rows.items())
        + "</property></object></property>"
        for name, rows in tracks.items()
    )
    path.parent.mkdir(exist_ok=True)
    path.write_text(
        f'<?xml version="1.0" encoding="UTF-8"?>\n<object class="{P}cabrillo.tracker.TrackerPanel">'
        f'<property name="coords" type="object"><object class="{P}media.core.ImageCoordSystem">'
        f'<property name="framedata" type="array"><property name="[0]" type="object"><object class="{P}x">'
        '<property name="xscale" type="double">7.5</property></object></property></property></object></property>'
        '<property name="tracks" type="collection" class="java.util.ArrayList">'
        f'<property name="item" type="object"><object class="{P}cabrillo.tracker.CoordAxes">'
        f'<property name="name" type="string">axes</property></object></property>{items}</property></object>',
        encoding="utf-8",
    )
    return path


@pytest.fixture
def rows() -> dict[int, float]:
    """Frames and rows of a drop that has been measured: D05 of a labelled campaign."""
    table = pd.read_csv(DATA / "campaigns/p01/drops/D05/track.csv")
    return dict(zip(table["frame"], table["tip_row_px"], strict=True))


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    shutil.copytree(
        DATA / "campaigns/p01", folder, ignore=lambda path, names: {n for n in names if n[0] == "D"} - {"D05"}
    )
    return folder


def put(campaign: Path, name: str) -> Path:
    """Name a file in drop.toml in place of track.csv and return where it has to lie."""
    toml = campaign / "drops/D05/drop.toml"
    text = toml.read_text()
    assert 'file = "track.csv"' in text
    toml.write_text(text.replace('file = "track.csv"', f'file = "{name}"'))
    (campaign / "drops/D05/track.csv").unlink()
    return campaign / "drops/D05" / name


def write_tracker_table(path: Path, rows: dict[int, float]) -> None:
    lines = ["\tmass A\t\t\t", "t\tx\ty\tpixely\tframe"]
    lines += [f"{f / 1e4:.6E}\t1.0E0\t{(300 - r) * 2e-5:.6E}\t{r!r}\t{f}" for f, r in rows.items()]
    path.write_text("\n".join(lines) + "\n")


def write_heights(path: Path, rows: dict[int, float], camera: Camera) -> None:
    heights = {f: (camera.surface_row - r) * camera.pixel_size * 1e3 for f, r in rows.items()}
    path.write_text(
        "# t(s)\tx(mm)\ty(mm)\n" + "".join(f"{f / 1e4:.7f}\t0.5\t{h:.9f}\n" for f, h in heights.items())
    )


def write_trackpy(path: Path, rows: dict[int, float]) -> None:
    table = pd.DataFrame(
        {"y": rows.values(), "x": 64.0, "mass": 900.0, "ep": 0.05, "frame": rows.keys(), "particle": 0}
    )
    table.to_csv(path)  # with the index, as everybody saves it


@pytest.mark.parametrize("kind", ["trk", "trz", "table", "heights", "trackpy"])
def test_a_campaign_may_name_such_a_file_as_its_track(
    kind: str, campaign: Path, rows: dict[int, float]
) -> None:
    """The same drop in five formats is the same observation as its track.csv."""
    expected = observe_drops(read_campaign(campaign))[0][0]
    camera = read_campaign(campaign).drops[0].camera
    assert camera is not None
    if kind == "trk":
        write_project(put(campaign, "d05.trk"), {"mass A": rows})
    elif kind == "trz":
        path = put(campaign, "d05.trz")
        inside = write_project(campaign.parent / "inside.trk", {"mass A": rows})
        with zipfile.ZipFile(path, "w") as archive:
            archive.write(inside, "project/inside.trk")
            archive.writestr("project/video.mp4", b"not read")
    elif kind == "table":
        write_tracker_table(put(campaign, "d05.txt"), rows)
    elif kind == "heights":
        write_heights(put(campaign, "d05.txt"), rows, camera)
    else:
        write_trackpy(put(campaign, "d05.csv"), rows)
    found = observe_drops(read_campaign(campaign))[0][0]
    assert np.allclose(found.time, expected.time, rtol=0, atol=1e-12)
    assert np.allclose(found.depth, expected.depth, rtol=0, atol=1e-9)
    assert found.contact_time == pytest.approx(expected.contact_time, abs=1e-7)
    with pytest.raises(SystemExit) as left:
        main(["check", str(campaign), "--quiet"])
    assert left.value.code == 0


def test_the_track_command_reads_a_project(tmp_path: Path, rows: dict[int, float]) -> None:
    path = write_project(tmp_path / "in" / "d05.trk", {"mass A": rows})
    arguments = ["track", str(path), "--fps", "10000", "--pixel-um", "20", "--surface-row", "302", "--quiet"]
    with pytest.raises(SystemExit) as left:
        main([*arguments, "--out", str(tmp_path / "out")])
    assert left.value.code == 0
    written = pd.read_csv(tmp_path / "out" / "track.csv")
    assert np.allclose(written["tip_row_px"], list(rows.values()), atol=1e-6)
    assert (tmp_path / "out" / "curve.csv").is_file()


def test_errors_of_trackpy_are_taken(tmp_path: Path, rows: dict[int, float]) -> None:
    write_trackpy(tmp_path / "t.csv", rows)
    track = read_track(tmp_path / "t.csv", CAMERA, None)
    assert np.all(track.sigma == 0.05) and not any("error bar" in text for text in track.warnings)


def test_a_real_project_agrees_with_the_table_exported_from_it() -> None:
    """Ball "mass A" of a public project: its pixels, scale 5.27 px/cm and origin 512.92 give the exported y in cm."""
    folder = DATA / "tracks/projectile_cc0"
    project = list_formats()["tracker_project"].read_points(folder / "Projectile_Motion.trk")
    exported = np.loadtxt(folder / "blue.txt")
    agree = []
    for name, points in project.items():
        height = (512.9203539823009 - points.row) / 5.2698763504658634
        start = int(np.argmin(np.abs(height - exported[0, 2])))
        part = height[start : start + len(exported)]
        if len(part) == len(exported):
            agree.append((float(np.abs(part - exported[:, 2]).max()), name))
    assert min(agree)[0] < 1e-4, agree


def test_the_track_with_the_folders_name_is_taken(tmp_path: Path, rows: dict[int, float]) -> None:
    folder = tmp_path / "D05"
    folder.mkdir()
    other = {frame: row + 40 for frame, row in rows.items()}
    path = write_project(folder / "both.trk", {"mark": other, "D05": rows})
    assert read_rows(path, CAMERA).name == "D05"
    assert np.array_equal(read_rows(path, CAMERA).row, list(rows.values()))
    (folder / "two.txt").write_text(
        "#multi:\n\tmark\t\tD05\t\nt\ty\tpixely\ty\tpixely\n"
        + "".join(f"{f / 1e4:.4E}\t\t\t-1.0\t{r}\n" for f, r in rows.items())
    )
    assert np.allclose(read_rows(folder / "two.txt", CAMERA).row, list(rows.values()))


def test_decimal_commas(tmp_path: Path) -> None:
    lines = [f"{i / 1e4:.4f};{290 + 2 * i + 0.25:.2f}".replace(".", ",") for i in range(20)]
    (tmp_path / "t.txt").write_text("masse A;\nt;pixely\n" + "\n".join(lines))
    rows = read_rows(tmp_path / "t.txt", CAMERA)
    assert list(rows.frame) == list(range(20)) and rows.row[3] == 296.25


BOMB = (
    '<?xml version="1.0"?><!DOCTYPE o [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>'
    f'<object class="{P}cabrillo.tracker.TrackerPanel">&b;</object>'
)
OUTSIDE = (
    '<?xml version="1.0"?><!DOCTYPE o [<!ENTITY a SYSTEM "file:///etc/passwd">]>'
    f'<object class="{P}cabrillo.tracker.TrackerPanel">&a;</object>'
)
HEAD = "t\tx\ty\tpixely\n"
WRONG = {
    # file, content, words the one line must hold
    "entities": ("t.trk", BOMB, ["declares XML entities", "save it again"]),
    "entity outside": ("t.trk", OUTSIDE, ["declares XML entities"]),
    "no XML": ("t.trk", "frame,tip_row_px\n0,1\n", ["is no XML"]),
    "cut off": ("t.trk", f'<object class="{P}cabrillo.tracker.TrackerPanel"><property', ["is no XML"]),
    "tabset": ("t.trk", f'<object class="{P}cabrillo.tracker.TrackerIO$TabsetData"/>', ["TabsetData", "Save Tab As"]),
    "nothing tracked": ("t.trk", f'<object class="{P}cabrillo.tracker.TrackerPanel"/>', ["no tracked point"]),
    "no zip": ("t.trz", "PK", ["is no zip file"]),
    "y without a unit": ("t.txt", "t\tx\ty\n0.0\t1\t2\n", ["y", "no unit", "pixely", "y (mm)"]),
    "text in y": ("t.txt", HEAD + "0.0\t1\t2\tabc\n", ["pixely", "line 2", "abc"]),
    "played at 30 Hz": ("t.txt", HEAD + "".join(f"{i / 30:.7f}\t1\t2\t{i}\n" for i in range(9)), ["t: ", "10000 Hz", "frame"]),
    "recorded faster": ("t.txt", HEAD + "".join(f"{i / 4e5:.7f}\t1\t2\t{i}\n" for i in range(9)), ["t: ", "10000 Hz"]),
    "two particles": ("t.csv", "frame,x,y,particle\n0,1,2,0\n0,1,2,1\n", ["2 tracks (0, 1)", "choose one with --particle 0"]),
    "frame twice": ("t.csv", "frame,x,y\n0,1,2\n0,1,3\n", ["frame", "0 has two positions"]),
    "half a frame": ("t.csv", "frame,x,y\n0.5,1,2\n", ["frame", "0.5", "whole number"]),
    "text in a table": ("t.csv", "frame,x,y\n0,1,two\n", ["y", "line 2", "two"]),
    "empty": ("t.csv", "frame,x,y\n0,1,\n", ["no position"]),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_named_with_its_file_and_remedy(name: str, tmp_path: Path, campaign: Path) -> None:
    file, content, words = WRONG[name]
    path = tmp_path / file
    path.write_text(content)
    with pytest.raises(MeasurementError) as caught:
        read_track(path, CAMERA, None)
    for word in [str(path), *words]:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)
    put(campaign, file).write_text(content)
    with pytest.raises(CampaignError) as found:
        read_campaign(campaign)
    assert file in str(found.value)


def test_a_track_that_stays_in_the_air(campaign: Path) -> None:
    write_project(put(campaign, "d05.trk"), {"mass A": {i: 10.0 + i for i in range(30)}})
    with pytest.raises(CampaignError, match=r"d05\.trk: rows: the track never reaches the surface"):
        read_campaign(campaign)


def test_damaged_projects_never_end_in_a_traceback(tmp_path: Path, rows: dict[int, float]) -> None:
    whole = write_project(tmp_path / "whole.trk", {"mass A": rows}).read_bytes()
    random = np.random.default_rng(3)
    for number in range(200):
        damaged = bytearray(whole[: random.integers(1, len(whole))] if number % 2 else whole)
        for place in random.integers(0, len(damaged), 5):
            damaged[place] = random.integers(0, 256)
        path = tmp_path / "damaged.trk"
        path.write_bytes(damaged)
        try:
            read_rows(path, CAMERA)
        except LabsimError as trouble:
            assert "damaged.trk" in str(trouble)


def test_every_format_is_listed_and_says_what_it_is() -> None:
    formats = list_formats()
    for module in formats.values():
        assert module.NAME and callable(module.recognises) and callable(module.read_points)


def test_labsims_own_tracks_are_tables() -> None:
    assert find_format(DATA / "campaigns/p01/drops/D05/track.csv") is list_formats()["table"]


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # trackpy 0.7 on pandas 3
def test_a_linked_data_frame_of_trackpy(tmp_path: Path) -> None:
    """trackpy itself, where it is installed: a bright blob that falls, located and linked."""
    trackpy = pytest.importorskip("trackpy")
    pictures = []
    y, x = np.mgrid[0:80, 0:40]
    for i in range(12):
        pictures.append((20 + 200 * np.exp(-((y - 12 - 4.3 * i) ** 2 + (x - 20) ** 2) / 8)).astype(np.uint8))
    trackpy.quiet()
    linked = trackpy.link(trackpy.batch(pictures, 9, processes=1), 8)
    assert set(linked["particle"]) == {0}
    linked.to_csv(tmp_path / "linked.csv")
    rows = read_rows(tmp_path / "linked.csv", CAMERA)
    assert rows.name == "0"
    assert np.array_equal(rows.row, linked["y"]) and np.allclose(
        rows.row, 12 + 4.3 * np.arange(12), atol=0.15
    )
