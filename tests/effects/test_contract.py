"""Files that break the contract are named; a user's own file joins the catalogue."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.effects import (
    CATALOGUE,
    Cauchy,
    HalfNormal,
    Instrument,
    LogNormal,
    Normal,
    Parameter,
    Prior,
    Uniform,
    deepest_dust,
    list_effects,
    list_impacts,
    list_places,
    load_effect,
    load_file,
    loading,
    reference_campaign,
)
from labsim.effects.loading import list_own_files
from labsim.errors import EffectError
from labsim.inference.emulation.grid import set_nominal_drop
from labsim.records import Material, Projectile
from labsim.sph import DropSetting
from labsim.sph.materials import list_laws
from labsim.sph.materials._parts import strengthen
from labsim.sph.materials.von_mises import make_constants

DATA = Path(__file__).parents[2] / "data" / "guettler2009"

GOOD = '''"""Dust is carried along with the tip."""

from dataclasses import replace

from labsim.effects import HalfNormal, Parameter

title = "Dust moves along with the tip"
kind = "projectile"
parameters = (
    Parameter("mass", "kg", null=0.0, limits=(0.0, 1e-5), prior=HalfNormal(5e-7), step=2e-7,
              text="About the dust in front of a tip of 1 mm, half its volume at the density of the sample."),
)
leaves = "Fast drops go deeper than slow ones say."
references = ("Added mass of a sphere in a fluid",)
expect = {"penetration_depth": 1}


def change_setting(setting, values, place):
    return setting.replace(projectile=replace(setting.projectile, mass=setting.projectile.mass + values["mass"]))
'''

# what is replaced in GOOD by what, and what the error must name besides the file
BROKEN = {
    "not python": ("def change", "dfe change", ["line 18", "not Python"]),
    "raises": ('kind = "projectile"', "kind = 1 / 0", ["ZeroDivisionError", "correct the file"]),
    "missing import": ("import HalfNormal, Parameter", "import Nonsense", ["Nonsense"]),
    "no title": ('title = "Dust moves along with the tip"', "", ["title", "is missing"]),
    "empty title": ("Dust moves along with the tip", "", ["title"]),
    "unknown kind": ('kind = "projectile"', 'kind = "magic"', ["kind", "magic", "material, sample"]),
    "no parameters": ("parameters = (", "forgotten = (", ["parameters", "is missing"]),
    "not a tuple": ("parameters = (\n", "parameters = 3\nrest = (\n", ["parameters", "tuple of Parameter"]),
    "null outside": ("null=0.0", "null=-1.0", ["parameters.mass", "null -1", "0 to 1e-05"]),
    "limits turned": ("limits=(0.0, 1e-5)", "limits=(1e-5, 0.0)", ["parameters.mass", "limits", "grow"]),
    "limits infinite": ("limits=(0.0, 1e-5)", 'limits=(0.0, float("inf"))', ["parameters.mass", "finite"]),
    "no step": ("step=2e-7", "step=0.0", ["parameters.mass", "step"]),
    "step too long": ("step=2e-7", "step=-2e-7", ["parameters.mass", "null + step", "turn the step"]),
    "no prior": ("prior=HalfNormal(5e-7)", "prior=0.3", ["parameters.mass", "HalfNormal"]),
    "no width": ("HalfNormal(5e-7)", "HalfNormal(0.0)", ["parameters.mass", "positive width"]),
    "prior elsewhere": ("HalfNormal(5e-7)", "HalfNormal(5e-7, 1.0)", ["parameters.mass", "leaves nothing"]),
    "no unit": ('"kg"', '""', ["parameters.mass", "unit"]),
    "no reason": ("About the dust in front of a tip of 1 mm, half its volume at the density of the sample.", "",
                  ["parameters.mass", "text is empty"]),
    "bad name": ('"mass", "kg"', '"the mass", "kg"', ["the mass", "name"]),
    "only shape": ("step=2e-7,", "step=2e-7, shape=True,", ["parameters", "all shape"]),
    "text null": ("null=0.0", 'null="zero"', ["parameters.mass", "numbers"]),
    "failing function": ("parameters = (\n", "def parameters(campaign): return campaign.nonsense\nrest = (\n",
                         ["parameters", "AttributeError"]),
    "no leaves": ('leaves = "', 'left = "', ["leaves", "is missing"]),
    "no references": ("references = (", "sources = (", ["references", "tuple of texts"]),
    "unknown observable": ('"penetration_depth": 1', '"depth": 1', ["expect", "penetration_depth"]),
    "remedy not a sentence": ('expect = {', 'remedy = "{other}"\nexpect = {', ["remedy", "first parameter"]),
    "a way without it that is no text": ('expect = {', 'without = 3\nexpect = {', ["without", "deeper sample"]),
    "one title for two": ('kind = "', 'says = ("Lighter",)\nkind = "', ["says", "two titles"]),
    "sign not a sign": ('"penetration_depth": 1', '"penetration_depth": 2', ["expect", "-1, 0 or 1"]),
    "changes nothing": ("def change_setting", "def change_nothing", ["change_setting", "at least one"]),
    "two arguments": ("(setting, values, place)", "(setting, values)", ["change_setting", "3 arguments"]),
    "not a function": ("def change_setting", "change_setting = 1\ndef other", ["change_setting", "not a function"]),
    "applies is text": ('title = "', 'applies = "yes"\ntitle = "', ["applies", "not a function"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_contract_names_the_file(name: str, tmp_path: Path) -> None:
    old, new, words = BROKEN[name]
    assert old in GOOD
    file = tmp_path / "added_mass.py"
    file.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(EffectError) as caught:
        load_file(file)
    text = str(caught.value)
    assert text.startswith(f"{file}: ") and "\n" not in text
    for word in words:
        assert word in text, text


def test_applies_must_give_a_text(tmp_path: Path) -> None:
    file = tmp_path / "added_mass.py"
    file.write_text(GOOD + "\n\ndef applies(campaign):\n    return True\n")
    with pytest.raises(EffectError, match=r"added_mass\.py: applies: returned True"):
        load_file(file).applies(reference_campaign())


def copy_campaign(folder: Path) -> Path:
    return Path(shutil.copytree(DATA, folder / "mine"))


def test_a_users_own_file_joins_the_catalogue(tmp_path: Path) -> None:
    folder = copy_campaign(tmp_path)
    (folder / "effects").mkdir()
    (folder / "effects" / "added_mass.py").write_text(GOOD)
    (folder / "effects" / "_notes.py").write_text("this is not Python")
    campaign = read_campaign(folder)
    effects = list_effects(campaign)
    assert set(effects) - set(list_effects()) == {"added_mass"}
    assert "added_mass" in list_effects(folder)
    mine = effects["added_mass"]
    assert (
        mine.applies(campaign) == ""
        and mine.affects_simulation
        and mine.description.startswith("Dust is carried")
    )
    place = list_places(campaign)["S01"]
    drop = campaign.drops[0]
    setting = DropSetting(projectile=drop.projectile, impact_speed=0.65, material=campaign.material)
    assert mine.apply(setting, {"mass": 1e-7}, place).projectile.mass == drop.projectile.mass + 1e-7
    assert mine.apply(setting, {}, place) == setting
    assert mine.apply_to_instrument(Instrument(), {"mass": 1e-7}, place) == Instrument()
    assert sorted(path.name for path in (folder / "effects").iterdir()) == ["_notes.py", "added_mass.py"]


def test_an_edited_file_is_loaded_anew(tmp_path: Path) -> None:
    file = tmp_path / "added_mass.py"
    file.write_text(GOOD)
    assert load_file(file).parameters[0].step == 2e-7
    file.write_text(GOOD.replace("step=2e-7", "step=3e-7"))
    assert load_file(file).parameters[0].step == 3e-7


def test_names_that_are_taken_or_cannot_be_names(tmp_path: Path) -> None:
    folder = copy_campaign(tmp_path)
    (folder / "effects").mkdir()
    file = folder / "effects" / "gravity.py"
    file.write_text(GOOD)
    with pytest.raises(EffectError, match=r"gravity\.py: gravity is the name of an effect of the catalogue"):
        list_effects(folder)
    file.rename(file.with_name("Added-Mass.py"))
    with pytest.raises(EffectError, match=r"Added-Mass\.py: 'Added-Mass' cannot be an effect's name"):
        list_effects(folder)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(EffectError, match=r"frition.*contact_friction, ct_blur"):
        load_effect("frition")
    assert load_effect("gravity").name == "gravity"


def test_nothing_but_effects_lies_in_the_catalogue() -> None:
    assert {file.stem for file in CATALOGUE.glob("*.py")} - {"__init__"} == set(list_effects())


def test_nulls_are_the_campaigns_own() -> None:
    usual = reference_campaign()
    material = usual.material.replace(
        delta=0.33, phi_2=0.33, bulk_modulus=3e5, shear_factor=0.8, contact_friction=0.2
    )
    sample = dataclasses.replace(usual.sample, filling_factor=0.2, depth=0.012)
    campaign = dataclasses.replace(usual, material=material, sample=sample)
    nulls = {
        f"{name}.{parameter.name}": parameter.null
        for name, effect in list_effects(campaign).items()
        for parameter in effect.parameters
    }
    assert nulls["strength_slope.delta"] == 0.33 and nulls["strength_ceiling.phi_2"] == 0.33
    assert nulls["bulk_modulus.K0"] == 3e5 and nulls["shear_strength.factor"] == 0.8
    assert nulls["contact_friction.mu"] == 0.2 and nulls["filling_factor.phi_0"] == 0.2
    assert nulls["hard_floor.depth"] == 0.012


DUSTS = [(phi, phi_2) for phi in (0.13, 0.15, 0.25, 0.4) for phi_2 in (0.33, 0.58, 0.70) if phi < phi_2]


@pytest.mark.parametrize(("phi", "phi_2"), DUSTS)
def test_the_catalogue_fits_other_laboratories(phi: float, phi_2: float) -> None:
    """Limits, steps and priors hold for dust near either end of its law, for small and for large tips."""
    usual = reference_campaign()
    for scale in (0.2, 1.0, 5.0):
        drops = tuple(
            dataclasses.replace(
                drop,
                projectile=dataclasses.replace(
                    drop.projectile,
                    tip_radius=scale * drop.projectile.tip_radius,
                    mass=scale**3 * drop.projectile.mass,
                ),
            )
            for drop in usual.drops
        )
        campaign = dataclasses.replace(
            usual,
            drops=drops,
            sample=dataclasses.replace(usual.sample, filling_factor=phi),
            material=usual.material.replace(phi_2=phi_2),
        )
        for effect in list_effects(campaign).values():
            assert effect.at() == {parameter.name: parameter.null for parameter in effect.parameters}


@pytest.mark.parametrize(
    "prior",
    [Normal(1.0, 0.3), Cauchy(1.0, 0.3), HalfNormal(2.0, 0.5), LogNormal(3.0, 0.6), Uniform(-1.0, 4.0)],
)
def test_priors_agree_with_themselves(prior: Prior) -> None:
    from scipy import stats

    twin = {
        Normal: lambda: stats.norm(1.0, 0.3),
        Cauchy: lambda: stats.cauchy(1.0, 0.3),
        HalfNormal: lambda: stats.halfnorm(0.5, 2.0),
        LogNormal: lambda: stats.lognorm(0.6, scale=3.0),
        Uniform: lambda: stats.uniform(-1.0, 5.0),
    }[type(prior)]()
    x = np.linspace(-2.0, 8.0, 41)
    assert np.allclose(prior.logpdf(x), twin.logpdf(x), rtol=1e-12)
    assert np.allclose(prior.cdf(x), twin.cdf(x), rtol=1e-12, atol=1e-14)
    q = np.linspace(0.01, 0.99, 21)
    assert np.allclose(prior.ppf(q), twin.ppf(q), rtol=1e-9)
    rng = np.random.default_rng(4)
    draws = [prior.sample(rng) for _ in range(4000)]
    assert stats.kstest(draws, twin.cdf).pvalue > 1e-3
    assert prior.describe()


def test_what_stands_in_for_a_cauchy_prior_falls_as_it_does() -> None:
    """A fit that follows the Gaussian about null, anew at every step, ends at the top of the prior itself."""
    parameter = Parameter("mass", "kg", 0.0, (-1e3, 1e3), Cauchy(0.0, 2.0), 0.1, "no reason")
    for amplitude in (-30.0, -1.0, 0.5, 8.0):
        width, log_ratio = parameter.stand_in(amplitude)
        slope = np.diff(parameter.log_prior(amplitude + np.array([-1e-5, 1e-5])))[0] / 2e-5
        assert -amplitude / width**2 == pytest.approx(slope, rel=1e-6)
        assert log_ratio == pytest.approx(float(parameter.log_prior(amplitude) - parameter.log_prior(0.0)))
    gaussian = dataclasses.replace(parameter, prior=Normal(0.0, 2.0))
    assert gaussian.stand_in(3.0) == (pytest.approx(2.0, rel=0.01), pytest.approx(-0.5 * 1.5**2, rel=0.02))


def test_the_deepest_dust_is_that_of_the_softest_run() -> None:
    """No drop or scan of the campaign, at any p_m of its range, holds more dust than gradients are limited for."""
    campaign = reference_campaign()
    lowest, highest = campaign.p_m_range
    thrown = [*campaign.drops, *campaign.scans]
    depths = [
        set_nominal_drop(campaign, each.projectile, speed, p_m, 5.0).extent[1]
        for each, (_, _, speed) in zip(thrown, list_impacts(campaign), strict=True)
        for p_m in np.geomspace(lowest, highest, 7)
    ]
    spacing = 1.5e-3 / 5.0  # of the largest tip: depths are whole numbers of it
    assert deepest_dust(campaign) == pytest.approx(max(depths), abs=spacing)
    shallow = dataclasses.replace(campaign, p_m_range=(1300.0, highest))
    assert deepest_dust(shallow) < 0.9 * deepest_dust(campaign)
    steepest = load_effect("density_gradient", campaign).parameters[0].limits[1]
    assert campaign.sample.filling_factor + steepest * max(depths) < campaign.material.phi_2


def test_code_of_a_campaign_is_announced_before_it_runs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "effects").mkdir()
    file = tmp_path / "effects" / "evil.py"
    file.write_text(
        "import logging\nlogging.getLogger('evil').warning('it runs')\n" + GOOD.split('"""', 2)[2],
        encoding="utf-8",
    )
    assert list_own_files(tmp_path) == {"evil": file} and not caplog.records  # listed, not run
    list_effects(tmp_path)
    assert [record.getMessage() for record in caplog.records] == [
        f"runs effects/evil.py of this campaign ({tmp_path.resolve()})",
        "it runs",
    ]
    list_effects(tmp_path)  # kept: not run again
    assert len(caplog.records) == 2


