"""Text files that are made to hurt: one line within 10 s of CPU and 2 GB, whatever they are."""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Callable
from pathlib import Path

import pytest
from attempts import attempt
from small_campaign import copy_campaign

import labsim
from labsim.errors import CampaignError
from labsim.text_files import INTEGERS, LARGEST_TOML, load_json, load_toml

NESTED = 100_000
CPU, WALL = 10, 60.0  # s; wall only guards against a command that waits for ever


@pytest.fixture(scope="module", autouse=True)
def loaded() -> None:
    """All of labsim, once here instead of in each forked command."""
    for module in pkgutil.walk_packages(labsim.__path__, "labsim."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)


def make_fifo(file: Path) -> None:
    file.unlink(missing_ok=True)
    os.mkfifo(file)


def link_to_a_device(file: Path) -> None:
    file.unlink(missing_ok=True)
    file.symlink_to("/dev/zero")


def make_folder(file: Path) -> None:
    file.unlink(missing_ok=True)
    file.mkdir()


def add(text: str) -> Callable[[Path], None]:
    def write(file: Path) -> None:
        before = file.read_text() if file.exists() else ""
        file.write_text(text + before if text.startswith("{") else before + "\n" + text)

    return write


HOSTILE: dict[str, Callable[[Path], None]] = {
    "fifo": make_fifo,
    "device": link_to_a_device,
    "folder": make_folder,
    "nested arrays": add("a = " + "[" * NESTED),
    "nested tables": add("a = " + "{a=" * NESTED),
    "a nested array that fits": add("a = " + "[" * 10_000 + "]" * 10_000),
    "a million keys": add("".join(f"k{k} = 1\n" for k in range(1_000_000))),
    "a key of dots": add(".".join("a" for _ in range(LARGEST_TOML // 2 - 2000)) + " = 1"),
    "an integer of 400 digits": add("a = " + "9" * 400),
    "an integer of 5000 digits": add("a = " + "9" * 5000),
    "zeros": lambda file: file.write_bytes(bytes(1 << 20)),
}
COMMANDS = {
    "campaign.toml": ("campaign/campaign.toml", ["check", "campaign", "-q"]),
    "drop.toml": ("campaign/drops/D05/drop.toml", ["check", "campaign", "-q"]),
    "drop.toml of track": (
        "campaign/drops/D05/drop.toml",
        ["track", "campaign/drops/D05", "-o", "out", "-q"],
    ),
    "scan.toml": ("campaign/ct/C01/scan.toml", ["ct", "campaign/ct/C01", "-o", "out", "-q"]),
    "model.toml": ("model.toml", ["simulate", "--model", "model.toml", "-o", "out", "-q"]),
    "effects": ("campaign/effects/own.py", ["effects", "campaign", "-q"]),
}


@pytest.mark.parametrize("hostile", HOSTILE)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_hostile_file_is_one_line(tmp_path: Path, name: str, hostile: str) -> None:
    if name == "effects" and hostile not in ("fifo", "device", "folder"):
        pytest.skip("Python, which is run as it is")
    root = tmp_path / "case"
    copy_campaign(root / "campaign")
    file, arguments = COMMANDS[name]
    (root / file).parent.mkdir(parents=True, exist_ok=True)
    HOSTILE[hostile](root / file)
    found = attempt(arguments, root, cpu_seconds=CPU, wall_seconds=WALL)
    assert found.status == 2 and not found.complaint(), found
    if "of track" not in name:  # where it is no file, its folder is taken for one of pictures
        assert Path(file).name in found.said


@pytest.mark.parametrize(
    "content",
    ["[" * NESTED, '{"made_by": ' * NESTED, "9" * 5000, '{"made_by": {"command": 1e999}}', "\0", "nul"],
)
def test_a_hostile_summary_is_one_line(tmp_path: Path, content: str) -> None:
    root = tmp_path / "case"
    (root / "result").mkdir(parents=True)
    (root / "result" / "run.json").write_text(content)
    found = attempt(["rerun", "result", "-o", "out", "-q"], root, cpu_seconds=CPU, wall_seconds=WALL)
    assert found.status == 2 and not found.complaint(), found
    assert "run.json" in found.said


def test_a_hostile_list_of_runs_is_not_read(tmp_path: Path) -> None:
    from labsim.runs.store import RunStore

    for hostile in ("[" * NESTED, "9" * 5000, '{"a": 1}'):
        (tmp_path / "index.json").write_text(hostile)
        assert RunStore(tmp_path).index() == []


def test_sound_files_are_read(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes(f'a = {INTEGERS - 1}\r\nb = [[1, 2], {{c = "ä"}}]\r\n'.encode())
    assert load_toml(file, CampaignError, "") == {"a": INTEGERS - 1, "b": [[1, 2], {"c": "ä"}]}
    file.write_text(f"[a]\nb = [1, [-{INTEGERS + 1}]]\n")
    with pytest.raises(CampaignError, match=r"a\.toml: a\.b: is an integer beyond 64 bits"):
        load_toml(file, CampaignError, "")
    with pytest.raises(CampaignError, match="no such file; write it"):
        load_json(tmp_path / "b.json", CampaignError, "write it")
