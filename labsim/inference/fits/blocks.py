"""One independent part of the data about one point of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from ...errors import ExtrapolationError
from ...records import FloatArray


@dataclass(frozen=True)
class Block:
    """residual : (n,); covariance : (n, n); tangents : name of global -> (n,).

    free : gives the (n, n) covariance of what an unknown cause of unit size may do here; None where it may do nothing.
    nuisances : (n, k) what the observation's own nuisances change, per standard uncertainty of each; none where it has none.
    sections : name of a record or map among several -> its part of the data.
    Arrays are never written to: the covariance is factorised once.
    """

    residual: Float[np.ndarray, " n"]
    covariance: Float[np.ndarray, "n n"]
    tangents: Mapping[str, Float[np.ndarray, " n"]]
    free: Callable[[], FloatArray] | None = None
    nuisances: Float[np.ndarray, "n k"] | None = None
    sections: Mapping[str, slice] = field(default_factory=dict)

    @cached_property
    def lower(self) -> FloatArray:
        """Cholesky factor of the covariance; above its diagonal stands nothing of use. Raises ExtrapolationError."""
        return factorise(self.covariance)

    @property
    def log_determinant(self) -> float:
        """ln of the covariance's determinant."""
        return 2 * float(np.sum(np.log(np.diag(self.lower))))

    def solve(self, columns: FloatArray) -> FloatArray:
        """Inverse of the covariance times columns, (n,) or (n, k)."""
        return np.asarray(cho_solve((self.lower, True), columns, check_finite=False))

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Columns, (n,) or (n, k), in directions of independent errors of unit size."""
        return np.asarray(solve_triangular(self.lower, columns, lower=True, check_finite=False))

    @property
    def chi_square(self) -> float:
        """Squared length of the whitened residual."""
        white = self.whiten(self.residual)
        return float(white @ white)


@runtime_checkable
class Part(Protocol):
    """Data of one record about one point: a part of a Block."""

    @property
    def residual(self) -> FloatArray:
        """(n,)"""

    @property
    def white(self) -> FloatArray:
        """(n,) variances of errors that each datum has alone."""

    @property
    def local(self) -> FloatArray:
        """(n, k) errors of this record alone, per standard uncertainty of each."""

    @property
    def shared(self) -> Mapping[str, FloatArray]:
        """name -> (n,), errors with one value for all records that have the name, per standard uncertainty."""


def lay_out(sizes: Iterable[int]) -> list[slice]:
    """Where records of these sizes lie, one after the other."""
    ends = np.cumsum([0, *sizes])
    return [slice(int(begin), int(end)) for begin, end in pairwise(ends)]


def add_errors(covariance: FloatArray, parts: Sequence[Part], sections: Sequence[slice]) -> None:
    """Add to a covariance (n, n) what each record errs by alone, and what they share."""
    for part, own in zip(parts, sections, strict=True):
        covariance[own, own] += part.local @ part.local.T + np.diag(part.white)
    shared = {name: None for part in parts for name in part.shared}
    columns = np.zeros((len(covariance), len(shared)))
    for k, name in enumerate(shared):
        for part, own in zip(parts, sections, strict=True):
            if name in part.shared:
                columns[own, k] = part.shared[name]
    covariance += columns @ columns.T


def factorise(covariance: FloatArray) -> FloatArray:
    """Lower Cholesky factor; rounding is mended. Raises ExtrapolationError where the model has no answer."""
    try:
        if np.all(np.isfinite(covariance)):
            with suppress(np.linalg.LinAlgError):
                return np.asarray(cho_factor(covariance, lower=True, check_finite=False)[0])
            mended = covariance + 1e-9 * np.diag(np.diag(covariance))
            return np.asarray(cho_factor(mended, lower=True, check_finite=False)[0])
    except np.linalg.LinAlgError:
        pass
    raise ExtrapolationError("simulation", "runs", "extrapolate to no finite depth here; see labsim runs")


def whiten_all(blocks: Sequence[Block], names: Sequence[str]) -> FloatArray:
    """Residual and tangents of all blocks in directions of independent errors of unit size, (n, 1 + names)."""
    return np.concatenate(
        [
            block.whiten(np.stack([block.residual, *(block.tangents[name] for name in names)], axis=1))
            for block in blocks
        ]
    )


def solve_globals(
    blocks: Sequence[Block], names: Sequence[str], priors: Mapping[str, tuple[float, float]]
) -> tuple[FloatArray, FloatArray, float, float, list[FloatArray]]:
    """Step of the globals (k,), their covariance, χ² left, ln det C, and C⁻¹ (residual - tangents step) per block.

    priors: name -> (distance of the current value from the prior's middle, prior width); flat where absent. Raises
    ExtrapolationError where the data say nothing of one.
    """
    information, gradient = np.zeros((len(names), len(names))), np.zeros(len(names))
    designs, log_determinant = [], 0.0
    for block in blocks:
        design = np.stack([block.tangents[name] for name in names], axis=1)
        solved = block.solve(design)
        information += design.T @ solved
        gradient += solved.T @ block.residual
        log_determinant += block.log_determinant
        designs.append(design)
    for k, name in enumerate(names):
        if name in priors:
            away, width = priors[name]
            information[k, k] += 1 / width**2
            gradient[k] -= away / width**2
    try:
        covariance = np.linalg.inv(information)
    except np.linalg.LinAlgError:
        raise ExtrapolationError(
            "simulation", "runs", "extrapolate to where nothing depends on p_m any more; see labsim runs"
        ) from None
    step = covariance @ gradient
    chi_square, weighted = 0.0, []
    for block, design in zip(blocks, designs, strict=True):
        left = block.residual - design @ step
        weighted.append(block.solve(left))
        chi_square += float(left @ weighted[-1])
    return step, covariance, chi_square, log_determinant, weighted
