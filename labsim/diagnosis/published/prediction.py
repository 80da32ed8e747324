"""One published figure beside what the calibrated simulation says of it, as numbers and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

MISSES = 2.0  # standard deviations beyond which a figure is said to be missed


@dataclass(frozen=True)
class Prediction:
    """One figure: what was published and what the calibrated simulation says, in ``unit``."""

    name: str
    kind: str  # depth, stopping_time, compacted_volume, stopping_time_ratio
    unit: str
    observed: float
    observed_sigma: float
    predicted: float
    predicted_sigma: float
    used: bool = False  # in the calibration
    note: str = ""

    @property
    def deviation(self) -> float:
        """Predicted minus observed in standard deviations of both together."""
        return (self.predicted - self.observed) / math.hypot(self.observed_sigma, self.predicted_sigma)

    @property
    def missed(self) -> bool:
        return abs(self.deviation) > MISSES


def people(row: Prediction) -> tuple[float, str, int]:
    """Factor, unit and digits in which people see a figure."""
    return {
        "m": (1e3, "mm", 3),
        "s": (1e3, "ms", 2),
        "m² s/kg": (1e4, "1e-4 m² s/kg", 2),
        "sphere volumes": (1.0, "sphere volumes", 2),
    }.get(row.unit, (1.0, row.unit, 2))
