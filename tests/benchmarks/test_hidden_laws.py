"""Every unlisted cause that a plan can draw has a place and formulas that exist; what was learned is set beside them."""

import numpy as np
import pytest

from benchmarks.accuracy.count_laws import describe, find_places
from benchmarks.accuracy.fresh import KINDS
from benchmarks.accuracy.hidden_laws import find_law, find_place
from benchmarks.campaigns.labelled import SMALL, name_hidden
from benchmarks.lagrangian_mesh.film_campaigns import LARGE
from labsim.effects.terms import list_terms

DRAG = {"body": {"inertial": 4e-4}}


def hide(keys):
    return name_hidden({"cause": "unknown", "pm": 1300.0, "seed": 1, **keys})


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_place_and_its_formulas_exist(kind):
    law = find_law(hide(KINDS[kind](np.random.default_rng(1))))
    assert law is not None and law.places and set(law.terms) <= set(list_terms())
    assert all(find_place(name) in law.places for name, size in law.terms.items() if size is not None)


@pytest.mark.parametrize("name", ["size_power", "size_curvature"])
def test_a_strength_by_size_is_what_the_films_hide(name):
    """The samples of the smaller tip have 0.8 of p_m."""
    term, size = list_terms()[name], find_law(hide({"small_strength": 0.8})).terms[name]
    small, large = term.shape(1e3 * np.array([SMALL, LARGE]))
    assert np.exp(size * (small - large)) == pytest.approx(0.8)


def test_a_listed_cause_is_no_law():
    assert find_law(hide({"dust": {"shear_factor": 0.5}})) is None


@pytest.mark.parametrize(
    ("first", "terms", "place", "form", "size"),
    [
        ("unknown", [{"inertial_drag": ["force of speed", 500.0, 30.0]}], True, True, True),
        ("unknown", [{"inertial_drag": ["force of speed", 400.0, 30.0]}], True, True, False),
        (
            "unknown",
            [{"cubic_drag": ["force of speed", 700.0, 30.0]}, {"inertial_drag": ["force of speed", 500.0, 30.0]}],
            True, True, None,
        ),
        ("unknown", [{"stuck_mass": ["mass of depth", 0.3, 0.1]}], False, False, None),
        ("shear_strength", [], False, False, None),
    ],
)  # fmt: skip
def test_a_law_is_set_beside_the_truth(first, terms, place, form, size):
    law = find_law(hide(DRAG))
    assert law.own == ("inertial_drag", pytest.approx(509.3, abs=0.1))
    row = {
        "first": first,
        "law": [{"terms": each} for each in terms],
        "evidence": {"block": "depth and speed"},
    }
    said = describe(row, law)
    assert (said["place"], said["form"], said["size"]) == (place, form, size)


def test_without_a_formula_the_free_law_says_where():
    row = {"first": "unknown", "law": [], "evidence": {"block": "force of depth"}}
    assert find_places(row) == {"force of depth"}
    assert find_places({**row, "evidence": {"block": "rows that are read one after another"}}) == {"camera"}
    assert find_places({**row, "first": "none"}) == set()
