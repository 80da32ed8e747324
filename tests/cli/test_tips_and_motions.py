"""``labsim simulate`` with another tip, motion and law; the same by the keys of a campaign; what each of them has not."""

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from labsim.campaign import read_campaign
from labsim.cli import main
from labsim.errors import CampaignError, InferenceError
from labsim.inference.supported import refuse_others
from labsim.records import Motion
from labsim.runs.run_file import read_run_file
from labsim.sph.materials import find_law, list_laws
from labsim.sph.motions import find_motion, list_motions
from labsim.sph.plugins import key_of
from labsim.sph.tips import find_tip, list_tips, make_profile

ROOT = Path(__file__).parents[2]
QUICK = ("--spacing-um", "125", "--workers", "1", "--quiet")
CONE = ('tip = "hemisphere"', 'tip = "cone"\nhalf_angle_deg = 45.0')
PUSHED = '\n[motion]\nkind = "pushed"\nspeed_m_s = 0.5\nend_depth_mm = 1.0\nstart_depth_mm = 0.25\n'
CLAY = 'law = "von_mises"\ncohesion_range_Pa = [1e3, 4e3]\nshear_modulus_Pa = 1e5'


def call(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return int(left.value.code or 0)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    shutil.copytree(ROOT / "data/campaigns/p01", folder)
    return folder


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def set_material(folder: Path, keys: str) -> None:
    path = folder / "campaign.toml"
    before, rest = path.read_text(encoding="utf-8").split("[material]", 1)
    _, bracket, after = rest.partition("\n[")
    path.write_text(f"{before}[material]\n{keys}\n{bracket}{after}", encoding="utf-8")


def first_drop(folder: Path) -> Path:
    return sorted((folder / "drops").glob("*/drop.toml"))[0]


def test_a_cone_is_pushed_into_clay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    asked = ["--law", "von_mises", "--set", "material.shear_modulus_Pa=1e5", "--filling-factor", "0.5",
             "--tip", "cone", "--set", "projectile.half_angle_deg=45", "--motion", "pushed",
             "--set", "motion.speed_m_s=1", "--set", "motion.end_depth_mm=0.4", "--set", "motion.start_depth_mm=0.1"]  # fmt: skip
    assert call(["simulate", "-o", str(out), "--store", str(tmp_path / "s"), *QUICK[:-1], *asked]) == 0
    said = capsys.readouterr().out
    assert "cone R 0.5 mm, half angle 45 deg, pushed from 0.1 to 0.4 mm at 1 m/s" in said
    summary = json.loads((out / "run.json").read_text())
    run = read_run_file(out / "run.h5")
    assert summary["driver_work_J"] == run.energies["driver"] > 0
    assert summary["pressure_at_depth_Pa"] == pytest.approx(
        summary["force_at_depth_N"] / (3.14159265 * 25e-8)
    )
    curve = pd.read_csv(out / "curve.csv")
    assert curve.depth_m.iloc[0] == 1e-4 and curve.depth_m.iloc[-1] == pytest.approx(4e-4)
    assert (out / "run.png").stat().st_size > 10_000 and (out / "field.png").stat().st_size > 10_000
    # the same path again, from the table that the run left
    again = tmp_path / "again"
    file = f"motion.file={out / 'curve.csv'}"
    path = ["--motion", "prescribed", "--set", file, "--set", "motion.start_depth_mm=0.1"]
    assert (
        call(["simulate", "-o", str(again), "--store", str(tmp_path / "s"), *QUICK, *asked[:10], *path]) == 0
    )
    led = read_run_file(again / "run.h5")
    assert led.depth[-1] == pytest.approx(4e-4, abs=1e-8)
    assert led.energies["driver"] == pytest.approx(run.energies["driver"], rel=0.02)


def test_keys_of_a_campaign(campaign: Path, tmp_path: Path) -> None:
    drop = first_drop(campaign)
    change(drop, *CONE)
    drop.write_text(drop.read_text() + PUSHED)
    set_material(campaign, CLAY)
    read = read_campaign(campaign)
    stated = read.drops[0]
    assert stated.projectile.tip == "cone" and dict(stated.projectile.shape)["half_angle"] == pytest.approx(
        0.7853981634
    )
    assert stated.motion == Motion("pushed", 0.25e-3, (("speed", 0.5), ("end_depth", 1e-3)))
    assert read.drops[1].motion == Motion() and read.drops[1].projectile.shape == ()
    assert (read.calibrated, read.p_m_range) == ("cohesion", (1e3, 4e3))
    assert read.material.constants == (("cohesion", 2e3), ("shear_modulus", 1e5))
    asked = ["simulate", "--campaign", str(campaign), "--drop", stated.name, "--time-ms", "0.05", *QUICK]
    assert call([*asked, "-o", str(tmp_path / "out"), "--store", str(tmp_path / "s")]) == 0
    run = read_run_file(tmp_path / "out" / "run.h5")
    assert run.setting.motion == stated.motion and run.setting.material.law == "von_mises"
    assert run.setting.projectile.shape == stated.projectile.shape


def test_files_of_a_campaign(campaign: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A tip, a motion and a law that lie in the campaign's own folders."""
    for folder, file in (
        ("tips", "cone"),
        ("motions", "pushed"),
    ):
        (campaign / folder).mkdir()
        text = (ROOT / f"labsim/sph/{folder}/{file}.py").read_text(encoding="utf-8")
        own = text.replace("from ...", "from labsim.").replace("from ..", "from labsim.sph.")
        (campaign / folder / f"my_{file}.py").write_text(own, encoding="utf-8")
    (campaign / "materials").mkdir()
    shutil.copy(ROOT / "labsim/sph/materials/von_mises.py", campaign / "materials" / "my_clay.py")
    drop = first_drop(campaign)
    change(drop, CONE[0], CONE[1].replace("cone", "my_cone"))
    drop.write_text(drop.read_text() + PUSHED.replace("pushed", "my_pushed"))
    set_material(campaign, CLAY.replace("von_mises", "my_clay"))
    read = read_campaign(campaign)
    assert read.drops[0].projectile.tip == str(campaign / "tips" / "my_cone.py")
    assert read.drops[0].motion.kind == str(campaign / "motions" / "my_pushed.py")
    assert read.material.law == str(campaign / "materials" / "my_clay.py")
    assert make_profile(read.drops[0].projectile).shape == (4, 9)
    said = " ".join(record.getMessage() for record in caplog.records)
    for file in ("tips/my_cone.py", "motions/my_pushed.py", "materials/my_clay.py"):
        assert said.count(f"runs {file} of this campaign") == 1  # somebody else's code, said before it runs


def test_a_tip_without_parameters_is_refused(campaign: Path) -> None:
    (campaign / "tips").mkdir()
    (campaign / "tips" / "bare.py").write_text('"""Nothing in it."""\n')
    change(first_drop(campaign), CONE[0], 'tip = "bare"')
    with pytest.raises(CampaignError, match="has no PARAMETERS"):
        read_campaign(campaign)


@pytest.mark.parametrize(
    ("tip", "motion", "words"),
    [
        ('tip = "wedge"', "", ["projectile.tip", "'wedge'", '"ogive"', "tips/"]),
        ('tip = "cylinder"', "", ["projectile.tip", "planar"]),
        ('tip = "cone"\nhalf_angle_deg = 90', "", ["projectile.half_angle_deg", "90", "5 to 85"]),
        ('tip = "cone"\nhalf_angle = 30', "", ["projectile.half_angle", "half_angle_deg", "point_radius_mm"]),
        ('tip = "hemisphere"\nhalf_angle_deg = 30', "", ["projectile.half_angle_deg", "no key of its own"]),
        ('tip = "flat"\nhalf_angle_deg = 30', "", ["projectile.half_angle_deg", "edge_radius_mm"]),
        (CONE[0], '[motion]\nkind = "thrown"', ["motion.kind", "'thrown'", '"pushed"']),
        (CONE[0], '[motion]\nkind = "pushed"\nmass_mg = 1', ["motion.mass_mg", "speed_m_s, end_depth_mm"]),
        (CONE[0], '[motion]\nkind = "free"\nspeed_m_s = 1', ["motion.speed_m_s", "no key of its own"]),
        (CONE[0], '[motion]\nkind = "pushed"\nstart_depth_mm = 3', ["motion.end_depth", "not below"]),
        (CONE[0], '[motion]\nkind = "prescribed"\nfile = "no.csv"', ["motion.file", "no.csv", "not there"]),
    ],
)
def test_a_key_that_is_wrong_in_a_drop(campaign: Path, tip: str, motion: str, words: list[str]) -> None:
    drop = first_drop(campaign)
    change(drop, CONE[0], tip)
    drop.write_text(f"{drop.read_text()}\n{motion}\n")
    with pytest.raises(CampaignError) as caught:
        read_campaign(campaign)
    for word in (str(drop), *words):
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('law = "sand"', ["material.law", "'sand'", '"von_mises"', "materials/"]),
        ('law = "von_mises"', ["material.cohesion_range_Pa", "missing"]),
        (f"{CLAY}\nphi_1 = 0.1", ["material.phi_1", "shear_modulus_Pa, bulk_modulus_Pa, tension_Pa"]),
        (f"{CLAY}\ntension_Pa = -1.0", ["material.tension_Pa", "-1", "negative"]),
        (f"{CLAY}\ncohesion_Pa = 1.0", ["material.cohesion_Pa", "cohesion_range_Pa"]),
    ],
)
def test_a_key_that_is_wrong_in_a_material(campaign: Path, keys: str, words: list[str]) -> None:
    set_material(campaign, keys)
    with pytest.raises(CampaignError) as caught:
        read_campaign(campaign)
    for word in (str(campaign / "campaign.toml"), *words):
        assert word in str(caught.value)


