"""Some mutants of each reader in every run of the tests, by benchmarks/faults/mutants.py, which makes thousands; and those that
once ended otherwise than in one line."""

from __future__ import annotations

import importlib.util
import random
import zipfile
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest
from small_campaign import ROOT

from labsim.errors import MeasurementError
from labsim.tracks.tracker_project import read_points
from labsim.video.formats.folder import read_picture

EACH = 2


@pytest.fixture(scope="module")
def mutants() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mutants", ROOT / "benchmarks" / "faults" / "mutants.py")
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    made.load_labsim()
    return made


@pytest.fixture(scope="module")
def home(mutants: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("mutants") / "sound"
    made.mkdir()
    mutants.write_sound(made)
    return made


def test_mutants_of_every_reader(mutants: ModuleType, home: Path, tmp_path: Path) -> None:
    wrong = []
    for kind in mutants.KINDS:
        cpu = mutants.check_sound(kind, home, tmp_path / "case")
        for k in range(EACH):
            _found, complaint = mutants.try_mutant(
                kind, home, tmp_path / "case", random.Random(f"tests {kind} {k}"), cpu
            )
            wrong += [complaint] if complaint else []
    assert not wrong


def test_a_result_far_from_the_sound_one_is_found(mutants: ModuleType, tmp_path: Path) -> None:
    """The comparison itself: five standard deviations off without a word is silent, with a warning it is not."""
    import json

    def write(name: str, value: float, warnings: list[str]) -> Path:
        (tmp_path / name).mkdir(exist_ok=True)
        summary = {"depth_m": value, "depth_m_sigma": 1.0, "warnings": warnings}
        (tmp_path / name / "drop.json").write_text(json.dumps(summary))
        return tmp_path / name

    sound = write("sound", 10.0, [])
    assert "depth_m" in mutants.compare(sound, write("a", 15.0, []))
    assert mutants.compare(sound, write("a", 15.0, ["rows scatter"])) == ""
    assert mutants.compare(sound, write("a", 13.0, [])) == ""


def test_a_damaged_archive_of_tracker_is_one_line(tmp_path: Path) -> None:
    """Bytes taken out anywhere."""
    with zipfile.ZipFile(tmp_path / "a.trz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.trk", "<object class='x.TrackerPanel'>" + "<a>1</a>" * 200 + "</object>")
    content = (tmp_path / "a.trz").read_bytes()
    for at in range(0, len(content), 3):
        for kept in (
            content[:at],
            content[:at] + content[at + 5 :],
            content[:at] + b"\xff\x80" + content[at + 2 :],
        ):
            (tmp_path / "b.trz").write_bytes(kept)
            try:
                read_points(tmp_path / "b.trz")
            except MeasurementError as trouble:
                assert "\n" not in str(trouble)


def test_a_damaged_png_is_refused_by_its_checksums(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Before libpng says something of its own on standard error."""
    picture = np.random.default_rng(1).integers(0, 255, (40, 30)).astype(np.uint8)
    file = tmp_path / "a.png"
    cv2.imwrite(str(file), picture)
    assert np.array_equal(read_picture(file), picture)
    content = file.read_bytes()
    for at in range(60, len(content) - 20, 37):
        file.write_bytes(content[:at] + bytes([content[at] ^ 0x55]) + content[at + 1 :])
        with pytest.raises(MeasurementError, match=r"a\.png: picture: cannot be read"):
            read_picture(file)
    assert capfd.readouterr().err == ""


def test_a_table_that_ends_after_its_header_is_one_line(tmp_path: Path) -> None:
    from labsim.records import Camera
    from labsim.video import read_track

    (tmp_path / "a.txt").write_text("\tmass A\t\t\t\nt\tx\ty\tpixely\tframe\n")
    (tmp_path / "b.csv").write_text("frame,tip_row_px\n0,\n1,\n")
    for name in ("a.txt", "b.csv"):
        with pytest.raises(MeasurementError, match=name):
            read_track(tmp_path / name, Camera(1e4, 2e-5, 300.0, 0.1), 0.1)