def test_effects_of_the_catalogue_are_not_announced(caplog: pytest.LogCaptureFixture) -> None:
    loading._loaded.clear()
    list_effects()
    assert not caplog.records


@pytest.mark.parametrize("law", list_laws())
def test_effects_attach_where_the_law_has_what_they_change(law):
    """A rate goes with every strength, the slope of Σ with the dust's alone; whatever does not attach says what is missing."""
    campaign = reference_campaign()
    campaign = dataclasses.replace(campaign, material=Material(law=law))
    against = {name: effect.applies(campaign) for name, effect in list_effects().items()}
    assert against["strength_rate"] == "" and against["pixel_scale"] == ""
    if law == "porous_dust":
        assert not any("has no" in reason for reason in against.values())
    else:
        assert against["strength_slope"] == f"the law {law} has no delta"
        assert against["pore_gas"] == f"the law {law} has no pore_gas"
        assert against["surface_crust"].startswith(f"the law {law} has no ")


def test_needs_that_are_no_names(tmp_path):
    file = tmp_path / "wrong.py"
    source = (CATALOGUE / "strength_slope.py").read_text()
    file.write_text(source.replace('needs = ("delta",)', 'needs = "delta"'))
    with pytest.raises(EffectError, match="needs"):
        load_file(file)