def test_what_cannot_be_compared_is_not_calibrated(campaign: Path) -> None:
    refuse_others(read_campaign(campaign))
    change(first_drop(campaign), *CONE)
    refuse_others(read_campaign(campaign))  # another tip is a drop like any other
    drop = first_drop(campaign)
    whole = drop.read_text()
    drop.write_text(whole + PUSHED)
    with pytest.raises(InferenceError, match=r"motion.kind: \"pushed\""):
        refuse_others(read_campaign(campaign))
    drop.write_text(whole)
    set_material(campaign, CLAY)
    refuse_others(read_campaign(campaign))  # what a law calls calibrated takes the place of p_m
    set_material(campaign, 'law = "drucker_prager_cap"\nfriction_angle_range_deg = [25.0, 40.0]')
    with pytest.raises(InferenceError, match=r"material.law: friction_angle .* outside what the law allows"):
        refuse_others(read_campaign(campaign))


SAID = {
    "no key of the tip": (["--tip", "cone", "--set", "projectile.angle=3"], ["angle", "half_angle_deg"]),
    "no key of the motion": (["--set", "motion.speed_m_s=1"], ["speed_m_s", "no key of its own"]),
    "no key of the law": (["--law", "von_mises", "--set", "material.phi_1=0.1"], ["phi_1", "cohesion_Pa"]),
    "no such tip": (["--tip", "wedge"], ["--tip", "wedge", "ogive"]),
    "no such law": (["--law", "sand"], ["--law", "sand", "von_mises"]),
    "no such motion": (["--motion", "thrown"], ["thrown", "pushed"]),
    "speed of a push": (["--motion", "pushed", "--speed-m-s", "1"], ["--speed-m-s", "motion.speed_m_s"]),
    "p_m of clay": (["--law", "von_mises", "--p-m-Pa", "100"], ["--p-m-Pa", "porous_dust"]),
    "no such table": (["--set", "tip.x=1"], ["--set", "projectile.half_angle_deg=30"]),
}


@pytest.mark.parametrize("name", SAID)
def test_an_option_that_is_wrong(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked, words = SAID[name]
    assert call(["simulate", "-o", str(tmp_path / "out"), *QUICK, *asked]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    for word in words:
        assert word in said
    assert not (tmp_path / "out").exists()


def test_every_parameter_has_a_key_that_toml_takes_bare():
    """Of every law, tip and motion: letters, digits and _, no two alike."""
    modules = [find_law(law) for law in list_laws()]
    modules += [find_tip(tip) for tip in list_tips()] + [find_motion(motion) for motion in list_motions()]
    for module in modules:
        keys = [key_of(each)[0] for each in module.PARAMETERS]
        assert len(set(keys)) == len(keys)
        assert all(re.fullmatch(r"[A-Za-z0-9_]+", key) for key in keys), keys
