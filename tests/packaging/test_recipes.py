"""The recipes of extend.md and extend-measuring.md, taken from the pages and put where they say: each works as printed."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from laws import LawStore, write_campaign

import labsim.cli
import labsim.ct.formats
import labsim.tracks
import labsim.video.formats
from labsim.campaign import read_campaign, read_drop
from labsim.ct import open_stack
from labsim.effects import list_effects, list_places
from labsim.inference.calibrate import prepare
from labsim.records import Camera, Material, Projectile
from labsim.sph import DropSetting, check_setting, simulate
from labsim.sph.bodies import set_body
from labsim.sph.materials import find_law
from labsim.sph.particles import fill_at_rest, name_rows
from labsim.sph.profile import volume_below
from labsim.sph.sirono import compressive_strength
from labsim.sph.tips import make_profile
from labsim.tracks import read_rows
from labsim.video import open_frames

ROOT = Path(__file__).parents[2]
PAGES = ("extend.md", "extend-measuring.md")
PACKAGES = {
    "labsim/tracks": labsim.tracks,
    "labsim/video/formats": labsim.video.formats,
    "labsim/ct/formats": labsim.ct.formats,
    "labsim/cli": labsim.cli,
}


def find_recipes() -> dict[str, str]:
    """Path in the first line -> the text of every block of the pages."""
    pages = [(ROOT / "docs" / name).read_text(encoding="utf-8") for name in PAGES]
    blocks = [block for page in pages for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL)]
    return {block.splitlines()[0].removeprefix("# "): block for block in blocks}


RECIPES = find_recipes()


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    shutil.copytree(ROOT / "data/campaigns/p01", folder)
    return folder


@pytest.fixture
def put(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Put a recipe into a folder that counts as part of its package."""

    def place(name: str) -> None:
        folder, file = name.rsplit("/", 1)
        (tmp_path / "added").mkdir()
        (tmp_path / "added" / file).write_text(RECIPES[name], encoding="utf-8")
        monkeypatch.setattr(
            PACKAGES[folder], "__path__", [*PACKAGES[folder].__path__, str(tmp_path / "added")]
        )

    return place


def test_every_recipe_is_tried_here() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert len(RECIPES) >= 6
    for name in RECIPES:
        assert name.rsplit("/", 1)[1].removesuffix(".py") in text, name


@pytest.mark.parametrize(
    ("name", "key", "field"),
    [("added_mass", "mass", "projectile"), ("strength_bend", "bend", "strength_shape")],
)
def test_an_effect_of_the_campaign(name: str, key: str, field: str, campaign: Path) -> None:
    (campaign / "effects").mkdir()
    (campaign / "effects" / f"{name}.py").write_text(RECIPES[f"CAMPAIGN/effects/{name}.py"], encoding="utf-8")
    read = read_campaign(campaign)
    effect = list_effects(read)[name]
    place = next(iter(list_places(read).values()))
    setting = DropSetting(Projectile("hemisphere", 5e-4, 1.33e-6), 0.6, Material())
    assert effect.apply(setting, {key: 0.0}, place) == setting
    changed = effect.apply(setting, {key: effect.amplitudes[0].step}, place)
    assert getattr(changed, field) != getattr(setting, field)
    check_setting(changed)


