"""Led along a measured or planned path: ``table`` holds its (time s, depth m), straight between."""

from __future__ import annotations

from ...errors import SimulationError
from ..plugins import Parameter

PARAMETERS: tuple[Parameter, ...] = ()
TAKES_TABLE = True


def lead(
    start_depth: float, values: dict[str, float], table: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if len(table) < 2:
        raise SimulationError("simulation", "motion.table", "needs two or more (time s, depth m)")
    time, depth = zip(*table, strict=True)
    return time, depth
