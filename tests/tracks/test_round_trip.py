"""A track that labsim wrote is a track that labsim reads: video -> labsim track -> a campaign -> check, observe, track."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tifffile
from campaign_files import CAMPAIGN, DROP, fill_in

from labsim.campaign import read_campaign
from labsim.cli import main
from labsim.inference.observations.observe import observe_drops, read_observed_track
from labsim.video import open_frames

DATA = Path(__file__).parents[2] / "data" / "video"
# file, frame rate (Hz), pixel size (µm), pictures; the shipped .cine files and the still particles give no track
FALLS = {
    "h264, crf 23": (DATA / "h264/h264_0_crf23.mp4", 10000, 20.0, None),
    "a folder of TIFF": (
        DATA / "rendered_drops/ffv1/video.avi",
        10000,
        20.0,
        None,
    ),  # its pictures, saved one by one
}
LONG = {
    **{f"h264 {name}": (DATA / f"h264/h264_{name}.mp4", 10000, 20.0, None)
       for name in ("crf23", "crf28", "crf35", "0_crf28", "0_crf35")},
    **{f"rendered {name}": (DATA / f"rendered_drops/{name}/video.avi", 10000, 20.0, None)
       for name in ("ffv1", "mjpeg", "mjpeg_3mm")},
}  # fmt: skip
NO_CONTACT = (DATA / "ball_drop_120fps/ball_drop.mp4", 120, 500.0, "118-201")


def call(*arguments: object) -> None:
    with pytest.raises(SystemExit) as left:
        main([str(each) for each in arguments])
    assert left.value.code in (0, None)


def put_into_a_campaign(track: Path, folder: Path, **camera: float) -> Path:
    (folder / "drops/D01").mkdir(parents=True)
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "drops/D01/drop.toml").write_text(fill_in(DROP, **camera))
    (folder / "drops/D01/track.csv").write_bytes(track.read_bytes())
    return folder


def go_round(video: Path, rate: float, pixel: float, part: str | None, place: Path, capsys) -> tuple:  # type: ignore[no-untyped-def]
    """(drop.json of the video, campaign, drop.json of the track in it)"""
    more = ("--frames", part) if part else ()
    call("track", video, "--fps", rate, "--pixel-um", pixel, *more, "-o", place / "out", "-q")
    first = json.loads((place / "out/drop.json").read_text())
    folder = put_into_a_campaign(
        place / "out/track.csv",
        place / "campaign",
        frame_rate_Hz=float(rate),
        pixel_size_um=pixel,
        surface_row_px=first["surface_row_px"] or 1000.0,
    )
    call("track", folder / "drops/D01", "-o", place / "again", "-q")
    capsys.readouterr()
    return first, folder, json.loads((place / "again/drop.json").read_text())


def compare(video: Path, rate: float, pixel: float, part: str | None, place: Path, capsys) -> int:  # type: ignore[no-untyped-def]
    """Frames without a position."""
    first, folder, again = go_round(video, rate, pixel, part, place, capsys)
    written = pd.read_csv(place / "out/track.csv")
    campaign = read_campaign(folder)
    read = read_observed_track(campaign.drops[0])
    assert np.array_equal(read.frame, written["frame"])
    assert np.array_equal(read.valid, written["tip_row_px"].notna())
    assert np.allclose(read.tip_row, written["tip_row_px"], equal_nan=True, rtol=1e-8)
    assert np.allclose(read.time, written["time_s"], rtol=1e-8)
    for key in ("impact_speed_m_s", "penetration_depth_m", "stopping_time_s"):
        # None: the record ends before the projectile stops
        assert again[key] == first[key] or again[key] == pytest.approx(first[key], rel=1e-3), key
    seen, left_out = observe_drops(campaign)
    assert len(seen) == 1 and left_out == [] and seen[0].depth.max() > 2e-4
    call("check", folder, "--json")
    numbers = json.loads(capsys.readouterr().out)["measured"]["D01"]
    assert numbers["impact_speed_m_s"] == pytest.approx(first["impact_speed_m_s"], rel=5e-3)
    return int(np.sum(~read.valid))


@pytest.mark.parametrize("name", FALLS)
def test_there_and_back(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    video, *given = FALLS[name]
    if name == "a folder of TIFF":
        (tmp_path / "pictures").mkdir()
        for number, picture in enumerate(open_frames(video)):
            tifffile.imwrite(tmp_path / "pictures" / f"{number:04d}.tif", picture)
        video = tmp_path / "pictures"
    empty = compare(video, *given, tmp_path, capsys)
    assert name != "h264, crf 23" or empty == 11, "the way back is worth a test for the frames without a row"


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_there_and_back_with_every_video(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    compare(*LONG[name], tmp_path, capsys)


@pytest.mark.slow
def test_a_fall_without_a_contact_there_and_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """263 of 327 rows of the whole film are empty; these 84 pictures have some, too."""
    first, folder, _again = go_round(*NO_CONTACT, tmp_path, capsys)
    assert first["penetration_depth_m"] is None
    read = read_observed_track(read_campaign(folder).drops[0])
    assert 0 < (~read.valid).sum() < len(read.valid)
