"""What is said of the law that an unknown cause would have to be."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.judge import Verdict
from labsim.diagnosis.misfit import Part
from labsim.diagnosis.unlisted.free_law import RecoveredLaw
from labsim.diagnosis.unlisted.hats import FreeLaw
from labsim.diagnosis.unlisted.unknown import WOBBLE, UnknownFit
from labsim.diagnosis.unlisted.wobble import Wobble
from labsim.effects.law_places import LAW_PLACES
from labsim.report.campaign_tables import say_verdict
from labsim.report.pages.law_words import describe_unknown, say_law, say_missing, size_of_missing

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
        unknown=UnknownFit(0.0, "strength and forces", 0.4, np.zeros(1), evidences, laws=laws),
        nominal=SimpleNamespace(evidence=0.0),
        misfit=[Part("drops", "drops", 300.0, 100, 1e-9)],
        learned=None,
    )


def test_the_law_that_explains_most_by_itself_comes_first(found):
    assert say_missing(found) == (
        "acts like a force on the tip of 205 ± 30 Pa of its cross-section upwards at a depth of 1 tip radius "
        "(with parts of a force of speed)"
    )
    assert size_of_missing(found) == ("+205 ± 30 Pa", "on the tip at a depth of 1 tip radius")


def test_a_camera_s_wobble_is_said_with_its_size_and_frequency(found):
    swings = Wobble(np.array([30.0]), 410.2, 0.62, 0.03, 7.0, 0.05, np.zeros(1), 0.4)
    found.unknown = UnknownFit(30.0, WOBBLE, 0.0, np.zeros(1), {WOBBLE: 30.0}, wobble=swings)
    assert say_missing(found) == (
        "looks like a camera that wobbles by 0.62 ± 0.03 px at 410 Hz, in flight and in the dust alike"
    )
    assert size_of_missing(found) == ("0.62 ± 0.03 px", "of the camera, at 410 Hz")
    told = describe_unknown(found)["wobble"]
    assert told["frequency_Hz"] == 410.2 and told["p_m_Pa"]["mean"] == pytest.approx(np.exp(7.0))
    # one that does not explain all, or is not clear, is no wobble
    for evidence, p_value in ((30.0, 1e-4), (9.0, 0.4)):
        doubted = replace(swings, evidences=np.array([evidence]), p_value=p_value)
        assert replace(found.unknown, wobble=doubted).find_wobble(found.nominal) is None


LAYER = FreeLaw(LAW_PLACES["strength of depth"], (0.0, 0.3, 1.0), (0.0, 0.3, 1.0), (0.0, 1.0))
RIM = FreeLaw(LAW_PLACES["force on the rim"], (0.0, 1.0), (0.0, 1.0), (0.0, 1.0))


@pytest.mark.parametrize(
    "law, said",
    [
        (a_law(LAYER, [0.0, 0.4, 0.1], 0.05), "40 ± 5 % more compressive strength at a depth of 0.3 mm"),
        (
            a_law(RIM, [0.041, 0.03], 0.002),
            "a force on the tip of 0.041 ± 0.002 N/m of its circumference upwards at a depth of 0 mm",
        ),
    ],
)
def test_laws_in_mm_are_said_in_mm(law, said):
    assert say_law(law) == said


def test_where_the_drops_are_met_nothing_is_said_of_a_law_in_them(found):
    drops, maps = Part("drops", "drops", 90.0, 100, 0.7), Part("maps", "map", 900.0, 300, 0.0)
    found.misfit = [drops, maps]
    assert say_missing(found) == "shows in maps alone: p_m explains the drops"
    found.misfit = [drops]  # nothing is missed by much: what competes says what it looks like
    assert say_missing(found).startswith("acts like")


def test_what_is_not_clear_is_not_named_beside_it(found):
    depth = found.unknown.laws[1]
    found.unknown = replace(found.unknown, laws=(a_law(SPEED, [5.0, 3.0], 5.0), depth))
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
    found.predicted, found.unknown = predicted, replace(found.unknown, evidence=1526.0)
    found.best = SimpleNamespace(hypothesis=("strength_rate",), evidence=evidence)
    assert say_verdict(found).startswith(
        "The simulation is wrong in a way that no listed cause explains (probability 0.80): " + said
    )
