"""Filmed drops beside static tests, made on the Lagrangian mesh: a weak tension is told from a weak shear, and is drawn."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import fit_hypothesis, fit_p_value
from labsim.inference.scatter import set_error_budget
from labsim.report.figures.campaign import choose_decisive
from labsim.report.figures.strengths import draw_tests, find_tests
from labsim.report.pages.drop_views import view_drops
from labsim.runs.store import RunStore

CAMPAIGN = read_campaign(Path(__file__).parents[2] / "data" / "campaigns" / "g41")
FACTOR, P_M = 0.5831, 1720.0


@pytest.fixture(scope="module")
def fitted(shared_store):
    campaign = replace(CAMPAIGN, drops=CAMPAIGN.drops[:2])
    problem, nominal = prepare(campaign, RunStore(shared_store), budget=set_error_budget(campaign), workers=1)
    start = (nominal.log_p_m, {})
    return (
        problem,
        nominal,
        *(
            fit_hypothesis(problem, (name,), start, nuisances=nominal)
            for name in ("tensile_strength", "shear_strength")
        ),
    )


def test_a_tension_test_tells_tension_from_shear(fitted):
    _, nominal, tension, shear = fitted
    assert fit_p_value(nominal) < 1e-6 < 0.05 < fit_p_value(tension)
    assert tension.evidence > shear.evidence + 20.0
    sigma = math.sqrt(tension.covariance[1, 1])
    assert abs(tension.values["tensile_strength"] - (FACTOR - 1.0)) < 2 * sigma < 0.1
    assert abs(tension.log_p_m - math.log(P_M)) < 2 * math.hypot(math.sqrt(tension.covariance[0, 0]), 0.06)


def test_the_tests_are_drawn_and_decide(fitted, tmp_path):
    problem, nominal, tension, _ = fitted
    fits = [("nominal", nominal), ("tensile_strength", tension)]
    tests, blocks = find_tests(problem, fits)
    before, after = (block.residual for block in blocks)
    assert len(tests.tests) == 2 and before.size == 31
    assert (
        abs(before[-6:].mean()) > 0.3 > 0.1 > abs(after[-6:].mean())
    )  # ln of stress, of the rows of the tension test
    assert draw_tests(problem, fits, tmp_path / "tests.png").stat().st_size > 10_000
    shown, caption = choose_decisive(
        problem, view_drops(problem, fits), tmp_path, ("tensile_strength",), fits
    )
    assert shown == "tests" and "Static tests" in caption
