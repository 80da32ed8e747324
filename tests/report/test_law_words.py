"""What is said of the law that an unknown cause would have to be."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.judge import Verdict
from labsim.diagnosis.misfit import Part
from labsim.diagnosis.unlisted.free_law import RecoveredLaw
from labsim.diagnosis.unlisted.hats import FreeLaw
from labsim.effects.law_places import LAW_PLACES
from labsim.report.campaign_tables import say_verdict
from labsim.report.pages.law_words import say_missing, size_of_missing

DEPTH = FreeLaw(LAW_PLACES["force of depth"], (0.0, 1.0, 2.0), (0.0, 1.0, 2.0), (0.0, 2.0))
SPEED = FreeLaw(LAW_PLACES["force of speed"], (0.0, 0.3, 1.2), (0.3, 1.2), (0.0, 1.0))


def a_law(law: FreeLaw, mean: list[float], sigma: float) -> RecoveredLaw:
    return RecoveredLaw(law, np.array(mean), sigma**2 * np.eye(len(mean)))


@pytest.fixture
def found():
    """A force of depth explains most by itself; that of speed is the sharper one, and small."""
    laws = (a_law(SPEED, [40.0, 10.0], 5.0), a_law(DEPTH, [-20.0, 205.0, 90.0], 30.0))
    evidences = {"force of speed": 276.0, "force of depth": 1448.0, "strength and forces": 1526.0}
    return SimpleNamespace(
        unknown=SimpleNamespace(block="strength and forces", laws=laws, evidences=evidences, size=0.4),
        misfit=[Part("drops", "drops", 300.0, 100, 1e-9)],
        learned=None,
    )


def test_the_law_that_explains_most_by_itself_comes_first(found):
    assert say_missing(found) == (
        "acts like a force on the tip of 205 ± 30 Pa of its cross-section upwards at a depth of 1 tip radius "
        "(with parts of a force of speed)"
    )
    assert size_of_missing(found) == ("+205 ± 30 Pa", "on the tip at a depth of 1 tip radius")


def test_where_the_drops_are_met_nothing_is_said_of_a_law_in_them(found):
    drops, maps = Part("drops", "drops", 90.0, 100, 0.7), Part("maps", "map", 900.0, 300, 0.0)
    found.misfit = [drops, maps]
    assert say_missing(found) == "shows in maps alone: p_m explains the drops"
    found.misfit = [drops]  # nothing is missed by much: what competes says what it looks like
    assert say_missing(found).startswith("acts like")


def test_what_is_not_clear_is_not_named_beside_it(found):
    depth = found.unknown.laws[1]
    found.unknown.laws = (a_law(SPEED, [5.0, 3.0], 5.0), depth)
    assert say_missing(found).endswith("at a depth of 1 tip radius")


@pytest.mark.parametrize(
    ("predicted", "evidence", "said"),
    [
        (
            0.004,
            1600.0,
            "strength rate comes nearest, but does not predict drops that no fit has seen (p = 0.004).",
        ),
        (
            0.004,
            1500.0,
            "what is missing acts like a force on the tip of 205",
        ),  # the law explains more than any listed cause
        (0.3, 1600.0, "what is missing acts like a force on the tip of 205"),
    ],
)
def test_a_listed_cause_that_comes_nearest_is_said_to(found, predicted, evidence, said):
    found.verdict = Verdict("unknown", [(("unknown",), 0.8), (("strength_rate",), 0.2)])
    found.posterior_nominal = SimpleNamespace(samples=lambda name: np.array([1300.0]))
    found.predicted, found.unknown.evidence = predicted, 1526.0
    found.best = SimpleNamespace(hypothesis=("strength_rate",), evidence=evidence)
    assert say_verdict(found).startswith(
        "The simulation is wrong in a way that no listed cause explains (probability 0.80): " + said
    )
