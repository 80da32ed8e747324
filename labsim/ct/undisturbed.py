"""The dust that the bead did not reach, in the cells of the map."""

from __future__ import annotations

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray
from .average import SectorAverage
from .bead import Bead


def find_undisturbed(sums: SectorAverage, rows: FloatArray, bead: Bead, top: float) -> np.ndarray:
    """Dust below row ``top``, far below the bead; where the stack ends there, dust far beside it."""
    r = (np.arange(sums.nr) + 0.5) * sums.cell
    distance = np.hypot(r[None, :], (rows - bead.centre[2])[:, None])
    deep = (rows[:, None] > top) & (distance > 3.5 * bead.stated_radius)
    below = deep & (rows[:, None] > bead.centre[2] + 3.5 * bead.stated_radius)
    cells = below if below.sum() > 60 else deep
    if cells.sum() < 30:
        raise MeasurementError(
            "scan",
            "scan.slices",
            "no undisturbed dust is in view (3.5 bead radii away); export more slices below the bead",
        )
    return cells


def average_undisturbed(phi: FloatArray, sigma: FloatArray, cells: np.ndarray) -> tuple[float, float]:
    """Mean filling factor of these cells and its standard error, widened where they scatter more than they say."""
    good = cells & np.isfinite(phi) & (sigma > 0)
    weight = 1 / sigma[good] ** 2
    mean = float(np.average(phi[good], weights=weight))
    scatter = float(np.average((phi[good] - mean) ** 2, weights=weight) / np.mean(1 / weight))
    return mean, float(np.sqrt(max(1.0, scatter) / weight.sum()))
