"""A campaign of two drops, and commands in processes of their own that can be killed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CAMPAIGNS = ROOT / "data" / "campaigns"
Begin = Callable[..., "subprocess.Popen[str]"]


def copy_campaign(target: Path, drops: tuple[str, ...] = ("D05", "D06")) -> Path:
    """Some drops of the labelled campaign p01."""
    source = CAMPAIGNS / "p01"
    target.mkdir(parents=True)
    shutil.copy(source / "campaign.toml", target)
    for name in drops:
        shutil.copytree(source / "drops" / name, target / "drops" / name)
    return target


def add_videos_and_scans(campaign: Path, videos: int = 2, scans: int = 2) -> Path:
    """The same rendered drop and the same labelled scan, under several names."""
    for k in range(videos):
        folder = campaign / "drops" / f"V{k + 1:02d}"
        shutil.copytree(ROOT / "data" / "video" / "rendered_drops" / "mjpeg_3mm", folder)
        file = folder / "drop.toml"
        file.write_text(file.read_text().replace("sequence = 11", f"sequence = {100 + k}"))
    for k in range(scans):
        shutil.copytree(
            ROOT / "data" / "ct" / "labelled_scans" / "p01-C01", campaign / "ct" / f"C{k + 1:02d}"
        )
    return campaign


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return copy_campaign(tmp_path / "campaign")


@pytest.fixture
def begin(tmp_path: Path) -> Begin:
    """begin("calibrate", ..., store=...) starts ``labsim calibrate ...`` in a process group of its own."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: object, store: Path | None = None, **changes: str) -> subprocess.Popen[str]:
        environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "LABSIM_STORE": str(store or tmp_path / "store"),
            "OMP_NUM_THREADS": "1",
            **changes,
        }
        process = subprocess.Popen(
            [sys.executable, "-m", "labsim", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=tmp_path,
            start_new_session=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait()
