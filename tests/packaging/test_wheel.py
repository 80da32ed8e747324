"""The wheel holds what labsim needs away from its checkout, and works from there."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytest.importorskip("hatchling")


def build(kind: str, folder: Path) -> Path:
    # what pip does with the build system of pyproject.toml, without asking a registry for it
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    return next(folder.glob("*.whl" if kind == "wheel" else "*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel alone in a folder of its own; its dependencies are those of this environment."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def labsim(installed: Path, tmp_path: Path, *arguments: str, store: str | None = None) -> str:
    environment = {
        **os.environ,
        "PYTHONPATH": str(installed),
        "LABSIM_STORE": store or str(tmp_path / "store"),
    }
    done = subprocess.run(
        [sys.executable, "-m", "labsim", *arguments],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_holds_code_and_the_data_of_the_demo(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    in_git = subprocess.run(
        ["git", "ls-files", "data/guettler2009", "data/campaigns/tiller", "labsim"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    for name in in_git:
        assert name.removeprefix("labsim/") in {each.removeprefix("labsim/") for each in names}, name
    assert "labsim/data/guettler2009/campaign.toml" in names
    assert not any(name.startswith(("tests/", "data/", "notebooks/")) for name in names)
    # pages and their pictures are 1.9 MB of it, the campaign with scans 1.3, code 0.6, the soundings in clay 0.3
    assert wheel.stat().st_size < 5_000_000


def test_the_sdist_builds_the_same_wheel(tmp_path: Path, wheel: Path) -> None:
    with tarfile.open(build("sdist", tmp_path / "sdist")) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    source = next((tmp_path / "unpacked").iterdir())
    for name in (
        "README.md",
        "LICENSE",
        "CITATION.cff",
        "CHANGELOG.md",
        "docs/tutorial.md",
        "tests/test_layers.py",
    ):
        assert (source / name).is_file(), name
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path / "again")],
        cwd=source,
        check=True,
        capture_output=True,
    )
    again = next((tmp_path / "again").glob("*.whl"))
    assert set(zipfile.ZipFile(again).namelist()) == set(zipfile.ZipFile(wheel).namelist())


def test_an_installed_wheel_has_its_pages(installed: Path, tmp_path: Path) -> None:
    assert (ROOT / "docs" / "limits.md").read_text(encoding="utf-8").strip() == labsim(
        installed, tmp_path, "docs", "limits"
    ).strip()


def test_an_installed_wheel_works_alone(installed: Path, tmp_path: Path) -> None:
    code = "import labsim; print(labsim.__file__); print(labsim.example('guettler2009'))"
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    out = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    module, data = out.stdout.split()
    assert Path(module).is_relative_to(installed) and Path(data).is_relative_to(installed)
    assert "9 drops" in labsim(installed, tmp_path, "check", data)
    assert "pixel_scale" in labsim(installed, tmp_path, "effects")
    labsim(installed, tmp_path, "new", "fresh")
    assert (tmp_path / "fresh/campaign.toml").is_file()


@pytest.mark.slow
def test_an_installed_wheel_runs_the_demo(installed: Path, tmp_path: Path) -> None:
    """Some minutes on two cores; seconds where LABSIM_STORE holds the runs of the demo."""
    labsim(installed, tmp_path, "demo", store=os.environ.get("LABSIM_STORE"))
    for name in ("calibration.json", "diagnosis.json", "posterior.nc", "report.html"):
        assert (tmp_path / "labsim-demo" / name).stat().st_size > 300, name
    assert (tmp_path / "labsim-demo" / "clay" / "report.html").is_file()
