"""model.toml there and back, what it does to a drop, and its mistakes by file, key, value and remedy."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import pytest

from labsim.campaign import read_campaign
from labsim.cli import main
from labsim.effects import (
    Instrument,
    Model,
    apply_effects,
    apply_model,
    check_model,
    list_effects,
    list_places,
    make_instrument,
    read_model,
    reference_campaign,
    write_model,
)
from labsim.effects.law_places import LAW_PLACES
from labsim.effects.terms import Law, apply_law, list_terms
from labsim.errors import EffectError
from labsim.records import Material, Projectile
from labsim.sph import DropSetting
from labsim.sph import simulate as run_drop

DATA = Path(__file__).parents[2] / "data"
FULL = Model(
    1012.3456789012345,
    (
        ("strength_rate", {"eta": 0.1 + 0.2, "n": 0.45}),
        ("pixel_scale", {"factor": 1.03}),
        ("planar_geometry", {}),
    ),
    (("delta", 0.6), ("bulk_modulus", 4500.0)),
)


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return int(left.value.code or 0)


def test_there_and_back(tmp_path: Path) -> None:
    path = write_model(tmp_path / "model.toml", FULL, comments=["made by a test\nof two lines"])
    assert read_model(path) == FULL
    text = path.read_text()
    assert text.startswith("# made by a test\n# of two lines\nformat = 1\n")
    assert (
        "[effects.strength_rate]  # The strength grows" in text and "eta = 0.30000000000000004  # s^n" in text
    )
    assert [file.name for file in tmp_path.iterdir()] == ["model.toml"]


def test_shape_may_be_left_out(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text("[material]\np_m_Pa = 900\n[effects.strength_rate]\neta = 0.05\n")
    model = read_model(path)
    assert model == Model(900.0, (("strength_rate", {"eta": 0.05}),))
    place = next(iter(list_places(reference_campaign()).values()))
    setting = DropSetting(Projectile("hemisphere", 5e-4, 1.3e-6), 0.5, reference_campaign().material)
    changed = apply_model(setting, model, place)
    assert (changed.strength_rate, changed.strength_rate_exponent) == (0.05, 0.5)
    assert changed.material == setting.material.replace(p_m=900.0)
    assert make_instrument(model, place) == Instrument()


def test_what_a_model_says_of_drop_and_instrument() -> None:
    place = next(iter(list_places(reference_campaign()).values()))
    setting = DropSetting(
        Projectile("cylinder", 5e-4, 2e-3), 0.5, reference_campaign().material, geometry="planar"
    )
    changed = apply_model(setting, FULL, place)
    assert changed.geometry == "axisymmetric" and changed.projectile.tip == "hemisphere"
    assert changed.strength_rate == 0.1 + 0.2
    assert changed.material == setting.material.replace(p_m=FULL.p_m, delta=0.6, bulk_modulus=4500.0)
    assert make_instrument(FULL, place) == Instrument(pixel_factor=1.03)
    with pytest.raises(
        EffectError, match=r"planar_geometry: does not apply here: the nominal model is round"
    ):
        check_model(FULL, reference_campaign(), list_effects())


MISTAKES = {
    "": ["material.p_m_Pa", "is missing"],
    "format = 2\n[material]\np_m_Pa = 1e3\n": ["format", "2", "write 1"],
    "[material\n": ["not TOML", "line 1"],
    "p_m_Pa = 1e3\n": ["p_m_Pa", "not a key", "material"],
    "material = 3\n": ["material", "3", "[material]"],
    "[material]\np_m_Pa = -3\n": ["material.p_m_Pa", "-3", "1 to 1e+08"],
    '[material]\np_m_Pa = "1 kPa"\n': ["material.p_m_Pa", "1 kPa", "number"],
    "[material]\np_m_Pa = nan\n": ["material.p_m_Pa", "nan", "finite"],
    "[material]\np_m_Pa = 1e3\nphi_3 = 1\n": ["material.phi_3", "did you mean phi_"],
    "[material]\np_m_Pa = 1e3\nphi_2 = 7\n": ["material.phi_2", "7", "0.01 to 1"],
    "[material]\np_m_Pa = 1e3\n[effects.strenght_rate]\n": [
        "effects.strenght_rate",
        "did you mean strength_rate",
    ],
    "[material]\np_m_Pa = 1e3\n[effects.strength_rate]\n": ["effects.strength_rate.eta", "is missing", "s^n"],
    "[material]\np_m_Pa = 1e3\n[effects]\ngravity = 9.81\n": ["effects.gravity", "9.81", "[effects.gravity]"],
    "[material]\np_m_Pa = 1e3\n[effects.gravity]\ng = 99\n": ["effects.gravity.g", "99", "0 to 20"],
    "[material]\np_m_Pa = 1e3\n[effects.gravity]\nG = 9\n": ["effects.gravity.G", "not a key", "use g"],
    "[material]\np_m_Pa = 1e3\n[effects.planar_geometry]\nx = 9\n": [
        "effects.planar_geometry.x",
        "no parameter",
    ],
    "[material]\np_m_Pa = 1e3\n[gravity]\n": ["gravity", "not a key", "effects"],
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_are_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(EffectError) as caught:
        read_model(path)
    for word in (str(path), *MISTAKES[text]):
        assert word in str(caught.value), str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "nothing.toml"
    assert call("simulate", "-o", str(tmp_path / "out"), "--model", str(missing)) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {missing}: ") and error.count("\n") == 1


def simulate(tmp_path: Path, model: str, *arguments: str) -> dict:
    path = tmp_path / "model.toml"
    path.write_text(model)
    options = ["-o", str(tmp_path / "out"), "--store", str(tmp_path / "store"), "--workers", "1", "--json"]
    assert call("simulate", *options, "--model", str(path), "--spacing-um", "125", *arguments) == 0
    return json.loads((tmp_path / "out" / "run.json").read_text())


def test_simulate_with_a_model(tmp_path: Path) -> None:
    """The gain is there when the user applies it: the run is that of the setting with the effect."""
    plain = simulate(tmp_path, "[material]\np_m_Pa = 900\n")
    rate = simulate(tmp_path, "[material]\np_m_Pa = 900\n[effects.strength_rate]\neta = 0.05\n")
    assert rate["setting"]["strength_rate"] == 0.05 and rate["setting"]["material"]["p_m"] == 900.0
    assert plain["setting"]["strength_rate"] == 0.0
    assert rate["penetration_depth_m"] < 0.95 * plain["penetration_depth_m"]


def test_simulate_says_what_is_not_of_the_drop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "model.toml"
    path.write_text("[material]\np_m_Pa = 900\n[effects.pixel_scale]\nfactor = 1.05\n")
    options = ["-o", str(tmp_path / "out"), "--store", str(tmp_path / "store"), "--workers", "1"]
    assert call("simulate", *options, "--model", str(path), "--spacing-um", "125") == 0
    assert "pixel_scale acts on what is measured, not on the drop" in capsys.readouterr().out
    path.write_text("[material]\np_m_Pa = 900\n[effects.gravity]\ng = 9.81\n")
    assert call("simulate", *options, "--model", str(path), "--spacing-um", "125") == 2
    assert "effects.gravity: does not apply here: the nominal model has gravity" in capsys.readouterr().err


COARSE = DropSetting(
    # the drop that simulate makes where nothing is stated
    Projectile("hemisphere", 5e-4, 2540.0 * 4.0 / 3.0 * math.pi * 5e-4**3),
    0.65,
    Material(p_m=900.0),
    spacing=125e-6,
)
LAWS = {  # one term of every place that a run knows, as large as a campaign may show it
    "hardening": 0.5,
    "shear_damage": 0.8,
    "shear_hardening": 0.5,
    "depth_spring": 150.0,
    "film_at_0_5_mm": 200.0,
    "pull": 0.1,
    "rim_pull": 0.04,
    "layer_at_0_5_mm": 0.8,
    "inertial_drag": 300.0,
    "shaft_drag": 400.0,
    "shaft_viscosity": 200.0,
    "time_ramp": 80.0,
    "creep": -0.25,
    "stuck_mass": 0.15,
    "gathered_mass": 0.15,
    "size_power": 0.4,
}


def test_a_law_of_every_place_is_at_work_in_simulate(tmp_path: Path) -> None:
    """The run is that of the setting which the API gives, and not the one without the law."""
    terms = list_terms()
    assert {terms[name].place for name in LAWS} == {p.name for p in LAW_PLACES.values() if p.add}
    plain = simulate(tmp_path, "[material]\np_m_Pa = 900\n")["penetration_depth_m"]
    for name, c in LAWS.items():
        found = simulate(tmp_path, f"[material]\np_m_Pa = 900\n[law]\n{name} = {c!r}\n")
        own = run_drop(apply_law(COARSE, Law(((name, c),)))).penetration_depth
        assert found["penetration_depth_m"] == pytest.approx(own, rel=1e-9), name
        assert abs(own / plain - 1.0) > 0.02, name


def test_simulate_says_which_terms_are_not_of_the_drop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "model.toml"
    path.write_text("[material]\np_m_Pa = 900\n[law]\nrolling_shutter = 5.0\ninertial_drag = 300.0\n")
    options = ["-o", str(tmp_path / "out"), "--store", str(tmp_path / "store"), "--workers", "1"]
    assert call("simulate", *options, "--model", str(path), "--spacing-um", "125") == 0
    said = capsys.readouterr().out
    assert "rolling_shutter acts on what is measured, not on the drop" in said
    assert "inertial_drag" not in said


def test_calibrate_goes_on_with_a_law(shared_store: str, tmp_path: Path) -> None:
    """Dust that a law weakens as it is compacted, by half at 0.1, has a higher p_m for the same drops."""
    source, campaign = DATA / "campaigns" / "p01", tmp_path / "campaign"
    campaign.mkdir()
    shutil.copy(source / "campaign.toml", campaign)
    for name in ("D02", "D03", "D05"):
        shutil.copytree(source / "drops" / name, campaign / "drops" / name)
    found = []
    for law in ("", "hardening = -0.5\n"):
        path, out = tmp_path / "model.toml", tmp_path / f"out{len(found)}"
        path.write_text(f"[material]\np_m_Pa = 1000\n[law]\n{law}")
        options = ["-o", str(out), "--store", shared_store, "--workers", "1", "--quiet"]
        assert call("calibrate", str(campaign), *options, "--model", str(path)) == 0
        found.append(json.loads((out / "calibration.json").read_text()))
    plain, weakened = found
    assert 1.1 < weakened["p_m_Pa"]["q50"] / plain["p_m_Pa"]["q50"] < 2.0
    for name, strength in plain["samples"].items():
        assert weakened["samples"][name] > 1.1 * strength


def test_a_learned_law_is_tried_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``labsim effects CAMPAIGN --from OUT``: an effect of the campaign, which changes a drop as the law does."""
    ignored = shutil.ignore_patterns("ct", "effects")
    campaign = shutil.copytree(DATA / "campaigns" / "u01", tmp_path / "campaign", ignore=ignored)
    law = Law((("inertial_drag", 497.4), ("layer_at_0_5_mm", 0.8)))
    (tmp_path / "out").mkdir()
    write_model(tmp_path / "out" / "model.toml", Model(1507.0, law=law))
    assert call("effects", str(campaign), "--from", str(tmp_path / "out"), "--json") == 0
    written = [Path(each) for each in json.loads(capsys.readouterr().out)["written"]]
    names = [f"learned_{name}" for name, _ in law.terms]
    assert written == [campaign / "effects" / f"{name}.py" for name in names]
    assert call("effects", str(campaign), "--json") == 0
    listed = {each["name"]: each for each in json.loads(capsys.readouterr().out)["effects"]}
    assert all(listed[name]["applies"] and listed[name]["affects_simulation"] for name in names)
    chosen = [(name, {"coefficient": c}) for name, (_, c) in zip(names, law.terms, strict=True)]
    read = read_campaign(campaign)
    changed = apply_effects(COARSE, chosen, list_places(read)["D01"], list_effects(read))
    assert changed == apply_law(COARSE, law) != COARSE
    assert call("effects", str(campaign), "--from", str(tmp_path / "out")) == 2
    assert f"{written[0]}: effects: is there already" in capsys.readouterr().err


def test_the_catalogue_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    data = DATA / "guettler2009"
    assert call("effects") == 0
    printed = capsys.readouterr().out
    assert call("effects", "--json", str(data)) == 0
    listed = json.loads(capsys.readouterr().out)["effects"]
    assert [each["name"] for each in listed] == list(list_effects())
    for each in listed:
        assert each["name"] in printed and each["title"] in printed
        assert each["leaves"] and each["references"]
    applies = {each["name"]: each["applies"] for each in listed}
    assert applies["planar_geometry"] and applies["gravity"] and not applies["ct_scale"]
    k0 = next(each for each in listed if each["name"] == "bulk_modulus")["parameters"][0]
    assert k0["name"] == "bulk_modulus.K0" and k0["unit"] == "Pa" and k0["null"] == 300e3
