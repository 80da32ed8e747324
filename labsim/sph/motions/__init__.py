"""One file a motion, found by listing this folder; a file of the same kind may lie anywhere else: docs/extend.md."""

from __future__ import annotations

import numpy as np

from ...errors import SimulationError
from ...records import FloatArray, Motion
from ..plugins import shelf

SHELF = shelf("motions", "motion.kind")
list_motions, find_motion = SHELF.list, SHELF.find


def make_path(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Times (s, rising from 0) and depths (m) that a driver leads the tip through, straight between; both empty where it is
    free. Raises SimulationError."""
    module = find_motion(motion.kind)
    values = SHELF.read_values(motion.kind, motion.values)
    if motion.table and not getattr(module, "TAKES_TABLE", False):
        raise SimulationError(
            "simulation", "motion.table", f"is nothing that {motion.kind} reads; leave it out"
        )
    path = module.lead(motion.start_depth, values, motion.table)
    if path is None:
        return np.zeros(0), np.zeros(0)
    time, depth = (np.ascontiguousarray(each, dtype=float) for each in path)
    if (
        time.shape != depth.shape or time.ndim != 1 or time.size < 2 or time[0] != 0.0
        or not (np.all(np.diff(time) > 0) and np.all(np.isfinite(depth)))
    ):  # fmt: skip
        raise SimulationError(
            "simulation", "motion", "needs two or more times that rise from 0, and as many depths"
        )
    if depth[0] != motion.start_depth:
        raise SimulationError(
            "simulation",
            "motion.start_depth",
            f"is {motion.start_depth:g} m, but the path begins at {depth[0]:g} m; make them the same",
        )
    return time, depth
