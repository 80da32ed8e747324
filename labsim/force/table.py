"""A text table with named columns between commas, semicolons, tabs or blanks; decimal commas where commas do not separate."""

from __future__ import annotations

from pathlib import Path

from ..errors import MeasurementError
from ..records import Gauge
from ..tracks.lines import read_named_columns
from . import Columns


def read(path: Path, gauge: Gauge, section: float) -> Columns:
    """section : of the tip, m². Raises MeasurementError."""
    for key, name in (("depth_column", gauge.depth_column), ("force_column", gauge.column)):
        if not name:
            raise MeasurementError(path, f"record.{key}", "is missing; name the column of the table")
    sleeve = gauge.sleeve
    names = [gauge.depth_column, gauge.column, *([sleeve.column] if sleeve.column else [])]
    _, rows = read_named_columns(path, names)
    depth, pressure = rows[:, 0] * gauge.depth_unit, rows[:, 1] * gauge.unit / gauge.per_pressure(section)
    return Columns(depth, pressure, rows[:, 2] * sleeve.unit) if sleeve.column else Columns(depth, pressure)
