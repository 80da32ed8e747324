"""The campaign format: what is read, and every error it promises (file, key, value, remedy in one line)."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile
from campaign_files import CAMPAIGN, DROP, SCAN

from labsim.campaign import describe_campaign, read_campaign, read_drop, read_scan
from labsim.cli import main
from labsim.errors import CampaignError, MeasurementError
from labsim.inference.observations.observe import read_observed_track
from labsim.records import PublishedScan, Scan

SEED = Path(__file__).parent.parent / "data" / "guettler2009"

TRACK = "frame,tip_row_px\n" + "".join(f"{i},{250 + 2 * i}\n" for i in range(40))


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    (folder / "drops/D01").mkdir(parents=True)
    (folder / "ct/C01/slices").mkdir(parents=True)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "drops/D01/drop.toml").write_text(DROP)
    (folder / "drops/D01/track.csv").write_text(TRACK)
    (folder / "ct/C01/scan.toml").write_text(SCAN)
    tifffile.imwrite(folder / "ct/C01/slices/slice_0000.tif", np.zeros((4, 4), np.uint8))
    return folder


def test_a_campaign_is_read_in_si(campaign: Path) -> None:
    read = read_campaign(campaign)
    assert read.sample.diameter == pytest.approx(0.025)
    assert read.p_m_range == (300.0, 6000.0)
    assert read.material.p_m == pytest.approx(math.sqrt(300.0 * 6000.0))
    assert (read.gravity, read.geometry) == (9.81, "axisymmetric")
    drop = read.drops[0]
    assert drop.projectile.mass == pytest.approx(1.3299e-6)
    assert drop.projectile.mass_sigma == pytest.approx(6.6e-9)
    assert drop.height is not None and drop.height.sigma == pytest.approx(1.5e-4)
    assert drop.camera is not None and drop.camera.pixel_size == pytest.approx(20e-6)
    scan = read.scans[0]
    assert scan.voxel == pytest.approx(40e-6) and scan.speed.value == 0.777
    assert isinstance(read_scan(campaign / "ct/C01"), Scan)
    assert read_drop(campaign / "drops/D01") == drop


def test_frames_that_are_left_out_of_a_track(campaign: Path) -> None:
    file = campaign / D
    file.write_text(file.read_text().replace("[record]", "[record]\nframes_left_out = [30, 31]"))
    drop = read_drop(file)
    assert drop.record.left_out == (30, 31)
    track = read_observed_track(drop)
    assert track.frame[~track.valid].tolist() == [30, 31]
    assert read_drop(file, given={"record": {"frames_left_out": None}}).record.left_out == ()
    file.write_text(file.read_text().replace("[30, 31]", "[40]"))
    with pytest.raises(
        MeasurementError, match=r"frames_left_out: 40 is no frame of the record; its frames are 0 to 39"
    ):
        read_observed_track(read_drop(file))


def test_scatter_of_samples_is_optional(campaign: Path) -> None:
    assert read_campaign(campaign).sample.scatter is None
    file = campaign / C
    stated = file.read_text()
    for text, value in (("0.08", 0.08), ("8", None), ("-0.1", None)):
        file.write_text(stated.replace("[sample]\n", f"[sample]\nscatter = {text}\n", 1))
        if value is not None:
            assert read_campaign(campaign).sample.scatter == value
        else:
            with pytest.raises(CampaignError, match=r"sample\.scatter"):
                read_campaign(campaign)


def test_the_published_campaign_says_what_is_assumed() -> None:
    read = read_campaign(SEED)
    assert read.geometry == "planar" and read.gravity == 0.0
    one, three = [next(d for d in read.drops if d.name == name).published for name in ("D01", "D11")]
    assert one is not None and three is not None
    assert one.stopping_time.value == pytest.approx(3.0e-3) and three.stopping_time.value == pytest.approx(
        6.2e-3
    )
    for drop in read.drops:
        area = math.pi * drop.projectile.tip_radius**2
        law = 8e-4 * drop.projectile.mass * drop.published.impact_speed.value / area
        assert drop.published.penetration_depth.value == pytest.approx(
            law, rel=5e-4
        )  # speeds are written with four digits
        assert "speed" in drop.source["assumed"] or drop.name == "S01"
    assert isinstance(read.published_scans[0], PublishedScan)
    assert describe_campaign(read)["kinds"] == {"summary": 9}


def _replace(file: str, old: str, new: str):  # type: ignore[no-untyped-def]
    def change(folder: Path) -> None:
        path = folder / file
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    return change


def _remove(file: str):  # type: ignore[no-untyped-def]
    def change(folder: Path) -> None:
        path = folder / file
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return change


def _set_video(line: str) -> Callable[[Path], None]:
    return _replace(D, 'kind = "track"', f'kind = "video"\n{line}')


C, D, S, T = "campaign.toml", "drops/D01/drop.toml", "ct/C01/scan.toml", "drops/D01/track.csv"
SUMMARY = DROP.split("[camera]")[0] + '[record]\nkind = "summary"\n[published]\npenetration_depth_mm = 0.9\n'
MISTAKES = {
    # what is done to the folder: (change, words the one line must hold)
    "no campaign.toml": (_remove(C), [C, "no such file"]),
    "no drops": (_remove("drops/D01"), ["drops", "holds no drop"]),
    "no drop.toml": (_remove(D), ["drop.toml", "missing"]),
    "no scan.toml": (_remove(S), ["scan.toml", "missing"]),
    "not TOML": (_replace(C, "phi_1 = 0.12", "phi_1 = = 0.12"), [C, "is not TOML", "line"]),
    "format 2": (_replace(C, "format = 1", "format = 2"), [C, "format", "2", "write 1"]),
    "key missing": (_replace(C, "phi_2 = 0.58\n", ""), [C, "material.phi_2", "is missing"]),
    "table missing": (_replace(D, "[camera]", "[kamera]"), [D, "[camera]", "is missing"]),
    "key in another unit": (_replace(D, "mass_mg", "mass_g"), [D, "mass_mg", "mass_g is not a key", "did you mean mass_mg"]),
    "key misspelt": (_replace(C, "diameter_mm", "diamter_mm"), [C, "sample.diameter_mm", "diamter_mm", "did you mean"]),
    "a sibling is no misspelling": (_replace(C, "phi_1 = 0.12\n", ""), [C, "phi_1", "missing; add it", "labsim new DIR"]),
    "its sigma is no misspelling": (_replace(D, "mass_mg = 1.3299\n", ""), [D, "projectile.mass_mg", "missing; add it"]),
    "table misspelt": (_replace(D, "[camera]", "[kamera]"), [D, "[camera]", "did you mean it by [kamera]"]),
    "unknown key": (_replace(C, "delta", "dleta = 1.0\ndelta"), [C, "material.dleta", "did you mean delta"]),
    "unknown table": (_replace(S, "[scan]", "[extra]\na = 1\n[scan]"), [S, "[extra]"]),
    "negative mass": (_replace(D, "mass_mg = 1", "mass_mg = -1"), [D, "projectile.mass_mg", "-1.3299", "negative"]),
    "500 mm bead": (_replace(D, "= 0.500", "= 500"), [D, "projectile.tip_radius_mm", "500", "write 0.5"]),
    "mass off by 1000": (_replace(D, "= 1.3299", "= 1329.9"), [D, "mass_mg", "1329.9", "density", "units"]),
    "mass off by 1/1000": (_replace(D, "= 1.3299", "= 0.0013299"), [D, "mass_mg", "density"]),
    "density in g/cm3": (_replace(C, "= 2000.0", "= 2.0"), [C, "monomer_density_kg_m3", "2", "write 2000"]),
    "pixel in m": (_replace(D, "= 20.00", "= 2.0e-5"), [D, "camera.pixel_size_um", "2e-05"]),
    "text for number": (_replace(D, "= 10000.0", '= "10 kHz"'), [D, "frame_rate_Hz", "10 kHz", "not a number"]),
    "NaN": (_replace(C, "delta = 0.58", "delta = nan"), [C, "material.delta", "nan", "finite"]),
    "infinite": (_replace(D, "height_mm = 0.98", "height_mm = inf"), [D, "drop.height_mm", "inf"]),
    "negative sigma": (_replace(D, "a_mm = 0.15", "a_mm = -0.15"), [D, "drop.height_sigma_mm", "negative"]),
    "phi0 above phi2": (_replace(C, "filling_factor = 0.15", "filling_factor = 0.6"), [C, "filling_factor", "phi_2"]),
    "phi0 below phi1": (_replace(C, "filling_factor = 0.15", "filling_factor = 0.1"), [C, "filling_factor", "phi_1"]),
    "phi2 below phi1": (_replace(C, "phi_2 = 0.58", "phi_2 = 0.11"), [C, "material.phi_2", "phi_1"]),
    "empty range": (_replace(C, "[300.0, 6000.0]", "[]"), [C, "p_m_range_Pa", "[]", "two pressures"]),
    "range backwards": (_replace(C, "[300.0, 6000.0]", "[6000.0, 300.0]"), [C, "p_m_range_Pa", "smaller"]),
    "range in kPa": (_replace(C, "[300.0, 6000.0]", "[0.3, 6.0]"), [C, "p_m_range_Pa", "0.3", "write 300"]),
    "unknown tip": (_replace(D, '"hemisphere"', '"wedge"'), [D, "projectile.tip", "wedge", "hemisphere"]),
    "unknown kind": (_replace(D, '"track"', '"film"'), [D, "record.kind", "film", "summary"]),
    "record gone": (_remove(T), [D, "record.file", "track.csv", "not there"]),
    "record empty": (lambda f: (f / T).write_text(""), [D, "record.file", "is empty"]),
    "track empty": (lambda f: (f / T).write_text("frame,tip_row_px\n"), [T, "empty"]),
    "track header": (_replace(T, "tip_row_px", "speed"), [T, "tip_row_px", "column", "speed", "--columns"]),
    "track NaN": (_replace(T, "\n3,256", "\n3,nan"), [T, "tip_row_px", "line 5", "nan"]),
    "track text": (_replace(T, "\n3,256", "\n3,abc"), [T, "tip_row_px", "line 5", "abc"]),
    "track unsorted": (_replace(T, "\n3,256", "\n1,256"), [T, "frame", "line 5"]),
    "track misses surface": (_replace(D, "= 296.15", "= 400"), [T, "never reaches the surface", "400"]),
    "region of three": (_replace(D, "[record]", "[record]\nregion_px = [1, 2, 3]"), [D, "record.region_px", "not a key"]),
    "region of a video": (_set_video("region_px = [1, 2, 3]"), [D, "record.region_px", "[1, 2, 3]", "4 numbers"]),
    "region turned over": (_set_video("region_px = [9, 2, 3, 8]"), [D, "record.region_px", "[9, 2, 3, 8]", "no area"]),
    "frames left out": (_replace(D, "[record]", "[record]\nframes_left_out = [1.5]"), [D, "frames_left_out", "1.5", "whole"]),
    "one frame left out": (_replace(D, "[record]", "[record]\nframes_left_out = 3"), [D, "frames_left_out", "3", "list"]),
    "axis of one number": (_replace(S, "[scan]", "[scan]\naxis_px = [50.0]"), [S, "scan.axis_px", "[50.0]", "2 numbers"]),
    "published with track": (lambda f: (f / D).write_text(DROP + "[published]\n"), [D, "[published]", "summary"]),
    "summary with camera": (_replace(D, '"track"', '"summary"'), [D, "[camera]", "remove"]),
    "summary without sigma": (lambda f: (f / D).write_text(SUMMARY), [D, "penetration_depth_sigma_mm", "missing"]),
    "no slices": (_remove("ct/C01/slices"), [S, "scan.slices", "not there"]),
    "empty slices": (_remove("ct/C01/slices/slice_0000.tif"), [S, "scan.slices", "no TIFF"]),
    "12 bits": (_replace(S, "bits = 8", "bits = 12"), [S, "scan.bits", "12", "8 or 16"]),
    "first slice": (_replace(S, '"top"', '"left"'), [S, "scan.first_slice", "left", "bottom"]),
    "voxel in mm": (_replace(S, "= 40.0", "= 0.04"), [S, "scan.voxel_um", "0.04", "write 40"]),
    "speed in mm/s": (_replace(S, "= 0.777", "= 777.0"), [S, "drop.speed_m_s", "777", "write 0.777"]),
}  # fmt: skip


def test_a_key_of_the_format_is_never_taken_for_another(campaign: Path) -> None:
    """Each key left out in turn: the message says to add it, and suspects none of those that are there."""
    asked = 0
    for file in (C, D, S):
        text = (campaign / file).read_text()
        for line in text.splitlines():
            if " = " not in line:
                continue
            (campaign / file).write_text(text.replace(line + "\n", "", 1))
            try:
                read_campaign(campaign)
            except CampaignError as trouble:
                if "is missing" in trouble.message:
                    asked += 1
                    assert "labsim new DIR" in trouble.message, trouble
        (campaign / file).write_text(text)
    assert asked > 35


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_in_one_line(
    name: str, campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, words = MISTAKES[name]
    change(campaign)
    with pytest.raises(CampaignError) as caught:
        read_campaign(campaign)
    with pytest.raises(SystemExit) as left:
        main(["check", str(campaign)])
    assert left.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"error: {caught.value}"]
    for word in words:
        assert word in lines[0]


def test_two_drops_cannot_share_a_place_in_the_sequence(campaign: Path) -> None:
    shutil.copytree(campaign / "drops/D01", campaign / "drops/D02")
    with pytest.raises(CampaignError, match=r"D02.*drop\.sequence.*3 is also that of D01"):
        read_campaign(campaign)


def add_record(campaign: Path, change: tuple[str, str] = ("", "")) -> None:
    """The drop D01 once more, by an accelerometer."""
    shutil.copytree(campaign / "drops/D01", campaign / "drops/D01-felt")
    file = campaign / "drops/D01-felt/drop.toml"
    text = file.read_text()
    projectile = text[text.index("[projectile]") : text.index("[drop]")]
    felt = [1.0] * 100 + [0.0] * 305 + [16.0] * 20 + [1.0] * 100  # at rest, falling, in the dust, at rest
    rows = "\n".join(f"{k * 1e-4:.4f},{g}" for k, g in enumerate(felt))
    (file.parent / "a.csv").write_text(f"time_s,a_g\n{rows}\n")
    said = f"""{projectile}[drop]
