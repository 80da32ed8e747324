"""Causes whose best fits predict nearly the same are one class, whichever of them has more evidence."""

from types import SimpleNamespace

import numpy as np
import pytest

from labsim.diagnosis.judge import NAMED, ROUGH_TEMPERATURE, TEMPERATURE, find_class
from labsim.inference.fits.blocks import Block


def predict(*causes: str, residual=(0.0, 0.0), sigma=0.5):
    block = Block(np.array(residual), sigma**2 * np.eye(2), {})
    return SimpleNamespace(hypothesis=causes, blocks=(block,))


def test_what_is_far_from_all_others_is_no_class():
    first = predict("gas")
    assert find_class(first, [first, predict("crust", residual=(5.0, 5.0))]) == ["gas"]


def test_what_predicts_the_same_is_one_class_in_any_order():
    fits = [predict("gas"), predict("tension", residual=(0.1, 0.0)), predict("shear", residual=(0.0, 0.1))]
    assert find_class(fits[0], fits) == find_class(fits[0], fits[::-1]) == ["gas", "shear", "tension"]


def test_of_pairs_no_class_is_stated():
    assert find_class(predict("gas"), [predict("gas", "crust")]) == ["gas"]


@pytest.mark.parametrize(
    ("rough", "temperature"),
    [((), TEMPERATURE), (("crust",), TEMPERATURE), (("gas", "crust"), ROUGH_TEMPERATURE)],
)
def test_a_class_ends_where_the_truth_would_on_average_be_named_alone(rough, temperature):
    """Half the squared distance over the temperature is what the ln odds would be."""
    sigma, odds = 0.5, np.log(NAMED / (1.0 - NAMED))
    edge = sigma * np.sqrt(2.0 * temperature * odds)
    for share, alike in ((0.99, ["crust", "gas"]), (1.01, ["gas"])):
        other = predict("crust", residual=(share * edge, 0.0))
        assert find_class(predict("gas"), [other], rough) == alike
