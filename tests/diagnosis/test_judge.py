"""What a verdict names beside the first cause."""

import itertools
import math
from types import SimpleNamespace

import pytest

from labsim.diagnosis.judge import PRIOR_NONE, PRIOR_UNKNOWN, TEMPERATURE, Verdict, judge, weigh_prior

SHEAR, TENSILE, GAS, NONE = ("shear_strength",), ("tensile_strength",), ("pore_gas",), ("none",)


@pytest.mark.parametrize(
    ("probabilities", "named"),
    [
        ([(SHEAR, 0.97), (TENSILE, 0.03)], [SHEAR]),
        ([(SHEAR, 0.484), (TENSILE, 0.480), (GAS, 0.036)], [SHEAR, TENSILE]),
        ([(SHEAR, 0.6), (NONE, 0.35), (GAS, 0.05)], [SHEAR, NONE]),
        ([(SHEAR, 0.4), (TENSILE, 0.3), (GAS, 0.15), (NONE, 0.15)], [SHEAR, TENSILE, GAS]),
    ],
)
def test_a_verdict_names_what_the_data_hardly_tell_from_the_first(probabilities, named):
    assert [hypothesis for hypothesis, _ in Verdict("effect", probabilities).named] == named


@pytest.mark.parametrize("word", ["none", "unknown"])
def test_where_nothing_listed_is_at_work_no_cause_is_named(word):
    verdict = Verdict(word, [((word,), 0.8), (SHEAR, 0.15), (GAS, 0.05)])
    assert verdict.named == [((word,), 0.8)]


@pytest.mark.parametrize(
    "gains", [(50.0, 20.0, 49.0), (30.0, 27.0, 27.5), (50.0, 49.0, 48.9), (4.0, 1.0, -3.0)]
)
@pytest.mark.parametrize("lead", [0.5, 6.0, 30.0])
@pytest.mark.parametrize("rough", [(), ("first",), ("first", "second"), ("first", "second", "other")])
def test_a_single_with_less_evidence_never_stands_before_one_with_more(gains, lead, rough):
    """Behind a pair too, whose own singles are softened less than others; and where some causes are rough."""
    names = ["first", "second", "other"]
    fits = [
        SimpleNamespace(hypothesis=(name,), evidence=gain) for name, gain in zip(names, gains, strict=True)
    ]
    fits.append(SimpleNamespace(hypothesis=("first", "second"), evidence=max(gains) + lead))
    nominal = SimpleNamespace(evidence=0.0)
    verdict = judge(nominal, fits, -100.0, names, {}, rough=rough)
    probability = dict(verdict.probabilities)
    assert sum(probability.values()) == pytest.approx(1.0)
    for (a, x), (b, y) in itertools.combinations(zip(names, gains, strict=True), 2):
        assert (x - y) * (probability[a,] - probability[b,]) > 0.0


@pytest.mark.parametrize("names", list(itertools.permutations(["gas", "shear", "mass"])))
@pytest.mark.parametrize("gains", [(60.0, 50.0, 40.0), (30.0, 29.0, 8.0)])
def test_among_singles_too_more_evidence_stands_first_whichever_are_rough(names, gains):
    fits = [SimpleNamespace(hypothesis=(n,), evidence=gain) for n, gain in zip(names, gains, strict=True)]
    verdict = judge(SimpleNamespace(evidence=0.0), fits, -100.0, names, {}, rough=("gas", "shear"))
    assert [hypothesis[0] for hypothesis, _ in verdict.probabilities][:3] == list(names)


def test_a_cause_is_at_work_alone_or_beside_another():
    verdict = Verdict("effect", [(("rate",), 0.6), (("rate", "gauge"), 0.3), (("none",), 0.1)])
    assert verdict.inclusion == pytest.approx({"rate": 0.9, "gauge": 0.3, "none": 0.1})
    assert verdict.of_first == pytest.approx(0.9)


@pytest.mark.parametrize("unknown", [-3.0, 0.0, 10.0, 29.0, 31.0, 60.0])
def test_unknown_is_softened_as_the_causes_are_and_none_counts_in_full(unknown):
    """A cause that only imitates what nobody listed is a few in ln evidence ahead: two solvers differ by as much."""
    fits = [
        SimpleNamespace(hypothesis=("first",), evidence=30.0),
        SimpleNamespace(hypothesis=("other",), evidence=20.0),
    ]
    found = dict(judge(SimpleNamespace(evidence=0.0), fits, unknown, ["first", "other"], {}).probabilities)
    ahead = math.log(found["first",] / found["unknown",] * PRIOR_UNKNOWN) - weigh_prior(
        ("first",), ["first", "other"]
    )
    expected = (30.0 - max(unknown, 0.0)) / TEMPERATURE - min(unknown, 0.0)
    assert ahead == pytest.approx(expected)
    best = max(30.0, unknown)
    best_is = ("first",) if unknown < 30.0 else ("unknown",)
    prior = weigh_prior(("first",), ["first", "other"]) if unknown < 30.0 else math.log(PRIOR_UNKNOWN)
    assert math.log(found[best_is] / found["none",] * PRIOR_NONE) == pytest.approx(best + prior)
