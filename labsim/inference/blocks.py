"""One independent part of the data about one point of the parameters."""

from __future__ import annotations

from dataclasses import dataclass

from ..records import FloatArray


@dataclass(frozen=True)
class Block:
    """residual : (n,); covariance : (n, n); tangents : name of global -> (n,).

    free : (n, n) covariance of what an unknown cause of unit size may do here, None where it may do nothing.
    by_speed : (n,) change with the impact speed, per its stated standard uncertainty, of a map.
    """

    residual: FloatArray
    covariance: FloatArray
    tangents: dict[str, FloatArray]
    free: FloatArray | None = None
    by_speed: FloatArray | None = None