def test_a_kind_of_measurement_of_the_campaign(tmp_path: Path) -> None:
    """A column that says ln p_m to 10 % (and 2 % of its sample) adds so much to what the drops say; two columns are not alike."""
    folder = write_campaign(tmp_path / "made")
    (folder / "observations").mkdir()
    source = RECIPES["CAMPAIGN/observations/own_weight.py"]
    (folder / "observations" / "own_weight.py").write_text(source, encoding="utf-8")
    read, store = read_campaign(folder), LawStore(tmp_path / "store")
    _, alone = prepare(read, store, workers=1)
    strength = compressive_strength(np.array(0.15), read.material.replace(p_m=1300.0))
    height = 1e3 * float(strength) / (read.sample.monomer_density * 0.15 * 9.81)
    (folder / "column_mm.txt").write_text(f"{height} {0.1 * height}\n")
    problem, both = prepare(read, store, workers=1)
    assert [each.kind for each in problem.observations] == ["drops", "rebounds", "own weight"]
    information = 1 / alone.covariance[0, 0] + 1 / (0.1**2 + 0.02**2)
    assert both.covariance[0, 0] == pytest.approx(1 / information, rel=0.02)
    assert np.exp(both.log_p_m) == pytest.approx(1300.0, rel=0.05)
    (folder / "column_mm.txt").write_text(f"{2 * height} {0.1 * height}\n")
    assert prepare(read, store, workers=1)[1].log_p_m > both.log_p_m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"), [("added_mass", {"mass": 4e-7}), ("strength_bend", {"bend": 2.0})]
)
def test_an_effect_does_what_it_expects(name: str, value: dict, campaign: Path, tmp_path: Path) -> None:
    """Simulated with and without: the depth moves to the side that the file says."""
    (campaign / "effects").mkdir()
    (campaign / "effects" / f"{name}.py").write_text(RECIPES[f"CAMPAIGN/effects/{name}.py"], encoding="utf-8")
    read = read_campaign(campaign)
    effect = list_effects(read)[name]
    place = next(iter(list_places(read).values()))
    setting = DropSetting(Projectile("hemisphere", 5e-4, 1.33e-6), 0.6, Material(p_m=2000.0), spacing=1.25e-4)
    plain, changed = labsim.simulate(
        [setting, effect.apply(setting, value, place)], store=tmp_path, workers=1
    )
    assert np.sign(changed.penetration_depth - plain.penetration_depth) == effect.expect["penetration_depth"]


def test_a_tip_of_the_campaign(campaign: Path, tmp_path: Path) -> None:
    """It is read with its own keys, drawn as its text says, and the dust pushes it."""
    (campaign / "tips").mkdir()
    (campaign / "tips" / "frustum.py").write_text(RECIPES["CAMPAIGN/tips/frustum.py"], encoding="utf-8")
    drop = next((campaign / "drops").glob("*/drop.toml"))
    text = drop.read_text(encoding="utf-8")
    assert 'tip = "hemisphere"' in text
    drop.write_text(text.replace('tip = "hemisphere"', 'tip = "frustum"\nface_ratio = 0.4'), encoding="utf-8")
    projectile = read_drop(drop).projectile
    radius, root = projectile.tip_radius, np.sqrt(3.0)
    assert dict(projectile.shape) == {"face_ratio": 0.4}
    frustum = np.pi / 3 * radius**3 * root * (1 - 0.4**3)
    profile = make_profile(projectile)
    assert volume_below(profile, 0.6 * root * radius) == pytest.approx(frustum, rel=1e-6)
    setting = DropSetting(projectile, 0.6, Material(p_m=2000.0), spacing=radius / 4, duration=2e-4)
    run = labsim.simulate(setting, store=tmp_path, workers=1)
    assert run.force.max() > 0.0 and abs(run.momentum_error) < 1e-10


def test_a_motion_of_the_campaign(campaign: Path, tmp_path: Path) -> None:
    """The tip stops at each pause and goes on after it."""
    (campaign / "motions").mkdir()
    path = campaign / "motions" / "stepwise.py"
    path.write_text(RECIPES["CAMPAIGN/motions/stepwise.py"], encoding="utf-8")
    drop = next((campaign / "drops").glob("*/drop.toml"))
    keys = '\n[motion]\nkind = "stepwise"\nspeed_m_s = 0.5\nstep_mm = 0.2\ncount = 2\npause_ms = 0.4\n'
    drop.write_text(drop.read_text(encoding="utf-8") + keys, encoding="utf-8")
    read = read_drop(drop)
    assert read.motion.kind == str(path)
    setting = DropSetting(read.projectile, 0.6, Material(p_m=2000.0), spacing=read.projectile.tip_radius / 4)
    run = labsim.simulate(setting.replace(motion=read.motion), store=tmp_path, workers=1)
    assert run.stopped and run.penetration_depth == pytest.approx(4e-4, rel=1e-9)
    held = (run.time > 0.45e-3) & (run.time < 0.75e-3)
    assert np.all(run.velocity[held] == 0.0) and np.all(run.depth[held] == pytest.approx(2e-4))
    assert abs(run.energy_error) < 0.02


