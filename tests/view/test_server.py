"""What the page's server answers and refuses, and what a correction leaves in the files."""

from __future__ import annotations

import os
import time
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient
from view_pages import DROP_TOML

from labsim.campaign import read_drop, read_scan
from labsim.cli import main
from labsim.errors import CampaignError, LabsimError
from labsim.view import make_app, open_path
from labsim.view.edits import Edits
from labsim.view.scan import ScanView

TOKEN = "a-token"


def connect(path: Path) -> TestClient:
    return TestClient(make_app(open_path(path), TOKEN), base_url="http://127.0.0.1")


def measure(client: TestClient) -> dict:
    assert client.post(f"/{TOKEN}/measure").status_code == 200
    for _ in range(600):
        state = client.get(f"/{TOKEN}/state").json()
        if state["busy"] is None:
            return state
        time.sleep(0.1)
    raise AssertionError("never ends")


def edit(client: TestClient, changes: dict):  # type: ignore[no-untyped-def]
    return client.post(f"/{TOKEN}/edit", json=changes)


def test_nothing_is_answered_without_the_token(drop: Path) -> None:
    client = connect(drop)
    for path in ("/", "/state", "/wrong/", "/wrong/state", "/wrong/picture/0", "/wrong/page/viewer.js"):
        assert client.get(path).status_code in (403, 404), path
    before = (drop / "drop.toml").read_bytes()
    for action in ("edit", "save", "undo", "measure"):
        assert client.post(f"/wrong/{action}", json={"camera.surface_row_px": 1.0}).status_code == 403
    assert client.get(f"/{TOKEN}/state").json()["can_undo"] is False
    assert (drop / "drop.toml").read_bytes() == before
    # a name of another site that leads to this machine
    assert client.get(f"/{TOKEN}/state", headers={"host": "labsim.example"}).status_code == 400
    # reading does nothing
    assert client.get(f"/{TOKEN}/save").status_code == 405


def test_pages_ask_nothing_of_others(drop: Path) -> None:
    client = connect(drop)
    page = client.get(f"/{TOKEN}/")
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert page.headers["referrer-policy"] == "no-referrer"
    for name in ("viewer.js", "output.js", "style.css"):
        answer = client.get(f"/{TOKEN}/page/{name}")
        assert answer.status_code == 200 and "http" not in answer.text
    for name in ("../server.py", "..%2Fserver.py", "viewer.html.bak", "%2Fetc%2Fpasswd"):
        assert client.get(f"/{TOKEN}/page/{name}").status_code == 404


def test_frames_and_track_of_a_video(drop: Path) -> None:
    client = connect(drop)
    state = measure(client)
    assert state["trouble"] == "" and state["stale"] is False
    found, (height, width) = state["measured"], state["shape"]
    assert len(found["row"]) == len(state["numbers"])
    answer = client.get(f"/{TOKEN}/picture/20")
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (height, width)
    # just above the tip is the dark rod, just below it the light
    i = next(k for k, row in enumerate(found["row"]) if row is not None and 60 < row < 250)
    picture = cv2.imdecode(
        np.frombuffer(client.get(f"/{TOKEN}/picture/{i}").content, np.uint8), cv2.IMREAD_GRAYSCALE
    )
    row, column = round(found["row"][i]), round(found["column"][i])
    assert float(picture[row - 6, column]) < 0.6 * float(picture[row + 6, column])
    assert client.get(f"/{TOKEN}/picture/100000").status_code == 404


def test_corrections_are_written_in_the_words_of_the_file(drop: Path) -> None:
    client, file = connect(drop), drop / "drop.toml"
    before = file.read_text()
    assert edit(client, {"camera.surface_row_px": 301.25}).json()["saved"] is False
    state = edit(client, {"record.frames_left_out": [3, 5], "record.region_px": [2, 0, 90, 330]}).json()
    assert state["left_out"] == [3, 5] and state["region"] == [2, 0, 90, 330]
    assert file.read_text() == before, "nothing is written before it is saved"
    assert client.post(f"/{TOKEN}/save").json()["saved"] is True
    saved = file.read_text()
    assert saved == before.replace("= 299.71  # by eye", "= 301.25  # by eye") + (
        "frames_left_out = [3, 5]\nregion_px = [2, 0, 90, 330]\n"
    )
    read = read_drop(drop)
    assert read.camera is not None and read.camera.surface_row == 301.25
    assert read.record.left_out == (3, 5) and read.record.region == (2, 0, 90, 330)
    for _ in range(2):
        state = client.post(f"/{TOKEN}/undo").json()
    assert state["can_undo"] is False and state["saved"] is False
    client.post(f"/{TOKEN}/save")
    assert file.read_text() == before
    assert sorted(os.listdir(drop)) == [
        "drop.toml",
        "video.avi",
    ]


