"""A drop, a scan and an output folder to show; the page's server in a process of its own."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from campaign_files import write_scan_of
from view_pages import DROP_TOML

from benchmarks.truths.phantom import Phantom

for _needed in ("starlette", "uvicorn", "tomlkit", "httpx2"):
    pytest.importorskip(_needed)

RENDERED = Path(__file__).parents[2] / "data" / "video" / "rendered_drops" / "ffv1"


@pytest.fixture
def drop(tmp_path: Path) -> Path:
    folder = tmp_path / "D10"
    folder.mkdir()
    shutil.copy(RENDERED / "video.avi", folder)
    (folder / "drop.toml").write_text(DROP_TOML)
    return folder


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    folder = tmp_path / "C01"
    folder.mkdir()
    write_scan_of(Phantom(shape=(80, 84, 84), centre=(43.3, 40.6, 32.4), radius=10.5, surface=22.0), folder)
    return folder


@pytest.fixture
def output(tmp_path: Path) -> Path:
    folder = tmp_path / "series-track"
    (folder / "D01").mkdir(parents=True)
    (folder / "drop.json").write_text(
        json.dumps({"depth": {"value_m": 1.5e-3, "sigma_m": None}, "list": [1, 2]})
    )
    (folder / "D01" / "curve.csv").write_text("time_s,depth_m\n0.0,0.0\n0.001,0.0005\n")
    (folder / "report.html").write_text(
        "<!doctype html><p id=p>plain</p><script>p.textContent='drawn'</script>"
    )
    (folder / "secret.key").write_text("no")
    (tmp_path / "outside.json").write_text("{}")
    return folder