@pytest.mark.parametrize("n", [0.0, 0.13, 0.4])
def test_both_forms_of_a_rate_gain_the_same_a_decade_where_the_strength_is_stated(n):
    """Cohesion is the strength at a thousand times the reference rate; there it grows by 0.14 of itself a decade."""
    clay = Material(law="von_mises", constants=(("cohesion", 5e4), ("rate_reference", 2e-3)))
    setting = DropSetting(Projectile("cone", 0.01, 1.0), 1.0, material=clay, spacing=2e-3)
    effect = list_effects()["strength_rate"]
    campaign = dataclasses.replace(reference_campaign(), material=clay)
    place = list_places(campaign)[campaign.drops[0].name]
    changed = effect.for_campaign(campaign).with_shape(n).apply(setting, {"per_decade": 0.14, "n": n}, place)
    law = make_constants(changed)

    def strength(decades: float) -> float:
        return law.cohesion * strengthen(2.0 * 10.0**decades, law.rate)

    assert strength(0.0) == pytest.approx(5e4)
    assert (strength(1e-3) - strength(-1e-3)) / 2e-3 == pytest.approx(0.14 * 5e4, rel=1e-4)
    assert strength(1.0) == pytest.approx(57e3) if n == 0.0 else strength(1.0) > 57.1e3


