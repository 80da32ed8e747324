"""The emulator: exact on power laws, honest about what it leaves out."""

from __future__ import annotations

import numpy as np
import pytest

from labsim.errors import InferenceError
from labsim.inference.published.emulator import fit_emulator


def test_power_laws_are_exact() -> None:
    random = np.random.default_rng(0)
    x = random.uniform(0.5, 2.0, (12, 2))
    y = np.column_stack([3.0 * x[:, 0] ** -0.3 * x[:, 1] ** 1.1, x[:, 0] ** 0.4])
    emulator = fit_emulator(x, y, ("a", "b"), degree=2)
    inside = random.uniform(0.7, 1.5, (5, 2))
    assert emulator.predict(inside)[:, 0] == pytest.approx(3.0 * inside[:, 0] ** -0.3 * inside[:, 1] ** 1.1)
    assert np.all(emulator.sigma < 1e-10)


def test_sigma_is_the_error_on_runs_left_out() -> None:
    random = np.random.default_rng(1)
    x = np.geomspace(1.0, 10.0, 9)[:, None]
    y = x**-0.3 * np.exp(0.02 * random.standard_normal((9, 1)))
    whole = fit_emulator(x, y, ("y",), degree=2)
    left_out = []
    for i in range(9):
        keep = np.arange(9) != i
        logs = np.log(x[:, 0])
        part = np.polyfit(logs[keep], np.log(y[keep, 0]), 2)
        left_out.append(np.log(y[i, 0]) - np.polyval(part, logs[i]))
    assert whole.sigma[0] == pytest.approx(np.sqrt(np.mean(np.square(left_out))), rel=1e-8)


def test_it_refuses_to_guess() -> None:
    x = np.geomspace(1.0, 10.0, 6)[:, None]
    emulator = fit_emulator(x, x**2, ("y",), degree=1)
    with pytest.raises(InferenceError, match="outside its runs"):
        emulator.predict(np.array([[20.0]]))
    with pytest.raises(InferenceError, match="add runs"):
        fit_emulator(x[:3], x[:3], ("y",), degree=3)
    with pytest.raises(InferenceError, match="not positive"):
        fit_emulator(x, -x, ("y",), degree=1)
