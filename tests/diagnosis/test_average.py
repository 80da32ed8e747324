"""p_m over causes: a mixture whose share, middle and spread are known, cut at the stated range."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.average import average_p_m
from labsim.diagnosis.campaign import allow_for_codes
from labsim.diagnosis.judge import Verdict
from labsim.diagnosis.screen import Screening, draw_strengths
from labsim.inference.fits.fitting import Fit
from labsim.inference.observations.linearised_drop import ErrorBudget

RANGE = (300.0, 6000.0)


def a_fit(hypothesis, p_m, sigma, over_shapes=(0.0, 0.0)):
    return Fit(
        hypothesis,
        math.log(p_m),
        {},
        np.array([[sigma**2]]),
        chi_square=0.0,
        points=0,
        log_likelihood=0.0,
        evidence=0.0,
        blocks=(),
        nuisances=(),
        over_shapes=over_shapes,
    )


def test_causes_count_by_their_probability_and_what_has_no_p_m_not_at_all():
    nominal, scale, filling = (
        a_fit((), 900.0, 0.02),
        a_fit(("ct_scale",), 1428.0, 0.02),
        a_fit(("filling_factor",), 1174.0, 0.03),
    )
    verdict = Verdict(
        "effect",
        [
            (("ct_scale",), 0.45),
            (("filling_factor",), 0.3),
            (("unknown",), 0.2),
            (("pore_gas",), 0.05),
            (("none",), 0.0),
        ],
    )
    draws = average_p_m(verdict, nominal, [scale, filling], RANGE)
    softer = draws < 1300.0
    assert np.mean(softer) == pytest.approx(0.3 / 0.75, abs=0.01)
    assert np.median(draws[softer]) == pytest.approx(1174.0, rel=2e-3)
    assert np.std(np.log(draws[~softer])) == pytest.approx(0.02, rel=0.03)
    low, high = np.quantile(draws, [0.05, 0.95])
    assert low < 1195.0 < high  # what the first cause alone would exclude


def test_one_certain_cause_has_its_own_p_m_with_its_shapes():
    fit = a_fit(("strength_rate",), 1058.0, 0.043, over_shapes=(0.014, 0.025))
    draws = average_p_m(Verdict("effect", [(("strength_rate",), 1.0)]), a_fit((), 1634.0, 0.02), [fit], RANGE)
    assert np.mean(np.log(draws)) == pytest.approx(math.log(1058.0) + 0.014, abs=1e-3)
    assert np.std(np.log(draws)) == pytest.approx(math.hypot(0.043, 0.025), rel=0.02)


def test_no_draw_lies_outside_the_range_and_unknown_alone_leaves_the_nominal_model():
    draws = average_p_m(Verdict("unknown", [(("unknown",), 1.0)]), a_fit((), 294.0, 0.02), [], RANGE)
    assert draws.min() >= 300.0 and draws.max() < 330.0


def test_beside_a_cause_of_the_material_p_m_may_be_what_another_code_says():
    effects = {
        "tensile_strength": SimpleNamespace(kind="material"),
        "pixel_scale": SimpleNamespace(kind="measurement"),
    }
    problem = SimpleNamespace(effects=effects, budget=ErrorBudget())
    nominal = a_fit((), 900.0, 0.02)
    wide = allow_for_codes(problem, nominal, a_fit(("tensile_strength",), 1200.0, 0.05))
    assert wide.between_codes == pytest.approx(
        math.hypot(ErrorBudget().other_codes, 0.4 * math.log(1200 / 900))
    )
    draws = average_p_m(Verdict("effect", [(("tensile_strength",), 1.0)]), nominal, [wide], RANGE)
    assert np.std(np.log(draws)) == pytest.approx(math.hypot(0.05, wide.between_codes), rel=0.02)
    assert np.mean(np.log(draws)) == pytest.approx(math.log(1200.0), abs=2e-3)
    scale = a_fit(("pixel_scale",), 1200.0, 0.05)
    assert (
        allow_for_codes(problem, nominal, scale) is scale
        and allow_for_codes(problem, nominal, nominal) is nominal
    )


def screened(limits, trace=0.1):
    """One cause that p_m makes up for: a unit of it takes 0.5 of ln p_m and leaves ``trace`` standard deviations of the data."""
    parameter = SimpleNamespace(null=0.0, scale=0.4, limits=limits)
    problem = SimpleNamespace(
        effects={"strength_slope": SimpleNamespace(amplitudes=(parameter,))},
        campaign=SimpleNamespace(p_m_range=RANGE),
    )
    fingerprints = np.array([[trace], [0.0]])
    return problem, Screening(
        scores=[],
        names=["strength_slope"],
        cosines=np.eye(1),
        p_value=1.0,
        residual=np.zeros(2),
        fingerprints=fingerprints,
        log_p_m=math.log(1000.0),
        step=0.0,
        sigma=0.02,
        traded=np.array([0.5]),
    )


@pytest.mark.parametrize("trace", [0.1, 20.0])
def test_what_was_only_screened_has_the_p_m_of_its_tangents(trace):
    draws = draw_strengths(*screened((-9.0, 9.0), trace), "strength_slope", 100_000, np.random.default_rng(1))
    amplitude = 0.4 / math.hypot(1.0, 0.4 * trace)  # of the prior, and of the data
    assert np.mean(draws) == pytest.approx(math.log(1000.0), abs=2e-3)
    assert np.std(draws) == pytest.approx(math.hypot(0.02, 0.5 * amplitude), rel=0.01)


def test_limits_of_a_screened_cause_cut_its_p_m():
    draws = draw_strengths(*screened((0.0, 9.0)), "strength_slope", 100_000, np.random.default_rng(1))
    # the mean of half a Gaussian
    assert np.mean(draws) - math.log(1000.0) == pytest.approx(-0.2 * math.sqrt(2 / math.pi), rel=0.01)
    beyond = draw_strengths(*screened((8.0, 9.0)), "strength_slope", 1000, np.random.default_rng(1))
    assert beyond.size == 1000 and np.all(beyond >= math.log(RANGE[0]) - 1e-12)


def test_a_cause_that_nobody_sees_counts_although_none_leads():
    def draw(count, rng):
        return np.full(count, math.log(2000.0))

    verdict = Verdict("none", [(("none",), 0.8), (("strength_slope",), 0.2)])
    draws = average_p_m(
        verdict, a_fit((), 900.0, 0.02), [], RANGE, screened={("strength_slope",): draw, ("pore_gas",): draw}
    )
    assert np.mean(draws > 1500.0) == pytest.approx(0.2, abs=0.01)
    # what a fit says goes before
    fit = a_fit(("strength_slope",), 1200.0, 0.02)
    draws = average_p_m(verdict, a_fit((), 900.0, 0.02), [fit], RANGE, screened={("strength_slope",): draw})
    assert draws.max() < 1500.0
