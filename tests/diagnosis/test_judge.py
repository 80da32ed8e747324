"""What a verdict names beside the first cause."""

import pytest

from labsim.diagnosis.judge import Verdict

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
