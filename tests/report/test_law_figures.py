"""The learned formula stands over the band of the free law, in the places that it has a term for."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.unlisted.free_law import RecoveredLaw
from labsim.diagnosis.unlisted.hats import FreeLaw
from labsim.diagnosis.unlisted.learned_law import Formula
from labsim.effects.law_places import LAW_PLACES
from labsim.effects.terms import list_terms
from labsim.report.figures.laws import draw_laws, plot_law, trace_law

SPEED = FreeLaw(LAW_PLACES["force of speed"], (0.0, 0.3, 1.2), (0.3, 1.2), (0.0, 1.0))
DUST = (0.18, 0.21, 0.25)
STRENGTH = FreeLaw(LAW_PLACES["strength of filling factor"], DUST, DUST, (DUST[0], DUST[-1]))
LAWS = tuple(RecoveredLaw(law, np.zeros(len(law.knots)), np.eye(len(law.knots))) for law in (SPEED, STRENGTH))


def a_formula(**coefficients: float) -> Formula:
    """Each coefficient to a tenth; the first two go together by a half."""
    terms = tuple(list_terms()[name] for name in coefficients if name in list_terms())
    sigma = np.array([0.0, *(0.1 * abs(c) for c in coefficients.values())])
    correlation = np.eye(len(sigma))
    correlation[1, 2:3] = correlation[2:3, 1] = 0.5
    fit = SimpleNamespace(
        hypothesis=tuple(coefficients), values=coefficients, covariance=np.outer(sigma, sigma) * correlation
    )
    return Formula(terms, fit, None, None)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (LAWS[0], lambda v: 300.0 * v**2 + 50.0 * v),
        (LAWS[1], lambda phi: 100 * 0.5 * 10 * (phi - 0.18)),  # in %, from the dust as it was prepared
    ],
)
def test_terms_of_a_place_add_up_and_others_stay_away(law, expected):
    formula = a_formula(inertial_drag=300.0, hardening=0.5, viscous_drag=50.0)
    place = trace_law(law)[0]
    *_, band, drawn = plot_law(law, formula)["data"]
    assert drawn["name"] == "formula"
    np.testing.assert_allclose(drawn["y"], expected(place), atol=1e-9)
    above = band["y"][: len(place)]
    np.testing.assert_allclose(above, drawn["y"] + drawn["customdata"], atol=1e-9)
    np.testing.assert_allclose(band["y"][::-1][: len(place)], 2 * drawn["y"] - above, atol=1e-9)


def test_the_band_of_a_formula_counts_how_its_coefficients_go_together():
    place = np.array([0.5, 1.0])
    _, sigma = a_formula(inertial_drag=300.0, viscous_drag=50.0).trace(SPEED, place)
    one, other = 30.0 * place**2, 5.0 * place
    np.testing.assert_allclose(sigma, np.sqrt(one**2 + other**2 + one * other))
    # of one term it is the term's share
    _, sigma = a_formula(hardening=-0.5).trace(STRENGTH, np.array([0.18, 0.2]))
    np.testing.assert_allclose(sigma, [0.0, 0.01], atol=1e-12)
    assert a_formula(hardening=-0.5).trace(SPEED, place) is None


def test_the_band_beside_a_listed_cause_is_the_term_s_own():
    """A cause stands before the terms of a fit, and has a coefficient and an error too."""
    both = a_formula(surface_crust=0.04, viscous_drag=50.0)
    place = np.array([0.5, 1.0])
    value, sigma = both.trace(SPEED, place)
    np.testing.assert_allclose(value, 50.0 * place)
    np.testing.assert_allclose(sigma, 5.0 * place)
    np.testing.assert_allclose(both.sigma, [5.0])


def test_a_place_without_a_term_has_no_curve():
    for formula in (None, a_formula(hardening=0.5)):
        assert [each.get("name") for each in plot_law(LAWS[0], formula)["data"]] == [None, "force of speed"]


def test_the_picture_differs_by_the_formula(tmp_path):
    without = draw_laws(LAWS, tmp_path / "without.png").read_bytes()
    assert draw_laws(LAWS, tmp_path / "with.png", a_formula(inertial_drag=300.0)).read_bytes() != without
