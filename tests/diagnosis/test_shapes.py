"""Shapes that the data leave open: what is said of p_m holds for all of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from labsim.diagnosis.shapes import weigh_shapes
from labsim.inference.fits.fitting import Fit


def fit_shape(log_p_m: float, evidence: float) -> Fit:
    return Fit(("rate",), log_p_m, {"rate": 0.1}, np.eye(2), 1.0, 1, 0.0, evidence, (), ())  # type: ignore[arg-type]


def test_p_m_over_two_shapes() -> None:
    one, other = fit_shape(7.0, 85.7), fit_shape(7.1, 85.7)
    assert weigh_shapes([one, other], one) == pytest.approx((0.05, 0.05))
    assert weigh_shapes([one, other], other) == pytest.approx((-0.05, 0.05))
    assert weigh_shapes([one], one) == (0.0, 0.0)
    behind = replace(other, evidence=85.7 - math.log(9))
    assert weigh_shapes([one, behind], one) == pytest.approx((0.01, math.sqrt(0.1 * 0.09**2 + 0.9 * 0.01**2)))
