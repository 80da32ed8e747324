"""The friction sleeve behind a pushed cone: what is compared of it, and contact friction that it tells from strength."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labsim.calibrated import set_value
from labsim.campaign import read_campaign
from labsim.errors import InferenceError
from labsim.inference.calibrate import prepare
from labsim.inference.emulation.grid import hasten, set_nominal_drop, set_push
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.measure import Measurements, measure
from labsim.inference.observations.observe_push import ObservedPush
from labsim.inference.observations.push_model import extract_push
from labsim.inference.observations.sleeve_friction import (
    USUAL,
    SleeveFriction,
    extract_sleeve,
    measure_spread,
)
from labsim.inference.supported import refuse_others
from labsim.inspection.drops import inspect_drop
from labsim.records import Campaign, Material, Sleeve
from labsim.runs.parts import Push
from labsim.runs.store import RunStore
from labsim.sph import simulate

TILLER = Path(__file__).resolve().parents[2] / "data/campaigns/tiller"
SHOWN = Sleeve()  # not compared
SIX = ("TILC69", "TILC75", "TILC50", "TILC58", "TILC72", "TILC77")
FRICTION, COHESION = 0.2, 6e4  # hidden; Pa at 8.5 m
KEYS = """[drop]
sequence = {sequence}
[projectile]
tip = "cone"
half_angle_deg = 30.0
tip_radius_mm = 17.84
[motion]
kind = "pushed"
speed_m_s = 0.02
[record]
kind = "force"
file = "push.csv"
depth_column = "z_m"
pressure_column = "q_kPa"
force_unit = "kPa"
sigma = 5.0
scale_sigma = 0.01
window_mm = [4000, 12000]
sleeve_column = "f_kPa"
sleeve = {sleeve}
sleeve_sigma = 0.3
sleeve_offset_sigma = 0.5
sleeve_scale_sigma = 0.02
"""


def choose(sleeve: Sleeve = SHOWN) -> tuple[Campaign, list[ObservedPush]]:
    """Six soundings at Tiller, whose records have a sleeve, with other keys of it."""
    campaign, made = read_campaign(TILLER), []
    for push in measure(campaign).drops:
        assert isinstance(push, ObservedPush) and push.drop.gauge is not None
        if push.name in SIX:
            made.append(replace(push, drop=replace(push.drop, gauge=replace(push.drop.gauge, sleeve=sleeve))))
    return replace(campaign, drops=tuple(push.drop for push in made)), made


def fit(
    campaign: Campaign, pushes: list[ObservedPush], store: str, *causes: str
) -> tuple[list[str], Fit, Fit]:
    """Names of the data that are compared, the nominal fit, and that with causes."""
    problem, nominal = prepare(campaign, RunStore(store), measurements=Measurements(list(pushes)), workers=2)
    start = (nominal.log_p_m, {name: 0.1 for name in causes})
    names = [each.name for each in problem.observations]
    return names, nominal, fit_hypothesis(problem, causes, start) if causes else nominal


def test_the_ratio_of_a_run_is_that_of_an_even_sleeve() -> None:
    """f_s on all that the tip has passed: the shaft's work is π R f_s L², the tip's π R² q L."""
    campaign, _ = choose()
    radius, way, friction, tip = 17.84e-3, 0.07, 9e3, 6e5
    setting = set_push(set_nominal_drop(campaign, campaign.drops[0].projectile.simulated, 0.02, 8e4, 4), 0.02)
    shaft = math.pi * radius * friction * way**2
    run = Push(
        setting,
        np.array([0.1, 0.1 + way]),
        np.array([0.0, shaft]),
        {"driver": math.pi * radius**2 * tip * way + shaft},
        True,
    )
    assert extract_sleeve(run)[0] == pytest.approx(friction / tip)


def test_ratios_of_real_soundings_scatter_from_record_to_record() -> None:
    """At Tiller the ratio is 0.8 %, and a record's zero moves all of it: 1 of 5 kPa."""
    pushes = [push for push in measure(read_campaign(TILLER)).drops if isinstance(push, ObservedPush)]
    spread = measure_spread(pushes)
    print(spread)
    assert spread.level == pytest.approx(0.008, rel=0.1)
    assert 0.15 < spread.records < 0.25 and max(spread.profile, spread.rest) < 0.05
    few = measure_spread(pushes[:3])
    assert few.records == few.profile == few.rest == USUAL


