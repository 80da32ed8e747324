"""Every verdict says what to do: the effect's own words with the value found, or its kind's."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.next_experiment import Suggestion
from labsim.effects import list_effects
from labsim.report.pages.remedies import BY_KIND, say_remedy

EFFECTS = list_effects()


def find(word, probabilities, value=1.06, learned=None, named=None, tests=(), wobble=None):
    posterior = SimpleNamespace(samples=lambda name: np.full(5, value))
    return SimpleNamespace(
        verdict=SimpleNamespace(word=word, probabilities=probabilities, named=named or probabilities[:1]),
        problem=SimpleNamespace(effects=EFFECTS),
        nominal=None,
        unknown=SimpleNamespace(find_wobble=lambda nominal: wobble),
        campaign=SimpleNamespace(strength_tests=tests),
        posterior_extended=posterior,
        learned=learned,
    )


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_has_one(name):
    said = say_remedy(find("effect", [((name,), 0.99)]), [])
    assert said.endswith(".") and said[0].isupper() and "{" not in said
    assert EFFECTS[name].remedy or BY_KIND[EFFECTS[name].kind].split(":")[0].lower() in said.lower()


def test_a_static_test_is_asked_for_only_where_there_is_none():
    causes = [(("tensile_strength",), 0.99)]
    assert "static strength test" in say_remedy(find("effect", causes), [])
    assert "static strength test" not in say_remedy(find("effect", causes, tests=("a test",)), [])


def test_a_scale_says_what_to_write():
    said = say_remedy(find("effect", [(("pixel_scale",), 0.99)]), [])
    assert "pixel_size_um that is 1.060 times" in said


def test_two_that_are_hardly_told_apart_are_to_be_told_apart_first():
    named = [(("shear_strength",), 0.6), (("tensile_strength",), 0.35)]
    suggestion = Suggestion("a bead of 2 mm at 0.3 m/s", 1.0)
    said = say_remedy(find("effect", named, named=named), [suggestion])
    assert said.startswith("First tell shear strength from tensile strength: a bead of 2 mm at 0.3 m/s.")
    pushes = Suggestion("4 more pushes", 1.0, (("strength_rate",), ("none",)))
    assert pushes.text == "4 more pushes, to tell strength_rate from none"
    said = say_remedy(find("effect", named, named=named), [pushes])
    assert said.startswith("First tell strength rate from the nominal model: 4 more pushes.")
    beside = Suggestion("6 more pushes", 1.0, (("strength_rate",), ("strength_rate", "gauge_warming")))
    said = say_remedy(find("effect", named, named=named), [beside])
    assert said.startswith("To tell whether gauge warming is at work too: 6 more pushes.")


def test_none_and_unknown_have_one_too():
    assert say_remedy(find("none", [(("none",), 0.9)]), []) == "Nothing needs to be mended."
    assert "experiment" in say_remedy(find("unknown", [(("unknown",), 0.9)]), [])
    assert "model.toml" in say_remedy(find("unknown", [(("unknown",), 0.9)], learned=object()), [])
    assert "camera" in say_remedy(find("unknown", [(("unknown",), 0.9)], wobble=object()), [])
