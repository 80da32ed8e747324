"""The tutorial's commands, in its order, in an empty folder: every output as on the page.

With LABSIM_REWRITE_DOCS=1 the outputs and the pictures of the page are written anew.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest

from labsim.cli import main

ROOT = Path(__file__).parents[2]
FILE = ROOT / "docs/tutorial.md"
PAGE = FILE.read_text(encoding="utf-8")
REWRITE = bool(os.environ.get("LABSIM_REWRITE_DOCS"))
NUMBER = re.compile(r"\d+(?:\.\d+)?")
OF_THE_MACHINE = re.compile(r"new runs, .* from the store")  # counts what others have run before, and seconds
SMALL = re.compile(r"^0\.0\d\d  ")  # causes that are all but excluded: their order is chance


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    captured = capsys.readouterr()
    assert left.value.code == 0, captured.err
    return captured.out


def find_output(command: str) -> str:
    """The indented lines that the page prints after a command."""
    found = re.search(
        rf"^```\n{re.escape(command)}\n```\n\n(?:[^ \n].*\n+)*?((?:    .*\n|\n(?=    ))+)", PAGE, re.MULTILINE
    )
    assert found, command
    return found[1]


def keep_or_compare(command: str, said: str) -> None:
    """Words as on the page; numbers within a tenth, since the last digits of a run depend on the processor."""
    global PAGE
    block = find_output(command)
    if REWRITE:
        new = "\n".join(f"    {line}".rstrip() for line in said.strip("\n").splitlines()) + "\n"
        PAGE = PAGE.replace(block, new)
        FILE.write_text(PAGE, encoding="utf-8")
        return

    def tidy(text: str) -> list[str]:
        lines = [line.strip() for line in text.splitlines()]
        return [each for each in lines if each and not OF_THE_MACHINE.search(each) and not SMALL.match(each)]

    printed, expected = tidy(said), tidy(block)
    assert [NUMBER.sub("#", line) for line in printed] == [NUMBER.sub("#", line) for line in expected]
    for ours, theirs in zip(
        NUMBER.findall("\n".join(printed)), NUMBER.findall("\n".join(expected)), strict=True
    ):
        assert float(ours) == pytest.approx(float(theirs), rel=0.1, abs=0.05), (ours, theirs)


def keep_picture(source: str, name: str) -> None:
    """A picture of the page, drawn by the command before."""
    assert Path(source).is_file()
    if REWRITE:
        shutil.copy(source, ROOT / "docs/pictures" / name)


def test_from_an_empty_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], shared_store: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LABSIM_STORE", shared_store)
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
    assert "0.663 mm deep" in said and "g = 9.25 ± 0.01 m/s²" in said
    keep_or_compare("labsim check my-drops", said)
    keep_or_compare("labsim track my-drops/drops/D04", run(capsys, "track", "my-drops/drops/D04"))
    keep_picture("my-drops-D04-track/track.png", "tutorial-track.png")
    said = run(capsys, "diagnose", "my-drops")
    assert "the pixels are larger than stated" in said
    keep_or_compare("labsim diagnose my-drops", said)
    keep_picture("my-drops-diagnose/drops.png", "tutorial-drops.png")
    for file in Path("my-drops/drops").glob("*/drop.toml"):
        text, count = re.subn(
            r"^pixel_size_um = [\d.]+", "pixel_size_um = 21.2", file.read_text(), flags=re.MULTILINE
        )
        assert count == 1
        file.write_text(text)
    said = run(capsys, "diagnose", "my-drops", "--out", "after")
    assert "nothing in the catalogue is needed" in said
    keep_or_compare("labsim diagnose my-drops --out after", said)
    keep_picture("after/causes.png", "tutorial-causes.png")