def test_a_law(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Sheared along ξ its strength is the formula's; a drop balances its energy; the command lists it."""
    path = tmp_path / "sensitive_clay.py"
    path.write_text(RECIPES["CAMPAIGN/materials/sensitive_clay.py"], encoding="utf-8")
    assert len(path.read_text().splitlines()) <= 60
    material = Material(law=str(path), constants=(("strain_95", 1.0), ("shear_modulus", 5e6)))
    setting = set_body(material, 1e-4, 1.0, geometry="axisymmetric", filling_factor=0.5)
    s, own = name_rows(setting, fill_at_rest(setting, np.ones(1), np.zeros(1), np.array([0.5])))
    law = find_law(str(path))
    s.lxz[:] = 0.5
    for _ in range(4000):
        law.update(0, 1, 2.5e-4, True, s, own, law.make_constants(setting), law.make_tables(setting))
    xi = 0.5 / np.sqrt(3)
    strength = 2 * 5e3 * (1 / 3 + 2 / 3 * np.exp(-3 * xi))
    assert own.sheared[0] == pytest.approx(xi, rel=0.01)
    assert np.sqrt(3) * np.hypot(s.sxz[0], s.sxx[0]) == pytest.approx(strength, rel=0.01)
    ball = Projectile("sphere", 5e-4, 5e-7)
    run = simulate(DropSetting(ball, 1.0, Material(law=str(path)), filling_factor=0.5, spacing=6.25e-5))
    assert run.stopped and abs(run.energy_error) < 0.01
    with pytest.raises(SystemExit):
        labsim.cli.main(["materials", str(path), "--json"])
    assert json.loads(capsys.readouterr().out)["laws"][0]["name"] == "sensitive_clay"


def test_a_format_of_tracks(put, tmp_path: Path) -> None:
    put("labsim/tracks/imagej_results.py")
    path = tmp_path / "Results.csv"
    path.write_text(" ,Slice,X,Y\n" + "".join(f"{k},{k},64,{280 + 2.5 * k}\n" for k in range(1, 21)))
    rows = read_rows(path, Camera(1e4, 2e-5, 300.0, 0.1))
    assert list(rows.frame) == list(range(20)) and rows.row[0] == 282.5


def test_a_format_of_videos(put, tmp_path: Path) -> None:
    put("labsim/video/formats/numpy_stack.py")
    stack = np.arange(3 * 8 * 6, dtype=np.uint8).reshape(3, 8, 6)
    np.save(tmp_path / "film.npy", stack)
    frames = open_frames(tmp_path / "film.npy")
    assert len(frames) == 3 and frames.shape == (8, 6)
    assert np.array_equal(np.stack(list(frames)), stack)


def test_a_format_of_slices(put, tmp_path: Path) -> None:
    put("labsim/ct/formats/numpy_volume.py")
    volume = np.arange(9 * 5 * 4, dtype=np.uint16).reshape(9, 5, 4)
    np.save(tmp_path / "volume.npy", volume)
    stack = open_stack(tmp_path / "volume.npy")
    assert stack.count == 9 and np.array_equal(stack.slice(4), volume[4])


def test_a_command(put, campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put("labsim/cli/speeds.py")
    with pytest.raises(SystemExit) as left:
        labsim.cli.main(["speeds", str(campaign), "--json"])
    assert left.value.code == 0
    speeds = json.loads(capsys.readouterr().out)["speeds_m_s"]
    assert speeds["D05"] == pytest.approx(0.6407, abs=1e-3)
