"""A text table with named columns between commas, semicolons, tabs or blanks, one row a sample."""

from __future__ import annotations

import math
from pathlib import Path

from ..errors import MeasurementError
from ..records import Accelerometer
from ..tracks.lines import read_named_columns
from . import Readings


def read(path: Path, accelerometer: Accelerometer) -> Readings:
    """An empty cell is NaN, but not that of the time. Raises MeasurementError."""
    if not accelerometer.time_column:
        raise MeasurementError(
            path,
            "record.time_column",
            'is missing; name the column of the table that holds seconds: "time_s"',
        )
    names = [accelerometer.time_column, *(sensor.column for sensor in accelerometer.sensors)]
    lines, rows = read_named_columns(path, names)
    for number, time in zip(lines, rows[:, 0], strict=True):
        if not math.isfinite(time):
            raise MeasurementError(path, f"line {number}", "holds no time; correct or remove the line")
    return Readings(rows[:, 0], rows[:, 1:] * accelerometer.unit, (math.inf,) * len(accelerometer.sensors))
