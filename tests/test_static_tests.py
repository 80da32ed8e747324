"""Static strength tests: read, refused, fitted, and compared with the drops of a campaign."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from laws import LawStore, write_campaign
from strength_tests import OMNIDIRECTIONAL, TENSION, UNIDIRECTIONAL, make_test, stress, write_test

from labsim.campaign import read_campaign
from labsim.cli import main
from labsim.diagnosis.campaign import judge_scatters
from labsim.errors import CampaignError, InferenceError
from labsim.inference.calibrate import calibrate, prepare
from labsim.inference.fits.tangents import linearise_alone
from labsim.inference.observations.static_tests import StaticTests, fit_softness, fit_strength
from labsim.records import Material

KINDS = ("compression_omnidirectional", "compression_unidirectional", "tension", "shear")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_campaign(tmp_path / "made")


# reading


def test_a_test_is_read_as_it_was_written(folder):
    for seed, kind in enumerate(KINDS, start=1):
        write_test(folder, make_test(kind, seed))
    tests = read_campaign(folder).strength_tests
    assert [test.kind for test in tests] == list(KINDS)
    for seed, (kind, test) in enumerate(zip(KINDS, tests, strict=True), start=1):
        assert np.array(test.points) == pytest.approx(np.array(make_test(kind, seed).points), rel=1e-4)


def test_height_and_force_give_filling_factor_and_pressure(folder):
    """400 mg of grains of 2000 kg/m³ in a tube 25 mm wide: 2 mm high at φ 0.2037, 1 N over its area is 2037 Pa."""
    place = folder / "strength" / "S01"
    place.mkdir(parents=True)
    (place / "log.csv").write_text("height;force\n2,0;1,0\n1,5;4,0\n1,0;20,0\n")
    (place / "strength.toml").write_text(
        '[test]\nkind = "compression_omnidirectional"\nfile = "log.csv"\nheight_column = "height"\n'
        'force_column = "force"\ndiameter_mm = 25\nmass_mg = 400\nrelative_sigma = 0.05\n'
    )
    area = math.pi / 4 * 0.025**2
    (test,) = read_campaign(folder).strength_tests
    expected = [(400e-6 / 2000 / area / h, f / area) for h, f in ((2e-3, 1), (1.5e-3, 4), (1e-3, 20))]
    assert np.array(test.points) == pytest.approx(np.array(expected))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("0.140000,", "x,"), r"curve\.csv: line 2: 'x' is not a number"),
        (("phi,pressure", "phi,stress"), r"line 1: has no column 'pressure'; the columns are phi, stress"),
        (("0.140000,", "14.0,"), r"filling factor of 14 is outside"),
        (("0.140000,", "0.14,-"), r"pressure of -.* write the size of a tension without a sign"),
        (("0.140000,", "nan,"), r"line 2: has no number in 'phi'"),
    ],
)
def test_a_wrong_table_is_named_with_its_line(folder, change, message):
    place = write_test(folder, make_test(KINDS[0], 1))
    text = (place / "curve.csv").read_text()
    assert change[0] in text
    (place / "curve.csv").write_text(text.replace(*change, 1))
    with pytest.raises(CampaignError, match=message):
        read_campaign(folder)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('"tension"', '"pull"', r"test\.kind: 'pull' is not known"),
        ("relative_sigma = 0.05", "relative_sigma = 5", r"relative_sigma: 5 is outside 0\.0001 to 1"),
        ('"kPa"', '"psi"', r"pressure_unit: 'psi' is not known; write one of \"Pa\""),
        ("curve.csv", "gone.csv", r"test\.file: .*gone\.csv is not there"),
        ("relative_sigma", "sigma", r"test\.relative_sigma: is missing"),
    ],
)
def test_a_wrong_key_is_named(folder, before, after, message):
    place = write_test(folder, make_test("tension", 1))
    text = (place / "strength.toml").read_text()
    assert before in text
    (place / "strength.toml").write_text(text.replace(before, after))
    with pytest.raises(CampaignError, match=message):
        read_campaign(folder)


def test_one_test_filed_twice_is_refused(folder):
    test = make_test("tension", 1)
    write_test(folder, test)
    write_test(folder, replace(test, name="S02"))
    with pytest.raises(CampaignError, match="holds the rows of S01"):
        read_campaign(folder)


def test_what_a_test_contradicts_is_odd(folder, capsys):
    good = make_test(KINDS[0], 1)
    fallen = [(phi, p * (0.3 if phi > 0.4 else 1.0)) for phi, p in good.points]
    write_test(folder, good)
    write_test(folder, replace(good, name="S02", points=tuple(fallen)))
    write_test(folder, replace(make_test("tension", 3, sigma=0.03), relative_sigma=0.01))
    with pytest.raises(SystemExit):
        main(["check", str(folder), "--json"])
    odd = json.loads(capsys.readouterr().out)["warnings"]
    assert [re.split(r":| by ", line)[:2] for line in odd] == [
        ["strength/S02", " the stress falls"],
        ["strength/S03", " rows scatter"],
    ]


# curves


@pytest.mark.parametrize(
    ("kind", "truth"),
    [(KINDS[0], OMNIDIRECTIONAL), (KINDS[1], UNIDIRECTIONAL), (KINDS[2], TENSION)],
)
def test_the_papers_curves_come_back_within_their_errors(kind, truth):
    """Forty sets of rows with 5 % noise: what is missed, over its standard deviation, is standard normal."""
    pulls = []
    for seed in range(40):
        fit = fit_strength(kind, [make_test(kind, seed)], 0.0)
        away = np.array([fit.values[name] - value for name, value in truth.items()])
        pulls.append(np.linalg.solve(np.linalg.cholesky(fit.covariance), away))
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.25)
    assert np.abs(np.mean(pulls, axis=0)).max() < 0.6  # 4 standard deviations of forty


def test_several_tests_share_a_curve_and_their_samples_differ():
    tests = [make_test("tension", seed) for seed in range(6)]
    alone, together = fit_strength("tension", tests[:1], 0.05), fit_strength("tension", tests, 0.05)
    assert together.sigma["tensile_log10_a"] == pytest.approx(
        alone.sigma["tensile_log10_a"] / math.sqrt(6), rel=0.1
    )


def test_too_few_rows_are_refused():
    with pytest.raises(InferenceError, match="4 rows do not tell 4 parameters"):
        fit_strength(KINDS[0], [make_test(KINDS[0], 1, rows=4)], 0.02)


def test_softness_with_the_stated_curve():
    found = [fit_softness([make_test(KINDS[0], seed)], Material(), 0.0) for seed in range(40)]
    pulls = [math.log(p_m / 13e3) / sigma for p_m, sigma, _ in found]
    assert np.mean(pulls) == pytest.approx(0.0, abs=0.6)
    assert np.std(pulls) == pytest.approx(1.0, abs=0.35)
    assert min(p for _, _, p in found) > 1e-3


def test_the_command_writes_what_it_found(folder, tmp_path, capsys):
    for seed, kind in enumerate(KINDS, start=1):
        write_test(folder, make_test(kind, seed))
    (tmp_path / "calibration.json").write_text('{"p_m_Pa": {"mean": 1300.0, "sd": 60.0}}')
    with pytest.raises(SystemExit) as left:
        main(
            [
                "strength",
                str(folder),
                "-o",
                str(tmp_path / "out"),
                "--calibration",
                str(tmp_path / "calibration.json"),
            ]
        )
    assert not left.value.code
    summary = json.loads((tmp_path / "out" / "strength.json").read_text())
    assert set(summary["fits"]) == set(KINDS)
    ratio = summary["static_over_dynamic"]
    assert ratio["q05"] < 10.0 < ratio["q95"]
    assert "static over dynamic p_m: " in capsys.readouterr().out
    assert (tmp_path / "out" / "strength.png").stat().st_size > 10_000


# beside the drops


def see(problem, values, steps):
    (tests,) = (each for each in problem.observations if isinstance(each, StaticTests))
    return linearise_alone(problem, tests, values, steps)


def test_tangents_are_those_of_the_formulas(folder, tmp_path):
    for seed, kind in enumerate(("compression_omnidirectional", "tension", "shear"), start=1):
        write_test(folder, make_test(kind, seed, rows=9))
    problem, _ = prepare(read_campaign(folder), LawStore(tmp_path / "store"), workers=1)
    steps = {
        "static_strength": 1e-4,
        "strength_slope": 1e-4,
        "shear_strength": 1e-4,
        "tensile_strength": 1e-4,
    }
    block = see(problem, {}, {**steps, "sample_drift": 0.1, "filling_factor": 1e-3})
    phi = np.linspace(0.14, 0.52, 9)
    of = [slice(0, 9), slice(9, 18), slice(18, 27)]
    for part, share in zip(of, (1.0, 0.0, 0.5), strict=True):
        assert block.tangents["ln_p_m"][part] == pytest.approx(np.full(9, share), abs=1e-6)
        assert block.tangents["static_strength"][part] == pytest.approx(np.full(9, share), abs=1e-3)
    slope = math.log(10.0) * np.log((phi - 0.12) / (0.58 - phi))
    assert block.tangents["strength_slope"][of[0]] == pytest.approx(slope, rel=1e-3, abs=1e-3)
    for name, shares in (("shear_strength", (0.0, 0.0, 1.0)), ("tensile_strength", (0.0, 1.0, 0.5))):
        for part, share in zip(of, shares, strict=True):
            assert block.tangents[name][part] == pytest.approx(np.full(9, share), abs=1e-3)
    for name in (
        "sample_drift",
        "filling_factor",
    ):  # a test has a sample of its own, and states how dense it is
        assert np.all(block.tangents[name] == 0.0)


def test_expected_stresses_are_those_of_the_paper(folder, tmp_path):
    write_test(folder, make_test("shear", 1, p_m=1000.0, sigma=1e-4))
    problem, _ = prepare(read_campaign(folder), LawStore(tmp_path / "store"), workers=1)
    (tests,) = (each for each in problem.observations if isinstance(each, StaticTests))
    phi = np.array([phi for phi, _ in tests.tests[0].points])
    residual = see(problem, {}, {}).residual  # at ln p_m = 0
    assert residual == pytest.approx(
        np.log(stress("shear", phi, 1000.0) / stress("shear", phi, 1.0)), abs=1e-3
    )


@pytest.mark.parametrize("factor", [0.4, 1.0, 10.0])
def test_static_over_dynamic_strength_is_found_and_p_m_stays(folder, tmp_path, factor):
    write_test(folder, make_test("compression_omnidirectional", 1, p_m=1300.0 * factor))
    campaign, store = read_campaign(folder), LawStore(tmp_path / "store")
    found = judge_scatters(campaign, lambda budget: prepare(campaign, store, budget=budget, workers=1))
    best, probability = found.verdict.probabilities[0]
    assert best == (("none",) if factor == 1.0 else ("static_strength",))
    # a static strength below the dynamic one is what a strength that grows with the rate leaves, too
    assert probability > (0.75 if factor < 1.0 else 0.9)
    assert math.exp(found.best.log_p_m) == pytest.approx(1300.0, rel=0.05)
    if factor != 1.0:
        sigma = math.sqrt(found.best.covariance[1, 1])
        assert 1.0 + found.best.values["static_strength"] == pytest.approx(factor, abs=3 * sigma)


def test_calibration_keeps_both_strengths_apart(folder, tmp_path):
    """Who adds a test that is ten times stronger than the drops still gets their p_m."""
    write_test(folder, make_test("compression_omnidirectional", 1))
    found = calibrate(read_campaign(folder), store=LawStore(tmp_path / "store"))
    assert np.median(found.posterior.samples("p_m_Pa")) == pytest.approx(1300.0, rel=0.05)
    low, high = np.quantile(found.posterior.samples("static_strength.factor"), [0.01, 0.99])
    assert low < 10.0 < high
    assert found.p_value > 0.01


def test_one_direction_alone_is_not_compared(folder, tmp_path):
    """Dust that gives way to its sides has no curve of the law."""
    write_test(folder, make_test("compression_unidirectional", 1))
    problem, _ = prepare(read_campaign(folder), LawStore(tmp_path / "store"), workers=1)
    assert not any(isinstance(each, StaticTests) for each in problem.observations)
    assert "static_strength" in problem.reasons