def test_a_sleeve_that_does_not_count_changes_nothing(shared_store: str) -> None:
    campaign, pushes = choose()
    without = [replace(push, friction_ratio=np.empty(0), friction_sigma=np.empty(0)) for push in pushes]
    names, with_sleeve, _ = fit(campaign, pushes, shared_store)
    names_without, plain, _ = fit(campaign, without, shared_store)
    assert names == names_without == ["pushes"]
    assert with_sleeve.log_p_m == plain.log_p_m and with_sleeve.evidence == plain.evidence
    counted = choose(Sleeve(sigma=300.0, offset_sigma=1e3, compared=True))
    problem, _ = prepare(
        counted[0], RunStore(shared_store), measurements=Measurements(list(counted[1])), workers=2
    )
    assert [each.name for each in problem.observations] == ["pushes", "sleeves"]
    assert isinstance(problem.observations[1], SleeveFriction)
    assert problem.observations[1].data.size == sum(push.windows.size for push in pushes)


def write_campaign(folder: Path, sleeve: bool, resistance: float, ratio: float) -> Campaign:
    """Six soundings in ground whose strength grows with depth, by a run's resistance (cohesions) and friction ratio."""
    text = (TILLER / "campaign.toml").read_text()
    (folder / "drops").mkdir(parents=True)
    (folder / "campaign.toml").write_text(text)
    rng, z = np.random.default_rng(1), np.arange(4.0, 12.0, 0.02)
    for k in range(6):
        drop = folder / "drops" / f"P{k}"
        drop.mkdir()
        net = resistance * COHESION * (1 + 0.07 * (z - 8.5)) * math.exp(0.02 * rng.standard_normal())
        net *= 1 + 0.02 * rng.standard_normal(z.size)
        tip = net + 1800 * 9.81 * z + 5e3 * rng.standard_normal(z.size)
        felt = ratio * math.exp(0.05 * rng.standard_normal()) * net + 300 * rng.standard_normal(z.size)
        rows = "\n".join(f"{a:.2f},{b / 1e3:.3f},{c / 1e3:.4f}" for a, b, c in zip(z, tip, felt, strict=True))
        (drop / "push.csv").write_text("z_m,q_kPa,f_kPa\n" + rows + "\n")
        (drop / "drop.toml").write_text(KEYS.format(sequence=k + 1, sleeve=str(sleeve).lower()))
    return read_campaign(folder)


def test_check_shows_the_ratio_whether_it_counts_or_not() -> None:
    for sleeve, words in ((SHOWN, "not compared"), (Sleeve(sigma=300.0, compared=True), "compared")):
        campaign, _ = choose(sleeve)
        found = inspect_drop(campaign.drops[0], campaign)
        assert found.line.endswith(f" % of the net resistance, {words}") and not found.odd
        assert 0.004 < found.numbers["friction_ratio"] < 0.012


def test_a_sleeve_in_a_law_whose_shaft_depends_on_the_spacing_is_refused() -> None:
    campaign, _ = choose(Sleeve(sigma=300.0, compared=True))
    with pytest.raises(InferenceError, match=r"not with porous_dust .*write sleeve = false"):
        refuse_others(replace(campaign, material=Material(), p_m_range=(500.0, 5000.0)))


def test_a_hidden_contact_friction_is_found_with_a_sleeve_alone(tmp_path: Path, shared_store: str) -> None:
    """Made at six spacings in a tip radius, fitted at four. Without a sleeve friction is taken for strength."""
    campaign = read_campaign(TILLER)
    push = set_push(set_nominal_drop(campaign, campaign.drops[0].projectile.simulated, 0.02, 8e4, 6), 0.02)
    rough = set_value(push.material, COHESION).replace(contact_friction=FRICTION)
    run = simulate(hasten(push.replace(material=rough)))
    resistance, ratio = math.exp(extract_push(run, whole=False)[0]) / COHESION, float(extract_sleeve(run)[0])
    found = {}
    for sleeve in (True, False):
        made = write_campaign(tmp_path / str(sleeve), sleeve, resistance, ratio)
        pushes = [each for each in measure(made).drops if isinstance(each, ObservedPush)]
        _, nominal, cause = fit(made, pushes, shared_store, "contact_friction")
        sigma = math.sqrt(cause.covariance[1, 1])
        found[sleeve] = cause.evidence - nominal.evidence, cause.values["contact_friction"], sigma, cause
        print(
            f"sleeve {sleeve}: contact friction {found[sleeve][1]:.3f} ± {sigma:.3f}, evidence {found[sleeve][0]:+.1f}; "
            f"cohesion {math.exp(nominal.log_p_m) / 1e3:.1f} kPa without it, {math.exp(cause.log_p_m) / 1e3:.1f} kPa with it"
        )
    gain, value, sigma, cause = found[True]
    assert gain > 20.0
    assert sigma < 0.06 and abs(value - FRICTION) < 2.5 * sigma
    assert math.exp(cause.log_p_m) == pytest.approx(COHESION, rel=0.1)
    gain, _, sigma, _ = found[False]
    assert gain < 1.0 and sigma > 0.1
