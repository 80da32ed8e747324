"""``labsim check`` on campaigns that are readable but wrong: what the data contradict is said, and what is sound is not."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile

from labsim.campaign import read_campaign
from labsim.cli import main
from labsim.cli import new as new_command
from labsim.errors import CampaignError
from labsim.inference.observations.observe import observe_drops
from labsim.inference.surface_rows import doubt_surface_rows

P01 = Path(__file__).parents[1] / "data" / "campaigns" / "p01"
CONTACT = 120  # frame of the first contact in D05 and D06, to a frame


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """D05 and D06 of a campaign without a fault."""
    folder = tmp_path / "c"
    for name in ("D05", "D06"):
        shutil.copytree(P01 / "drops" / name, folder / "drops" / name)
    shutil.copy(P01 / "campaign.toml", folder)
    return folder


def check(folder: Path, capsys: pytest.CaptureFixture[str], status: int = 0) -> dict:
    with pytest.raises(SystemExit) as left:
        main(["check", str(folder), "--json"])
    said = capsys.readouterr()
    assert int(left.value.code or 0) == status, said.err
    if status:
        assert len([line for line in said.err.splitlines() if line.startswith("error: ")]) == 1
    return {**json.loads(said.out), "error": said.err}


def change_rows(
    folder: Path, change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
) -> None:
    file = folder / "drops/D05/track.csv"
    table = np.loadtxt(file, delimiter=",", skiprows=1)
    frame, row = change(table[:, 0], table[:, 1])
    lines = "".join(f"{f:.0f},{r:.3f}\n" for f, r in zip(frame, row, strict=True))
    file.write_text("frame,tip_row_px\n" + lines)


def change_key(file: Path, key: str, change: Callable[[float], float]) -> None:
    text = file.read_text()
    found = re.search(rf"(?m)^{key} = ([\d.]+)", text)
    assert found is not None
    file.write_text(text[: found.start(1)] + f"{change(float(found[1])):.6g}" + text[found.end(1) :])


def lose(first: int, count: int) -> Callable:
    return lambda f, r: (
        np.delete(f, np.s_[first : first + count]),
        np.delete(r, np.s_[first : first + count]),
    )


def of(found: dict, name: str) -> list[str]:
    return [line for line in found["warnings"] if line.startswith(name)]


def test_a_drop_without_motion_is_bad_input(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_rows(campaign, lambda f, r: (f, r[::-1]))
    found = check(campaign, capsys, status=2)
    assert [line[:4] for line in found["unreadable"]] == ["D05:"]
    assert "drops/D05/track.csv: tip_row_px: starts below the surface" in found["error"]
    assert "D06" in found["measured"] and "m/s at contact" in found["text"], "the others are listed"
    assert "nothing is wrong with its files" not in found["text"]
    assert found["text"].endswith("1 of 2 drops and scans cannot be read; nothing else looks odd")


@pytest.mark.parametrize(
    "rows",
    [
        lambda f, r: (f, 600 - r),
        lambda f, r: (f, np.full(r.size, 310.0)),
        lambda f, r: (f[-1:], r[-1:]),
        lambda f, r: (f[-3:], r[-3:]),
        lambda f, r: (f[CONTACT + 4 :], r[CONTACT + 4 :]),
    ],
    ids=["upside down", "constant", "1 frame", "3 frames", "begins after contact"],
)
def test_rows_that_are_no_drop_are_bad_input(
    campaign: Path, capsys: pytest.CaptureFixture[str], rows: Callable
) -> None:
    change_rows(campaign, rows)
    assert check(campaign, capsys, status=2)["unreadable"]


def test_a_video_that_cannot_be_opened_is_bad_input(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drop = campaign / "drops/D05/drop.toml"
    drop.write_text(drop.read_text().replace('"track.csv"', '"fall.avi"').replace('"track"', '"video"'))
    (drop.parent / "fall.avi").write_bytes(b"RIFF\0\0\0\0AVI nothing")
    assert "fall.avi" in check(campaign, capsys, status=2)["error"]


def test_a_picture_in_the_middle_that_cannot_be_read_is_bad_input(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drop = campaign / "drops/D05/drop.toml"
    drop.write_text(drop.read_text().replace('"track.csv"', '"fall"').replace('"track"', '"video"'))
    (drop.parent / "fall").mkdir()
    for number in range(12):
        tifffile.imwrite(drop.parent / f"fall/{number:03d}.tif", np.full((8, 8), number, np.uint8))
    assert "video of 12 frames" in check(campaign, capsys)["text"]
    written = drop.read_text()
    for line, said in (
        ("region_px = [0, 0, 8, 7]", "[0, 0, 8, 7] is not inside the picture; columns go to 7, rows to 7"),
        ("frames_left_out = [12]", "12 is no frame of the record; its frames are 0 to 11"),
    ):
        drop.write_text(written.replace("[record]", f"[record]\n{line}"))
        assert said in check(campaign, capsys, status=2)["error"]
    drop.write_text(written)
    (drop.parent / "fall/007.tif").write_bytes(b"II*\0")
    assert "007.tif" in check(campaign, capsys, status=2)["error"]


def test_a_slice_that_cannot_be_read_is_bad_input_and_the_drops_are_listed(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = campaign / "ct/C01"
    (scan / "slices").mkdir(parents=True)
    (scan / "scan.toml").write_text(new_command.SCAN)
    for number in range(10):
        (scan / f"slices/{number:03d}.tif").write_bytes(b"II*\0")
    found = check(campaign, capsys, status=2)
    assert "000.tif" in found["error"] and found["unreadable"][0].startswith("C01: ")
    assert {"D05", "D06", "C01"} == set(found["measured"])


def test_the_same_file_twice_is_refused(campaign: Path) -> None:
    shutil.copytree(campaign / "drops/D05", campaign / "drops/D07")
    change_key(campaign / "drops/D07/drop.toml", "sequence", lambda v: v + 90)
    with pytest.raises(
        CampaignError, match=r"D07.*record\.file: .*same 167 rows as .*D05.*track\.csv of D05.*remove"
    ):
        read_campaign(campaign)
    # a record outside its drop is that other drop's
    drop = campaign / "drops/D07/drop.toml"
    drop.write_text(drop.read_text().replace('"track.csv"', '"../D06/track.csv"'))
    with pytest.raises(CampaignError, match=r"of D06"):
        read_campaign(campaign)


def test_the_same_video_twice_is_refused(campaign: Path) -> None:
    for name in ("D05", "D06"):
        drop = campaign / "drops" / name / "drop.toml"
        drop.write_text(drop.read_text().replace('"track.csv"', '"fall.avi"').replace('"track"', '"video"'))
        (drop.parent / "fall.avi").write_bytes(b"one and the same")
    with pytest.raises(CampaignError, match=r"D06.*record\.file: .*same bytes as .*fall\.avi of D05"):
        read_campaign(campaign)


def test_the_same_slices_twice_are_refused(campaign: Path) -> None:
    for name in ("C01", "C02"):
        (campaign / "ct" / name / "slices").mkdir(parents=True)
        (campaign / "ct" / name / "scan.toml").write_text(new_command.SCAN)
        for number in range(3):
            tifffile.imwrite(
                campaign / "ct" / name / f"slices/{number}.tif", np.full((4, 4), number, np.uint8)
            )
    with pytest.raises(CampaignError, match=r"C02.*scan\.slices: .*of C01"):
        read_campaign(campaign)
    tifffile.imwrite(campaign / "ct/C02/slices/1.tif", np.full((4, 4), 9, np.uint8))
    assert len(read_campaign(campaign).scans) == 2


@pytest.mark.parametrize(
    "rewrite",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: re.sub(r"(?m)^(\d+),(.*)$", r"\1,\g<2>00", text),
        lambda text: re.sub(r"(?m)^(\d+),", lambda m: f"{int(m[1]) + 1000},", text),
    ],
    ids=["line ends", "digits", "frame numbers"],
)
def test_the_same_rows_twice_are_refused_however_they_are_written(
    campaign: Path, rewrite: Callable[[str], str]
) -> None:
    shutil.copytree(campaign / "drops/D05", campaign / "drops/D07")
    change_key(campaign / "drops/D07/drop.toml", "sequence", lambda v: v + 90)
    track = campaign / "drops/D07/track.csv"
    track.write_bytes(rewrite(track.read_text()).encode())
    with pytest.raises(CampaignError, match=r"D07.*record\.file: .*same 167 rows as .* of D05"):
        read_campaign(campaign)


def test_missing_frames_are_named_with_where_they_are(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change_rows(campaign, lose(CONTACT - 15, 30))
    odd = of(check(campaign, capsys), "D05")
    assert any("30 frames (107-136) are missing about contact" in line for line in odd)


def test_missing_frames_in_free_fall_and_in_the_dust(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change_rows(
        campaign, lambda f, r: lose(50, 5)(*lose(CONTACT + 5, 4)(f, r))
    )  # from behind, so that places stay
    odd = of(check(campaign, capsys), "D05")
    assert any("5 frames" in line and "in free fall" in line for line in odd)
    assert any("4 frames" in line and "while the projectile is stopped" in line for line in odd)


def test_two_drops_in_one_track_are_seen(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_rows(campaign, lambda f, r: (np.arange(2 * f.size), np.concatenate([r, r])))
    assert any("two impacts in one track" in line for line in of(check(campaign, capsys), "D05"))


def test_a_hop_after_the_stop_is_seen(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    s = lambda f: np.clip((f - CONTACT - 22) / 30, 0, 1)  # noqa: E731
    change_rows(campaign, lambda f, r: (f, r - 48 * s(f) * (1 - s(f))))
    assert any("falls again" in line for line in of(check(campaign, capsys), "D05"))


@pytest.mark.parametrize(("at", "count"), [(60, 1), (CONTACT + 3, 2)], ids=["free fall", "in the dust"])
def test_frames_lost_without_a_gap_in_the_numbers_are_said_once(
    campaign: Path, capsys: pytest.CaptureFixture[str], at: int, count: int
) -> None:
    """And not as a wrong surface, a wrong scale or a jump as well: everything else is judged with the clock put right."""
    sound = check(campaign, capsys)["measured"]["D05"]
    change_rows(campaign, lambda f, r: (f[:-count], np.delete(r, np.s_[at : at + count])))
    found = check(campaign, capsys)
    (line,) = of(found, "D05")
    said = re.search(r"(\d) frames? (?:is|are) missing before frame (\d+)", line)
    assert said is not None and int(said[1]) == count and abs(int(said[2]) - at) <= 3
    assert found["measured"]["D05"]["stopping_time_s"] == pytest.approx(sound["stopping_time_s"], rel=0.005)


def test_a_jump_of_the_camera_is_seen(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_rows(campaign, lambda f, r: (f, r - 5.0 * (np.arange(r.size) >= 100)))
    odd = [line for line in of(check(campaign, capsys), "D05") if "the row jumps by -" in line]
    place = re.search(r"between frames (\d+) and (\d+)", odd[0])
    assert place is not None and abs(int(place[2]) - 101) <= 2


@pytest.mark.parametrize("put_in", [True, False], ids=["put in", "in place of others"])
def test_doubled_pictures_are_said_once(
    campaign: Path, capsys: pytest.CaptureFixture[str], put_in: bool
) -> None:
    """And not as outliers, a second impact or a wrong scale as well; depth and stopping time stay what they are."""
    at = CONTACT + 3
    sound = check(campaign, capsys)["measured"]["D05"]

    def double(frame: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if put_in:
            frame = np.concatenate([frame[:at], frame[at] + np.arange(3), frame[at:] + 3])
            return frame, np.insert(row, at, [row[at]] * 3)
        row = row.copy()
        row[at + 1 : at + 4] = row[at]
        return frame, row

    change_rows(campaign, double)
    found = check(campaign, capsys)
    (line,) = of(found, "D05")
    assert "repeat the row before" in line and ("moved back by 3" if put_in else "in place of others") in line
    for key in ("stopping_time_s", "penetration_depth_m"):
        assert found["measured"]["D05"][key] == pytest.approx(sound[key], rel=0.005)


def test_spikes_and_whole_pixels_are_no_jumps(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def spoil(frame: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        row = np.round(row)
        row[[40, 90, CONTACT + 5]] += 60
        return frame, row

    change_rows(campaign, spoil)
    assert not any("the row jumps" in line for line in of(check(campaign, capsys), "D05"))


@pytest.mark.parametrize("off", [10.0, -10.0])
def test_a_surface_row_that_the_rows_contradict_is_named_with_theirs(
    campaign: Path, capsys: pytest.CaptureFixture[str], off: float
) -> None:
    change_key(campaign / "drops/D05/drop.toml", "surface_row_px", lambda v: v + off)
    found = check(campaign, capsys)
    odd = [line for line in found["warnings"] if "the rows put the surface at row" in line]
    assert len(odd) == 1 and odd[0].startswith("D05: ")
    row, sigma = map(float, re.findall(r"row ([\d.]+) ± ([\d.]+) px", odd[0])[0])
    assert abs(row - 297.53) < 3 * sigma and sigma < 2
    assert doubt_surface_rows(observe_drops(read_campaign(campaign))[0]) == [f"drop {odd[0]}"], (
        "calibrate and diagnose say it too"
    )


def test_the_surface_row_is_not_blamed_for_a_wrong_scale(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("D05", "D06"):
        change_key(campaign / "drops" / name / "drop.toml", "pixel_size_um", lambda v: 1.06 * v)
    found = check(campaign, capsys)
    assert any("g = 10.3" in line for line in found["warnings"])
    assert not any("surface" in line for line in found["warnings"])


@pytest.mark.parametrize(("key", "factor"), [("mass_mg", 2.0), ("tip_radius_mm", 1.5)])
def test_a_drop_that_takes_another_work_than_the_others_is_odd(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], key: str, factor: float
) -> None:
    folder = tmp_path / "c"
    for name in ("D03", "D05", "D06", "D07", "D09", "D13", "D14"):
        shutil.copytree(P01 / "drops" / name, folder / "drops" / name)
    shutil.copy(P01 / "campaign.toml", folder)
    assert check(folder, capsys)["warnings"] == []
    change_key(folder / "drops/D06/drop.toml", key, lambda v: factor * v)
    found = check(folder, capsys)["warnings"]
    assert (
        len(found) == 1
        and found[0].startswith("D06: ")
        and key in found[0]
        and "the work per volume" in found[0]
    )


def test_one_drop_of_another_camera_is_not_the_fault_of_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "c"
    for name in ("D03", "D05", "D06", "D07", "D13"):
        shutil.copytree(P01 / "drops" / name, folder / "drops" / name)
    shutil.copy(P01 / "campaign.toml", folder)
    change_key(folder / "drops/D06/drop.toml", "frame_rate_Hz", lambda v: v / 2)
    found = check(folder, capsys)
    assert found["warnings"] and len(of(found, "D06")) == len(found["warnings"])
    assert any("free flight falls with 2.45" in line for line in found["warnings"])


def test_the_order_is_there_cannot_be_read_odd_missing(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change_rows(campaign, lambda f, r: (f, r[::-1]))
    change_key(campaign / "drops/D06/drop.toml", "height_mm", lambda v: 2 * v)
    lines = check(campaign, capsys, status=2)["text"].splitlines()
    titles = [line for line in lines if line in ("there:", "cannot be read:", "odd:", "missing:")]
    assert titles == ["there:", "cannot be read:", "odd:", "missing:"]