def test_what_the_campaign_refuses_is_refused_and_forgotten(drop: Path) -> None:
    client = connect(drop)
    for changes, words in (
        ({"camera.pixel_size_um": -1.0}, "camera.pixel_size_um: -1 is negative"),
        ({"record.region_px": [5, 5, 1, 1]}, "has no area"),
        ({"record.frames_left_out": ["a"]}, "is not a number"),
        ({"projectile.mass_mg": 1.0}, "is not corrected here"),
        ({"record.file": "/etc/passwd"}, "is not corrected here"),
    ):
        answer = edit(client, changes)
        assert answer.status_code == 400 and words in answer.json()["trouble"], changes
    assert client.post(f"/{TOKEN}/edit", content=b"[1]").status_code == 400
    assert client.post(f"/{TOKEN}/edit", content=b"{" * 100_000).status_code == 413
    assert client.get(f"/{TOKEN}/state").json()["can_undo"] is False
    # what only the record can tell is said when it is measured
    edit(client, {"record.frames_left_out": [99999]})
    assert "99999 is no frame of the record" in measure(client)["trouble"]


def test_a_file_that_another_program_changed_is_not_overwritten(drop: Path) -> None:
    client, file = connect(drop), drop / "drop.toml"
    edit(client, {"camera.surface_row_px": 301.25})
    file.write_text(file.read_text() + "# mine\n")
    answer = client.post(f"/{TOKEN}/save")
    assert answer.status_code == 400 and "changed by another program" in answer.json()["trouble"]
    assert file.read_text().endswith("# mine\n")


@pytest.mark.parametrize(
    ("camera", "after"),
    [
        ("[camera]\r\nsurface_row_px = 1.5 # a\r\n", "[camera]\r\nsurface_row_px = 2.5 # a\r\n"),
        ("camera = { surface_row_px = 1.5 } # a\n", "camera = { surface_row_px = 2.5 } # a\n"),
        ("camera.surface_row_px = 1.5 # a\n", "camera.surface_row_px = 2.5 # a\n"),
        ("[a]\nb = 1\n", "[a]\nb = 1\n\n[camera]\nsurface_row_px = 2.5\n"),
        ("[a]\nb = 1 # no end", None),
    ],
)
def test_every_way_to_write_toml_is_kept(tmp_path: Path, camera: str, after: str | None) -> None:
    file = tmp_path / "drop.toml"
    file.write_bytes(camera.encode())
    file.chmod(0o640)
    edits = Edits(file)
    edits.put({"camera.surface_row_px": 2.5})
    edits.save()
    if after is not None:
        assert file.read_bytes().decode() == after
    assert tomllib.loads(file.read_text())["camera"]["surface_row_px"] == 2.5
    assert file.stat().st_mode & 0o777 == 0o640
    edits.undo()
    edits.save()
    assert file.read_bytes().decode() == camera
    file.unlink()
    edits.put({"camera.surface_row_px": 3.5})
    with pytest.raises(CampaignError, match="cannot be written"):
        edits.save()


def test_a_track_without_pictures(drop: Path) -> None:
    rows = "".join(f"{k},{200 + 2.0 * k + 0.0981 * k * k / 2}\n" for k in range(40))
    (drop / "track.csv").write_text("frame,tip_row_px\n" + rows)
    text = DROP_TOML.replace("video.avi", "track.csv").replace('"video"', '"track"')
    (drop / "drop.toml").write_text(text)
    client = connect(drop)
    edit(client, {"record.frames_left_out": [7]})
    state = measure(client)
    assert state["shape"] is None and state["numbers"] == []
    assert state["measured"]["reason"][7] == "left out in drop.toml", state["trouble"]
    assert client.get(f"/{TOKEN}/picture/0").status_code == 404
    assert edit(client, {"record.region_px": [0, 0, 9, 9]}).status_code == 400


def test_pictures_in_a_folder_keep_the_gaps_in_their_numbers(tmp_path: Path) -> None:
    for number in (3, 4, 6):
        cv2.imwrite(str(tmp_path / f"f{number:03d}.png"), np.full((20, 30), 10 * number, np.uint8))
    client = connect(tmp_path)
    state = measure(client)
    assert state["numbers"] == [0, 1, 3] and state["shape"] == [20, 30]
    assert state["trouble"] and state["measured"] is None
    assert client.get(f"/{TOKEN}/picture/2").status_code == 200


