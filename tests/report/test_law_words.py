"""What is said of the law that an unknown cause would have to be."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.gain import Gain
from labsim.diagnosis.judge import Verdict
from labsim.diagnosis.misfit import Part
from labsim.diagnosis.unlisted.free_law import RecoveredLaw
from labsim.diagnosis.unlisted.hats import FreeLaw
from labsim.diagnosis.unlisted.learned_law import Formula, LearnedLaw
from labsim.diagnosis.unlisted.unknown import WOBBLE, UnknownFit
from labsim.diagnosis.unlisted.wobble import Wobble
from labsim.effects import list_effects
from labsim.effects.law_places import LAW_PLACES
from labsim.effects.terms import list_terms
from labsim.report.campaign_tables import extended_model, say_verdict
from labsim.report.pages.law_words import (
    describe_learned,
    describe_unknown,
    say_equation,
    say_law,
    say_learned,
    say_missing,
    size_of_missing,
)

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
        "acts like a force upwards of 205 ± 30 Pa at a depth of 1 tip radius (with parts of a force of speed)"
    )
    assert size_of_missing(found) == ("+205 ± 30 Pa", "force upwards at a depth of 1 tip radius")


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
        (a_law(LAYER, [0.0, 0.4, 0.1], 0.05), "40 ± 5 % more strength at a depth of 0.3 mm"),
        (a_law(LAYER, [0.0, -0.4, 0.1], 0.05), "40 ± 5 % less strength at a depth of 0.3 mm"),
        (a_law(RIM, [0.041, 0.03], 0.002), "a force upwards of 0.041 ± 0.002 N/m at a depth of 0 mm"),
    ],
)
def test_laws_in_mm_are_said_in_mm(law, said):
    assert say_law(law) == said


@pytest.mark.parametrize(
    "place", [place for place in LAW_PLACES.values() if place.simulated], ids=lambda place: place.name
)
def test_every_place_of_a_free_law_has_words(place, found):
    free = FreeLaw(place, place.knots, place.knots, (place.knots[0], place.knots[-1]))
    law = a_law(free, [0.0] * (len(place.knots) - 1) + [0.5 * place.scale], 0.1 * place.scale)
    said = say_law(law)
    assert place.shown in said and said.endswith(
        f"of {place.knots[-1]:g}" + (f" {place.unit}" if place.unit != "1" else "")
    )
    found.unknown = UnknownFit(0.0, place.name, 0.4, np.zeros(1), {place.name: 5.0}, place.name, (law,))
    size, label = size_of_missing(found)
    assert size.startswith("+") and size.endswith(place.shown_unit) and label.startswith(place.shown)


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
    ("predicted", "beside", "evidence", "said"),
    [
        (
            0.004,
            -math.inf,
            1600.0,
            "strength rate comes nearest, but does not predict drops that no fit has seen (p = 0.004).",
        ),
        (
            0.004,
            4.9,
            1500.0,
            "what is missing acts like a force upwards of 205",
        ),  # the law explains more than any listed cause
        (0.3, -1.0, 1600.0, "what is missing acts like a force upwards of 205"),
        (
            0.3,
            4.9,
            1600.0,
            "strength rate comes nearest, but a law left free on top of it explains more (by 4.9 in ln evidence).",
        ),
    ],
)
def test_a_listed_cause_that_comes_nearest_is_said_to(found, predicted, beside, evidence, said):
    found.verdict = Verdict("unknown", [(("unknown",), 0.8), (("strength_rate",), 0.2)])
    found.posterior_nominal = SimpleNamespace(samples=lambda name: np.array([1300.0]))
    found.predicted, found.unknown = predicted, replace(found.unknown, evidence=1526.0, beside=beside)
    found.best = SimpleNamespace(hypothesis=("strength_rate",), evidence=evidence)
    assert say_verdict(found).startswith(
        "The simulation is wrong in a way that no listed cause explains (probability 0.80): " + said
    )


# ---------------------------------------------------------------- what was learned


def a_formula(evidence: float = 50.0, **coefficients: tuple[float, float]) -> Formula:
    """coefficients : of each term or listed cause, and standard deviation."""
    terms = tuple(list_terms()[name] for name in coefficients if name in list_terms())
    causes = tuple(list_effects()[name] for name in coefficients if name not in list_terms())
    fit = SimpleNamespace(
        hypothesis=tuple(coefficients),
        values={name: c for name, (c, _) in coefficients.items()},
        covariance=np.diag([0.05, *(sigma for _, sigma in coefficients.values())]) ** 2,
        log_p_m=np.log(1500.0),
        evidence=evidence,
    )
    return Formula(terms, fit, None, None, causes)


@pytest.mark.parametrize(
    ("coefficients", "said"),
    [
        ({"inertial_drag": (513.0, 49.0)}, "m z″ = m g − F_dust − A (513 ± 49) Pa s²/m² × v²"),
        ({"depth_spring": (-20.0, 3.0)}, "m z″ = m g − F_dust − A (−20.0 ± 3.0) Pa × z/a"),
        ({"constant_pressure": (150.0, 20.0)}, "m z″ = m g − F_dust − A (150 ± 20) Pa"),
        ({"film_at_0_2_mm": (200.0, 20.0)}, "m z″ = m g − F_dust − A (200 ± 20) Pa × exp(−½ ((z/0.2 mm − 1)/0.25)²)"),
        ({"pull_spring": (0.3, 0.02)}, "m z″ = m g − F_dust − (0.300 ± 0.020) mN × z/mm"),
        ({"rim_pull": (0.041, 0.002)}, "m z″ = m g − F_dust − 2π a (0.0410 ± 0.0020) N/m"),
        ({"hardening": (0.5, 0.1)}, "m z″ = m g − F_dust[Σ (1 + (0.50 ± 0.10) × 10 (φ − φ0))]"),
        ({"layer_at_1_mm": (0.5, 0.1)}, "m z″ = m g − F_dust[Σ (1 + (0.50 ± 0.10) × exp(−½ ((z/1 mm − 1)/0.25)²))]"),
        ({"strain_hardening": (0.5, 0.1)}, "m z″ = m g − F_dust[Σ (1 + (0.50 ± 0.10) × ε)]"),
        ({"shear_hardening": (0.5, 0.1)}, "m z″ = m g − F_dust[Y (1 + (0.50 ± 0.10) × ε)]"),
        ({"size_power": (0.5, 0.1)}, "m z″ = m g − F_dust[Σ exp((0.50 ± 0.10) × ln(a / 1 mm))]"),
        ({"stuck_mass": (0.385, 0.008)}, "m (1 + (0.3850 ± 0.0080) × z/a) (z″ − g) = − F_dust"),
        (
            {"gathered_mass": (0.4, 0.1)},
            "m (1 + k) (z″ − g) = − F_dust − m k′ v²/a, k = (0.40 ± 0.10) × z/a",
        ),
        (
            {"hardening": (0.5, 0.1), "inertial_drag": (500.0, 50.0), "shear_hardening": (0.5, 0.1)},
            "m z″ = m g − F_dust[Σ (1 + (0.50 ± 0.10) × 10 (φ − φ0)), Y (1 + (0.50 ± 0.10) × ε)] "
            "− A (500 ± 50) Pa s²/m² × v²",
        ),
        ({"shaft_drag": (820.0, 40.0)}, "m z″ = m g − F_dust − A v² (820 ± 40) Pa s²/m² × z/a"),
        ({"shaft_viscosity": (82.0, 4.0)}, "m z″ = m g − F_dust − A v (82.0 ± 4.0) Pa s/m × z/a"),
        ({"time_ramp": (82.0, 4.0)}, "m z″ = m g − F_dust − A (82.0 ± 4.0) Pa × t/ms"),
        ({"creep": (-0.2, 0.1)}, "m z″ = m g − F_dust[Σ (1 + (−0.20 ± 0.10) × ln(1 + t/ms))]"),
        ({"rolling_shutter": (5.0, 0.1)}, ""),
        (
            {"rolling_shutter": (5.0, 0.1), "viscous_drag": (264.0, 28.0)},
            "m z″ = m g − F_dust − A (264 ± 28) Pa s/m × v",
        ),
    ],
)  # fmt: skip
def test_the_equation_has_the_formula_where_it_acts(coefficients, said):
    assert say_equation(a_formula(**coefficients)) == said


def test_the_tile_has_the_formula_where_one_was_learned(found):
    found.learned = SimpleNamespace(best=a_formula(shaft_drag=(820.0, 40.0), surface_crust=(0.046, 0.002)))
    assert size_of_missing(found) == ("(820 ± 40) Pa s²/m² × z/a", "drag of depth, beside surface crust")
    found.learned = SimpleNamespace(best=a_formula(rolling_shutter=(5.0, 0.1), viscous_drag=(264.0, 28.0)))
    value, places = size_of_missing(found)
    assert (
        value == "(5.00 ± 0.10) µs × rows + (264 ± 28) Pa s/m × v"
        and places == "clock of row and force of speed"
    )


def test_every_place_of_the_drop_stands_in_the_equation():
    for place in LAW_PLACES.values():
        assert bool(place.enters) is (place.add is not None), place.name
        assert not place.enters or any("{}" in how for _, how in place.enters)


@pytest.fixture
def learned(found):
    """A drag, to be told from another that is 4.2 behind and from a film that is 30 behind."""
    formulas = (
        a_formula(50.0, inertial_drag=(513.0, 49.0)),
        a_formula(45.8, viscous_drag=(264.0, 28.0)),
        a_formula(20.0, film_at_1=(200.0, 40.0)),
    )
    gain = Gain(16.9e-6, 3.2e-6, 5.2e-6, 20.0, 3.0, 0.9)
    found.learned = LearnedLaw(formulas, None, gain, {"D01": (16e-6, 3e-6), "D02": (18e-6, 4e-6)})
    found.nominal = SimpleNamespace(evidence=10.0)
    found.unknown = replace(found.unknown, tangents=SimpleNamespace(laws=(SPEED, DEPTH)))
    found.problem = SimpleNamespace(
        groups=[SimpleNamespace(projectile=SimpleNamespace(tip_radius=r)) for r in (5e-4, 1e-3)]
    )
    return found


FORMULA = "a force against the motion, over the tip's cross-section, of (513 ± 49) Pa s²/m² × v²"
EQUATION = "m z″ = m g − F_dust − A (513 ± 49) Pa s²/m² × v²"
SECOND = "a force against the motion, over the tip's cross-section, of (264 ± 28) Pa s/m × v"


def test_what_was_learned_is_said_with_its_equation_and_the_next_best(learned):
    assert say_missing(learned) == f"is like {FORMULA}, so that {EQUATION}"
    assert say_learned(learned) == [
        f"a formula for what is missing: {FORMULA}",
        f"the equation of motion with it: {EQUATION}",
        "with it held-out drops are missed by 3.2 µm rms, by 16.9 µm without, by 5.2 µm were it the truth; "
        "p_m is 1.5 ± 0.075 kPa",
        f"next best is {SECOND} (4.2 behind in ln evidence)",
    ]


def test_a_formula_beside_a_listed_cause_says_both(learned):
    both = a_formula(50.0, surface_crust=(0.046, 0.002), inertial_drag=(513.0, 49.0))
    assert both.sigma == pytest.approx([49.0])
    learned.learned = replace(learned.learned, formulas=(both,))
    learned.problem.at = lambda name, amplitude: {"excess": amplitude}
    said = f"{FORMULA}, beside a listed cause: the top of the sample is denser than the bulk (excess 0.0460 ± 0.0020)"
    assert say_learned(learned)[0] == f"a formula for what is missing: {said}"
    told = describe_learned(learned)
    assert told["beside"] == [{"effect": "surface_crust", "excess": 0.046, "sd": pytest.approx(0.002)}]
    learned.verdict, learned.campaign = SimpleNamespace(word="unknown"), None
    model = extended_model(learned)
    assert model.law.terms == (("inertial_drag", 513.0),) and model.p_m == pytest.approx(1500.0)
    assert [(name, values["excess"]) for name, values in model.effects] == [("surface_crust", 0.046)]


def test_what_is_hardly_told_from_it_is_said_with_how_far_behind_it_is(learned):
    best, second, third = learned.learned.formulas
    near = replace(second, fit=SimpleNamespace(**{**vars(second.fit), "evidence": 48.5}))
    learned.learned = replace(learned.learned, formulas=(best, near, third))
    assert say_learned(learned)[-1] == f"hardly told from it here: {SECOND} (1.5 behind in ln evidence)"
    learned.learned = replace(learned.learned, formulas=(best,))
    assert say_learned(learned)[-1].startswith("with it held-out drops")
    learned.learned = None
    assert say_learned(learned) == [] and describe_learned(learned) is None


def test_a_camera_s_formula_has_no_equation_of_motion(learned):
    learned.learned = replace(learned.learned, formulas=(a_formula(rolling_shutter=(5.0, 0.1)),))
    assert not any("z″" in text for text in (say_missing(learned), *say_learned(learned)))
    told = describe_learned(learned)
    assert told["equation"] == "" and told["curve"][0]["over"] == "row of the picture"


def test_the_json_has_evidences_rivals_curves_and_drops(learned):
    told = describe_learned(learned)
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert told["terms"] == [{"term": "inertial_drag", "coefficient": 513.0, "sd": 49.0, "unit": "Pa s²/m²"}]
    assert (told["formula"], told["equation"], told["place"]) == (FORMULA, EQUATION, "force of speed")
    assert (told["evidence"], told["log_bayes"]) == (50.0, 40.0)
    first, last = told["rivals"]
    assert (first["terms"], first["coefficients"], first["sd"]) == (["viscous_drag"], [264.0], [28.0])
    assert (first["units"], first["evidence"]) == (["Pa s/m"], 45.8)
    assert first["log_evidence_behind"] == pytest.approx(4.2) and last["evidence"] == 20.0
    (curve,) = told["curve"]
    assert [curve[key] for key in ("term", "over", "unit", "value_unit")] == [
        "inertial_drag",
        "speed",
        "m/s",
        "Pa",
    ]
    x, y, low, high = (np.array(curve[key]) for key in ("x", "y", "low", "high"))
    assert (x[0], x[-1]) == SPEED.reach
    np.testing.assert_allclose(y, 513.0 * x**2)
    np.testing.assert_allclose(high - y, 49.0 * x**2, atol=1e-9)
    np.testing.assert_allclose(y - low, 49.0 * x**2, atol=1e-9)
    assert told["held_out"] == {
        "rms_before_m": 16.9e-6,
        "rms_after_m": 3.2e-6,
        "rms_noise_m": 5.2e-6,
        "drops": [
            {"name": "D01", "rms_before_m": 16e-6, "rms_after_m": 3e-6},
            {"name": "D02", "rms_before_m": 18e-6, "rms_after_m": 4e-6},
        ],
    }


def test_a_law_of_the_tip_s_radius_is_drawn_between_the_tips(learned):
    learned.learned = replace(learned.learned, formulas=(a_formula(size_power=(0.5, 0.02)),))
    (curve,) = describe_learned(learned)["curve"]
    assert (curve["x"][0], curve["x"][-1], curve["unit"]) == (0.5, 1.0, "mm")
    assert curve["y"][-1] == pytest.approx(0.0) and curve["y"][0] == pytest.approx(0.5 * np.log(0.5))
    assert curve["low"][0] < curve["y"][0] < curve["high"][0]
