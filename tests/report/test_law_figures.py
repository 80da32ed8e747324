"""The learned formula stands over the band of the free law, in the places that it has a term for."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.unlisted.free_law import RecoveredLaw
from labsim.diagnosis.unlisted.hats import FreeLaw
from labsim.effects.law_places import LAW_PLACES
from labsim.effects.terms import list_terms
from labsim.report.figures.laws import draw_laws, plot_law, trace_law

SPEED = FreeLaw(LAW_PLACES["force of speed"], (0.0, 0.3, 1.2), (0.3, 1.2), (0.0, 1.0))
DUST = (0.18, 0.21, 0.25)
STRENGTH = FreeLaw(LAW_PLACES["strength of filling factor"], DUST, DUST, (DUST[0], DUST[-1]))
LAWS = tuple(RecoveredLaw(law, np.zeros(len(law.knots)), np.eye(len(law.knots))) for law in (SPEED, STRENGTH))


def a_formula(**coefficients: float) -> SimpleNamespace:
    terms = tuple(list_terms()[name] for name in coefficients)
    return SimpleNamespace(terms=terms, coefficients=np.array(list(coefficients.values())))


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
    *_, drawn = plot_law(law, formula)["data"]
    assert drawn["name"] == "formula"
    np.testing.assert_allclose(drawn["y"], expected(place), atol=1e-9)


def test_a_place_without_a_term_has_no_curve():
    for formula in (None, a_formula(hardening=0.5)):
        assert [each.get("name") for each in plot_law(LAWS[0], formula)["data"]] == [None, "force of speed"]


def test_the_picture_differs_by_the_formula(tmp_path):
    without = draw_laws(LAWS, tmp_path / "without.png").read_bytes()
    assert draw_laws(LAWS, tmp_path / "with.png", a_formula(inertial_drag=300.0)).read_bytes() != without