same_as = "D01"
impact_speed_m_s = 0.3
impact_speed_sigma_m_s = 0.01
[record]
kind = "acceleration"
file = "a.csv"
time_column = "time_s"
acceleration_column = "a_g"
unit = "g"
reads_at_rest = 1.0
sigma = 0.1
offset_sigma = 0.05
scale_sigma = 0.01
"""
    file.write_text(said.replace(*change) if change[0] else said)


def test_another_record_of_a_drop_is_that_drop(campaign: Path) -> None:
    add_record(campaign)
    first, felt = read_campaign(campaign).drops[:2]
    assert (felt.name, felt.sample, felt.sequence) == ("D01-felt", "D01", first.sequence)
    assert describe_campaign(read_campaign(campaign))["drops"] == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('same_as = "D01"', 'same_as = "D09"'), r"drop\.same_as.*D09.*no other drop"),
        (('same_as = "D01"', 'same_as = "D01-felt"'), r"drop\.same_as.*no other drop"),
        (('same_as = "D01"', 'same_as = "D01"\nsequence = 2'), r"drop\.sequence"),
        (("mass_mg = 1", "mass_mg = 2"), r"\[projectile\].*not that of D01"),
        (
            ('same_as = "D01"', 'same_as = "D01"\nheight_mm = 4.0\nheight_sigma_mm = 0.1'),
            r"drop\.height_mm.*D01 too.*count twice",
        ),
    ],
)
def test_a_record_of_another_drop_is_refused(change: tuple[str, str], words: str, campaign: Path) -> None:
    add_record(campaign, change)
    with pytest.raises(CampaignError, match=words):
        read_campaign(campaign)


def test_a_drop_filmed_twice_is_two_drops(campaign: Path) -> None:
    shutil.copytree(campaign / "drops/D01", campaign / "drops/D02")
    file = campaign / "drops/D02/drop.toml"
    file.write_text(file.read_text().replace("sequence = 3", 'same_as = "D01"'))
    with pytest.raises(CampaignError, match=r'record\.kind.*is "track" as in D01'):
        read_campaign(campaign)


def test_reading_changes_nothing(campaign: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in campaign.rglob("*")}
    read_campaign(campaign)
    assert {path: path.stat().st_mtime_ns for path in campaign.rglob("*")} == before
