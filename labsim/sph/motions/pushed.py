"""Pushed down at constant speed to a depth, as a penetrometer is."""

from __future__ import annotations

from ...errors import SimulationError
from ..plugins import Parameter

PARAMETERS = (
    Parameter("speed", "m/s", 1e-4, 100.0, 0.1, "slow beside the sound speed, or its inertia is measured"),
    Parameter("end_depth", "m", 1e-6, 1.0, 2e-3, "of the tip below the undisturbed surface"),
)


def lead(
    start_depth: float, values: dict[str, float], table: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, float], tuple[float, float]]:
    way = values["end_depth"] - start_depth
    if way <= 0.0:
        raise SimulationError(
            "simulation",
            "motion.end_depth",
            f"{values['end_depth']:g} m is not below the start, {start_depth:g} m",
        )
    return (0.0, way / values["speed"]), (start_depth, values["end_depth"])