def test_a_fault_of_labsim_does_not_keep_the_page_waiting(
    scan: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(self: ScanView) -> dict:
        raise ZeroDivisionError

    monkeypatch.setattr(ScanView, "_measure", fail)
    monkeypatch.setattr("threading.excepthook", lambda told: None)
    assert "the terminal says why" in measure(connect(scan))["trouble"]


def test_what_is_corrected_is_measured(drop: Path) -> None:
    client = connect(drop)
    first = measure(client)["measured"]
    edit(client, {"camera.pixel_size_um": 22.0, "record.frames_left_out": [4]})
    assert client.get(f"/{TOKEN}/state").json()["stale"] is True
    after = measure(client)["measured"]
    assert after["reason"][4] == "left out in drop.toml" and after["row"][4] is None
    speed = [float(dict(each["lines"])["impact speed"].split(" ")[0]) for each in (first, after)]
    assert speed[1] / speed[0] == pytest.approx(1.1, abs=0.01)


def test_a_video_without_a_drop_has_nothing_to_save_in(drop: Path) -> None:
    (drop / "drop.toml").unlink()
    client = connect(drop / "video.avi")
    assert any("no curve: pixel size" in text for text in measure(client)["measured"]["warnings"])
    edit(client, {"camera.frame_rate_Hz": 10000.0, "camera.pixel_size_um": 20.0})
    state = measure(client)
    assert state["trouble"] == "" and "penetration depth" in dict(state["measured"]["lines"])
    assert edit(client, {"camera.frame_rate_Hz": 1.0}).status_code == 400
    answer = client.post(f"/{TOKEN}/save")
    assert answer.status_code == 400 and "labsim new" in answer.json()["trouble"]


def test_a_scan_is_shown_corrected_and_reduced_again(scan: Path) -> None:
    client, file = connect(scan), scan / "scan.toml"
    before = file.read_text()
    state = measure(client)
    found = state["measured"]
    assert found["axis"] == pytest.approx([43.3, 40.6], abs=0.1) and state["shape"] == [84, 84]
    dust = client.get(f"/{TOKEN}/grey", params={"slice": 75, "column": 20, "row": 20}).json()
    assert dust["filling_factor"] == pytest.approx(0.15, abs=0.02)
    assert client.get(f"/{TOKEN}/grey", params={"slice": 75, "column": 900, "row": 20}).status_code == 404
    assert client.get(f"/{TOKEN}/grey", params={"slice": "nan", "column": 2, "row": 2}).status_code == 404
    assert len(client.get(f"/{TOKEN}/picture/40").content) > 1000
    assert client.get(f"/{TOKEN}/picture/80").status_code == 404
    edit(
        client,
        {"scan.axis_px": [42.0, 41.0], "calibration.grey_air": read_scan(scan).calibration.grey_air - 1},
    )
    assert measure(client)["measured"]["axis"] == [42.0, 41.0]
    client.post(f"/{TOKEN}/save")
    assert tomllib.loads(file.read_text())["scan"]["axis_px"] == [42.0, 41.0]
    assert read_scan(scan).axis == (42.0, 41.0)
    client.post(f"/{TOKEN}/undo")
    client.post(f"/{TOKEN}/save")
    assert file.read_text() == before


def test_only_files_of_the_output_are_sent(output: Path) -> None:
    client = connect(output)
    state = client.get(f"/{TOKEN}/state").json()
    assert state["files"] == ["report.html", "drop.json", "D01/curve.csv"]
    report = client.get(f"/{TOKEN}/files/report.html")
    assert "plain" in report.text and "sandbox allow-scripts" in report.headers["content-security-policy"]
    assert client.get(f"/{TOKEN}/files/D01/curve.csv").text.startswith("time_s")
    (output / "link.json").symlink_to(output.parent / "outside.json")
    for name in (
        "../outside.json", "..%2Foutside.json", "%2e%2e/outside.json", "D01/../../outside.json", "secret.key", "link.json",
        str(output.parent / "outside.json"), "%2Fetc%2Fpasswd", "", "D01",
    ):  # fmt: skip
        assert client.get(f"/{TOKEN}/files/{name}").status_code == 404, name
    assert client.get("/wrong/files/drop.json").status_code == 403
    assert client.post(f"/{TOKEN}/save").status_code in (404, 405)


def test_what_cannot_be_shown_is_said(
    tmp_path: Path, output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "campaign.toml").write_text("")
    for path, words in ((tmp_path, "is a whole campaign"), (tmp_path / "none", "does not exist")):
        with pytest.raises(LabsimError, match=words):
            open_path(path)
    with pytest.raises(SystemExit):
        main(["view", str(tmp_path / "none"), "--no-browser"])
    assert "error: " in capsys.readouterr().err


def test_a_missing_extra_is_said(
    output: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import importlib.util

    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "uvicorn" else found(name))
    with pytest.raises(SystemExit):
        main(["view", str(output), "--no-browser"])
    assert "error: labsim view: uvicorn: not installed; pip install 'labsim[view]'" in capsys.readouterr().err
