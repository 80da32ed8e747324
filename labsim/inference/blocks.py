"""One independent part of the data about one point of the parameters."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from ..errors import ExtrapolationError
from ..records import FloatArray


@dataclass(frozen=True)
class Block:
    """residual : (n,); covariance : (n, n); tangents : name of global -> (n,).

    free : (n, n) covariance of what an unknown cause of unit size may do here, None where it may do nothing.
    by_speed : (n,) change with the impact speed, per its stated standard uncertainty, of a map.
    Arrays are never written to: the covariance is factorised once.
    """

    residual: FloatArray
    covariance: FloatArray
    tangents: Mapping[str, FloatArray]
    free: FloatArray | None = None
    by_speed: FloatArray | None = None

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
