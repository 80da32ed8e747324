"""The tutorial's commands, in its order, in an empty folder, up to the first that simulates; numbers as on the page."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from labsim.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    captured = capsys.readouterr()
    assert left.value.code == 0, captured.err
    return captured.out


def test_from_an_empty_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^```\n(.*?)\n```", PAGE, re.MULTILINE | re.DOTALL)
    assert commands == [
        "labsim new my-drops", "rm -r my-drops/ct", "labsim check my-drops", "labsim track my-drops/drops/D04",
        "labsim diagnose my-drops", "labsim diagnose my-drops --out after",
    ]  # fmt: skip
    run(capsys, "new", "my-drops")
    shutil.rmtree("my-drops/ct")
    rows = re.findall(
        r"^\| `drops/(D\d\d)` \| `(D\d\d)` \| (\d+) \| ([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE
    )
    common = dict(re.findall(r"`(\w+) = ([\d.]+)`", PAGE.split("write these values")[1].split("in all")[0]))
    assert len(rows) == 4 and len(common) == 5
    blank = Path("my-drops/drops/D01/drop.toml").read_text()
    for name, source, sequence, height, surface in rows:
        folder = Path("my-drops/drops") / name
        folder.mkdir(exist_ok=True)
        text = blank
        for key, value in {
            **common,
            "sequence": sequence,
            "height_mm": height,
            "surface_row_px": surface,
        }.items():
            text, count = re.subn(rf"^{key} = [\d.]+", f"{key} = {value}", text, flags=re.MULTILINE)
            assert count == 1, key
        (folder / "drop.toml").write_text(text)
        shutil.copy(ROOT / "data/campaigns/p06/drops" / source / "track.csv", folder)
    said = run(capsys, "check", "my-drops")
    for number in ("0.663 mm deep", "g = 9.25 ± 0.01 m/s²"):
        assert number in said and number in PAGE
    for line in said.splitlines():
        assert line.strip() in PAGE, line
    said = run(capsys, "track", "my-drops/drops/D04")
    for line in said.splitlines()[:-1]:  # the last one names the folder
        assert line.strip() in PAGE, line
