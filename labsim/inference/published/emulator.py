"""A small emulator of stored runs: a polynomial in the logarithms, with the error it makes on runs left out.

Input: positive inputs and outputs of a handful of runs. Output: the same quantities anywhere between them. Depth,
stopping time and compacted volume are close to power laws of p_m and of the speed, so low orders do.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from ...errors import InferenceError
from ...records import FloatArray


@dataclass(frozen=True)
class Emulator:
    """ln y as a polynomial of the standardised ln x. ``sigma`` is the rms error of ln y on runs left out, (m,)."""

    names: tuple[str, ...]
    centre: FloatArray  # (d,)
    scale: FloatArray  # (d,)
    low: FloatArray  # (d,) smallest inputs of the runs
    high: FloatArray  # (d,)
    degree: int
    coefficients: FloatArray  # (terms, m)
    sigma: FloatArray  # (m,)

    def predict(self, inputs: FloatArray) -> FloatArray:
        """Outputs (n, m) at inputs (n, d); inputs beyond the runs by more than 10 % raise InferenceError."""
        inputs = np.atleast_2d(np.asarray(inputs, dtype=float))
        if np.any(inputs < 0.9 * self.low) or np.any(inputs > 1.1 * self.high):
            raise InferenceError(
                "",
                "emulator",
                f"asked outside its runs ({self.low} to {self.high}); add runs that reach there",
            )
        return np.exp(self.predict_log(inputs))

    def predict_log(self, inputs: FloatArray) -> FloatArray:
        x = (np.log(np.atleast_2d(inputs)) - self.centre) / self.scale
        return _terms(x, self.degree) @ self.coefficients

    def column(self, name: str) -> int:
        return self.names.index(name)


def fit_emulator(inputs: FloatArray, outputs: FloatArray, names: tuple[str, ...], degree: int) -> Emulator:
    """Least squares on all runs; the error from leaving out each run in turn (exact, by the hat matrix).

    inputs : (n, d), outputs : (n, m), all positive. Raises InferenceError with fewer runs than terms + 1.
    """
    inputs, outputs = np.atleast_2d(np.asarray(inputs, float)), np.atleast_2d(np.asarray(outputs, float))
    if np.any(inputs <= 0.0) or np.any(outputs <= 0.0) or not np.all(np.isfinite(outputs)):
        raise InferenceError("", "emulator", "runs with outputs that are not positive cannot be emulated")
    logs = np.log(inputs)
    centre = logs.mean(axis=0)
    scale = np.where(np.ptp(logs, axis=0) > 0.0, np.ptp(logs, axis=0) / 2.0, 1.0)
    terms = _terms((logs - centre) / scale, degree)
    if len(terms) <= terms.shape[1]:
        raise InferenceError(
            "", "emulator", f"{len(terms)} runs cannot carry {terms.shape[1]} terms; add runs"
        )
    q, r = np.linalg.qr(terms)
    coefficients = np.linalg.solve(r, q.T @ np.log(outputs))
    leverage = np.sum(q**2, axis=1)[:, None]
    # a run that alone carries a term cannot be left out, and says nothing of the error
    can = leverage[:, 0] < 1.0 - 1e-9
    left_out = (np.log(outputs) - terms @ coefficients)[can] / (1.0 - leverage[can])
    if not can.any():
        raise InferenceError("", "emulator", "no run can be left out to tell its error; add runs")
    return Emulator(
        names=names,
        centre=centre,
        scale=scale,
        low=inputs.min(axis=0),
        high=inputs.max(axis=0),
        degree=degree,
        coefficients=coefficients,
        sigma=np.sqrt(np.mean(left_out**2, axis=0)),
    )


def _terms(x: FloatArray, degree: int) -> FloatArray:
    columns = [np.ones(len(x))]
    for order in range(1, degree + 1):
        for chosen in combinations_with_replacement(range(x.shape[1]), order):
            columns.append(np.prod(x[:, chosen], axis=1))
    return np.stack(columns, axis=1)