def test_an_exponent_of_the_rate_leaves_what_a_step_and_the_prior_make_of_the_strength():
    """At 1000/s, whatever n; and equal grades multiply (1 + η 1000ⁿ) by equal factors."""
    effect = list_effects()["strength_rate"]
    for n in (0.2, 0.5, 1.0):
        (eta,) = effect.with_shape(n).amplitudes
        assert eta.step * 1000.0**n == pytest.approx(0.03 * 1000.0**0.5)
        assert eta.prior.sd * 1000.0**n == pytest.approx(0.05 * 1000.0**0.5)
        grades = eta.grade(eta.step) * np.arange(4)
        factors = [1.0 + eta.amplitude_at(grade) * 1000.0**n for grade in grades]
        assert np.diff(np.log(factors)) == pytest.approx(np.log(factors[1]) * np.ones(3))
        assert eta.grade(eta.amplitude_at(0.7 * eta.step)) == pytest.approx(0.7 * eta.step)


def test_a_reshape_that_takes_other_arguments_is_refused(tmp_path):
    file = tmp_path / "wrong.py"
    file.write_text(
        (CATALOGUE / "strength_slope.py").read_text() + "\n\ndef reshape(parameter):\n    return parameter\n"
    )
    with pytest.raises(EffectError, match=r"write def reshape\(parameter, value\)"):
        load_file(file)
