"""What other packages bring along by entry points is found, and what is broken in them is named with the package."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import labsim
from labsim.campaign import read_campaign
from labsim.effects import list_effects
from labsim.errors import LabsimError
from labsim.inference.observations import observe_further
from labsim.tracks import find_format
from labsim.video import open_frames

P01 = Path(__file__).parents[1] / "data" / "campaigns" / "p01"
OBSERVATION = """
from types import SimpleNamespace

def observe(campaign):
    asked = dict.fromkeys(("begin", "linearise", "follow"), print)
    return SimpleNamespace(name=campaign.name, kind="scale", features=(), **asked)
"""
EFFECT = (Path(labsim.__file__).parent / "effects/catalogue/projectile_mass.py").read_text()


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A package ``instruments`` with these modules, and the entry points that its metadata name."""

    def place(modules: dict[str, str], points: dict[str, dict[str, str]]) -> None:
        package = tmp_path / "site" / "instruments"
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("")
        for name, text in modules.items():
            (package / f"{name}.py").write_text(text)
        metadata = tmp_path / "site" / "instruments-1.0.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: instruments\nVersion: 1.0\n")
        lines = [
            f"[labsim.{group}]\n" + "".join(f"{k} = {v}\n" for k, v in each.items())
            for group, each in points.items()
        ]
        (metadata / "entry_points.txt").write_text("\n".join(lines))
        monkeypatch.syspath_prepend(str(tmp_path / "site"))

    yield place
    for name in [name for name in sys.modules if name.split(".")[0] == "instruments"]:
        del sys.modules[name]


def test_formats_effects_and_measurements_of_a_package_join(install, tmp_path):
    install(
        {
            "rows": 'NAME = "rows"\ndef recognises(path):\n    return path.suffix == ".rows"\n',
            "camera": 'NAME = "camera"\ndef recognises(path):\n    raise RuntimeError("asked")\n',
            "heavier": EFFECT,
            "scale": OBSERVATION,
        },
        {
            "track_formats": {"rows": "instruments.rows"},
            "video_formats": {"camera": "instruments.camera"},
            "effects": {"heavier": "instruments.heavier"},
            "observations": {"scale": "instruments.scale"},
        },
    )
    (tmp_path / "a.rows").write_text("1")
    found = find_format(tmp_path / "a.rows")
    assert found is not None and found.__name__ == "instruments.rows"
    (tmp_path / "a.unknown").write_text("1")
    with pytest.raises(RuntimeError, match="asked"):
        open_frames(tmp_path / "a.unknown")
    effect = list_effects()["heavier"]
    assert effect.name == "heavier" and effect.file.parent.name == "instruments"

    assert [each.name for each in observe_further(read_campaign(P01))] == ["p01"]


@pytest.mark.parametrize(
    ("modules", "points", "message"),
    [
        (
            {},
            {"video_formats": {"gone": "instruments.gone"}},
            r"instruments: labsim\.video_formats: gone: cannot be loaded",
        ),
        (
            {"avi": ""},
            {"video_formats": {"opencv": "instruments.avi"}},
            r"opencv: has the name of one that comes with labsim",
        ),
        ({}, {"effects": {"gone": "instruments.gone"}}, r"instruments: labsim\.effects: gone: is no file"),
        ({}, {"effects": {"shear_strength": "instruments.gone"}}, r"shear_strength: has the name of one"),
    ],
)
def test_a_broken_package_is_named(install, tmp_path, modules, points, message):
    install(modules, points)
    (tmp_path / "a.unknown").write_text("1")
    with pytest.raises(LabsimError, match=message):
        list_effects()
        open_frames(tmp_path / "a.unknown")
