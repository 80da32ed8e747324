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
    """Behind a pair too, and where some causes are rough."""
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
def test_unknown_is_softened_as_a_cause_is_and_none_counts_in_full(unknown):
    """A cause that only imitates what nobody listed is a few in ln evidence ahead: two solvers differ by as much."""
    gains, catalogue = {"first": 30.0, "other": 20.0}, ["first", "other"]
    fits = [SimpleNamespace(hypothesis=(name,), evidence=gain) for name, gain in gains.items()]
    found = dict(judge(SimpleNamespace(evidence=0.0), fits, unknown, catalogue, {}).probabilities)
    prior = {name: weigh_prior((name,), catalogue) for name in catalogue}
    ahead = math.log(found["first",] / found["unknown",] * PRIOR_UNKNOWN) - prior["first"]
    assert ahead == pytest.approx((30.0 - unknown) / TEMPERATURE)
    full = sum(math.exp(prior[name] + gain) for name, gain in gains.items())
    full += PRIOR_UNKNOWN * math.exp(unknown)
    assert found["none",] == pytest.approx(PRIOR_NONE / (PRIOR_NONE + full))


@pytest.mark.parametrize("beside", [-3.0, 0.0, 4.0, 12.0])
def test_what_is_unlisted_may_be_at_work_on_top_of_the_best_cause(beside):
    """As likely beforehand as alone: it takes as much more from that cause, softened, as the data then ask for."""
    gains, catalogue = {"first": 30.0, "other": 20.0}, ["first", "other"]
    fits = [SimpleNamespace(hypothesis=(name,), evidence=gain) for name, gain in gains.items()]
    nominal = SimpleNamespace(evidence=0.0)
    alone = dict(judge(nominal, fits, 10.0, catalogue, {}).probabilities)
    found = dict(judge(nominal, fits, 10.0, catalogue, {}, beside=beside).probabilities)
    more = found["unknown",] / found["first",] - alone["unknown",] / alone["first",]
    assert more == pytest.approx(PRIOR_UNKNOWN * math.exp(beside / TEMPERATURE))
    assert found["other",] / found["first",] == pytest.approx(alone["other",] / alone["first",])
    against_none = (1.0 - found["none",]) / found["none",] - (1.0 - alone["none",]) / alone["none",]
    first = math.exp(weigh_prior(("first",), catalogue) + 30.0)
    assert against_none == pytest.approx(first * PRIOR_UNKNOWN * math.exp(beside) / PRIOR_NONE, rel=1e-6)


def test_causes_that_explain_nothing_take_nothing_from_none():
    """Twenty of them beside one that explains little: they share what is left beside none, however little that one explains."""
    causes = [f"cause {k}" for k in range(20)]
    fits = [SimpleNamespace(hypothesis=(name,), evidence=2.8 * (k == 0)) for k, name in enumerate(causes)]
    found = dict(judge(SimpleNamespace(evidence=0.0), fits, -0.2, causes, {}).probabilities)
    prior = math.exp(weigh_prior(("cause 0",), causes))
    full = prior * (math.exp(2.8) + 19) + PRIOR_UNKNOWN * math.exp(-0.2)
    assert found["none",] == pytest.approx(PRIOR_NONE / (PRIOR_NONE + full))
    assert found["none",] > max(value for name, value in found.items() if name != ("none",))
