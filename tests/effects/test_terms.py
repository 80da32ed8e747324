"""Every term of a law, and a law in a model.toml: units, null, sign of the work, round trip, what a run gets of it."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.cli.effects import write_learned
from labsim.effects import Instrument, list_effects
from labsim.effects.contract import list_places
from labsim.effects.law_places import LAW_PLACES, LEAST
from labsim.effects.model import Model, apply_model, make_instrument, read_model, write_model
from labsim.effects.terms import Law, add_term, apply_law, list_terms, see_term
from labsim.errors import EffectError
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, check_setting, simulate

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "p01"
SETTING = DropSetting(Projectile("hemisphere", 5e-4, 1.33e-6), 0.6, Material())
AREA = math.pi * 5e-4**2
TERMS = list_terms()
PLACE = replace(list_places(read_campaign(CAMPAIGN))["D01"], pixel_size=20e-6)


@pytest.mark.parametrize("name", TERMS)
def test_every_term_is_what_its_page_says(name):
    term = TERMS[name]
    assert term.place in LAW_PLACES and term.title and term.formula and term.source and term.name == name
    begin = 0.1 if term.acts.over == "radius of the tip" else 0.0
    places = np.linspace(begin, term.acts.reach, 50)
    values = term.shape(places)
    assert values.shape == places.shape and np.all(np.isfinite(values)) and np.any(values != 0)
    low, high = term.limits
    assert low <= 0.0 <= high
    assert add_term(SETTING, term, 0.0) is SETTING
    if term.acts.least == 0.0:
        assert all(min(max(c, -1e9), 1e9) * values.min() >= 0 for c in (low, high))
    if term.acts.rising:
        assert all(np.all(min(max(c, -1e9), 1e9) * np.diff(values) >= 0) for c in (low, high))
    if "strength" in term.place and term.acts.simulated:
        changed = add_term(SETTING, term, max(low, -100.0))
        [hardest] = [
            law
            for law in (
                changed.strength_shape,
                changed.strength_of_strain,
                changed.shear_of_strain,
                changed.strength_of_depth,
                changed.strength_of_time,
            )
            if law
        ]
        assert min(factor for _, factor in hardest) >= LEAST
    check_setting(add_term(SETTING, term, min(high, 0.1)))


def test_a_drag_is_the_tip_s_section_times_its_formula():
    table = add_term(SETTING, TERMS["inertial_drag"], 100.0).force_of_speed
    speed, force = np.array(table).T
    np.testing.assert_allclose(force, 100.0 * speed**2 * AREA, rtol=1e-12)
    assert speed[-1] > SETTING.impact_speed


def test_a_drag_of_the_shaft_goes_with_depth_and_speed():
    depth, drag = np.array(add_term(SETTING, TERMS["shaft_drag"], 300.0).drag_of_depth).T
    np.testing.assert_allclose(drag, 300.0 * depth / 5e-4 * AREA, rtol=1e-12)
    time, force = np.array(add_term(SETTING, TERMS["time_ramp"], 70.0).force_of_time).T
    np.testing.assert_allclose(force, 70.0 * 1e3 * time * AREA, rtol=1e-12)


def test_mass_that_is_gathered_grows_with_depth():
    """Where it fell, dust that lies still would push the tip along."""
    falling = replace(TERMS["gathered_mass"], shape=lambda z: np.exp(-z))
    assert falling.limits == (0.0, 0.0)
    assert TERMS["gathered_mass"].limits == (0.0, math.inf)


def test_forces_add_up_and_factors_multiply():
    law = Law(
        (("constant_pressure", 50.0), ("hardening", 0.1)),
        (
            ("force of depth", ((0.0, 10.0), (2.0, 30.0))),
            ("strength of filling factor", ((0.15, 0.2), (0.3, 0.2))),
        ),
    )
    made = apply_law(SETTING, law)
    depth, force = np.array(made.force_of_depth).T
    np.testing.assert_allclose(np.interp(5e-4, depth, force), (50.0 + 20.0) * AREA, rtol=1e-9)
    phi, factor = np.array(made.strength_shape).T
    np.testing.assert_allclose(np.interp(0.25, phi, factor), 1.2 * (1 + 0.1 * 10 * 0.1), rtol=1e-9)


def test_mass_is_a_share_of_the_projectile_s_and_grows_no_less():
    depth, mass = np.array(add_term(SETTING, TERMS["stuck_mass"], 0.3).mass_of_depth).T
    np.testing.assert_allclose(mass, 0.3 * SETTING.projectile.mass * depth / 5e-4, rtol=1e-12)
    cap = np.array(add_term(SETTING, TERMS["stuck_cap"], 0.3).mass_of_depth)
    assert cap[-1, 1] == pytest.approx(0.3 * SETTING.projectile.mass)
    assert np.all(np.diff(cap[:, 1]) >= 0)


def test_a_strength_that_goes_with_size_is_a_power_of_the_radius():
    """In a drop it is another p_m; no run is needed to know what it changes."""
    small = SETTING.replace(projectile=replace(SETTING.projectile, tip_radius=0.25e-3))
    factors = [
        add_term(each, TERMS["size_power"], 0.4).material.p_m / each.material.p_m for each in (SETTING, small)
    ]
    assert factors[0] == pytest.approx(0.5**0.4) and factors[0] / factors[1] == pytest.approx(2.0**0.4)
    law = Law((), (("strength of size", ((0.5, 0.1), (1.0, 0.0))),))
    assert apply_law(SETTING, law).material.p_m == pytest.approx(SETTING.material.p_m * math.exp(0.1))


def test_a_law_survives_its_file_and_reaches_the_drop(tmp_path):
    law = Law((("inertial_drag", 120.5),), (("force of depth", ((0.0, 0.0), (1.0, 80.0), (2.0, -3.25))),))
    model = Model(1012.0, (), (), law)
    file = write_model(tmp_path / "model.toml", model)
    assert read_model(file) == model
    assert "# Pa s²/m², times v²" in file.read_text(encoding="utf-8")
    shutter = replace(model, law=Law((("rolling_shutter", 4.0),)))
    assert read_model(write_model(tmp_path / "shutter.toml", shutter)) == shutter
    assert make_instrument(shutter, PLACE).row_delay == pytest.approx(0.2)  # s/m
    assert apply_model(SETTING, shutter, None).force_of_speed == ()
    made = apply_model(SETTING, model, None)
    assert made.material.p_m == 1012.0 and made.force_of_speed and made.force_of_depth


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("inertial_drag = -3.0", "law.inertial_drag: -3 is outside 0"),
        ("inertal_drag = 3.0", "did you mean inertial_drag"),
        ("force_of_speed = [[0.0, 1.0], [1.0, -1.0]]", "pushes along the motion"),
        ("force_of_depth = [[1.0, 1.0], [0.0, 1.0]]", "do not grow"),
        ("force_of_depth = 3", "is no table"),
        ("mass_of_depth = [[0.0, 0.0], [1.0, -3.0]]", "takes mass away"),
        ("strength_of_filling_factor = [[0.15, 0.0], [0.3, -1.0]]", "leaves no strength"),
        (
            "gathered_mass_of_depth = [[0.0, 1.0], [1.0, 0.0]]",
            "falls to 0 at 1 tip radii, which pushes along",
        ),
        ("drag_of_depth = [[0.0, 0.0], [1.0, -1.0]]", "pushes along the motion"),
    ],
)
def test_what_is_no_law_is_refused(tmp_path, text, said):
    file = tmp_path / "model.toml"
    file.write_text(f"format = 1\n[material]\np_m_Pa = 1000.0\n[law]\n{text}\n")
    with pytest.raises(EffectError) as raised:
        read_model(file)
    assert said in str(raised.value)


def test_a_drag_stops_a_drop_earlier_by_what_energy_says():
    """It takes of the work of stopping what it does at the speed of impact all along, at most."""
    setting = replace(SETTING, spacing=SETTING.projectile.tip_radius / 4, gravity=0.0)
    plain = simulate(setting).penetration_depth
    dragged = simulate(add_term(setting, TERMS["inertial_drag"], 500.0)).penetration_depth
    most = (
        500.0
        * setting.impact_speed**2
        * AREA
        * plain
        / (0.5 * setting.projectile.mass * setting.impact_speed**2)
    )
    assert plain * (1 - most) < dragged < plain


@pytest.mark.parametrize("name", TERMS)
def test_a_learned_term_becomes_an_effect_of_the_campaign(tmp_path, name):
    """What the command writes is loaded as any effect is, and does what the term does."""
    campaign = shutil.copytree(
        CAMPAIGN, tmp_path / "campaign", ignore=shutil.ignore_patterns("ct", "effects")
    )
    size = max(min(3.0, TERMS[name].limits[1]), 0.0) or TERMS[name].limits[0]
    (tmp_path / "out").mkdir()
    write_model(tmp_path / "out" / "model.toml", Model(1000.0, (), (), Law(((name, size),))))
    [path] = write_learned(tmp_path / "out", campaign)
    effect = list_effects(read_campaign(campaign))[path.stem]
    assert effect.title == TERMS[name].title and effect.amplitudes[0].unit == TERMS[name].unit
    if TERMS[name].acts.see:
        seen = effect.apply_to_instrument(Instrument(), {"coefficient": size}, PLACE)
        assert seen == see_term(Instrument(), TERMS[name], size, PLACE) != Instrument()
    else:
        made = effect.apply(SETTING, {"coefficient": size}, None)
        assert made == add_term(SETTING, TERMS[name], size) != SETTING
    with pytest.raises(EffectError, match="is there already"):
        write_learned(tmp_path / "out", campaign)


def test_a_diagnosis_that_learned_nothing_gives_no_effect(tmp_path):
    write_model(tmp_path / "model.toml", Model(1000.0))
    with pytest.raises(EffectError, match="holds no term"):
        write_learned(tmp_path, tmp_path)
