"""A text table with named columns between commas, semicolons, tabs or blanks; decimal commas where commas do not separate."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..errors import LabsimError, MeasurementError
from ..records import Gauge
from ..tracks.lines import find_mark, read_lines, split_line
from . import Columns


def read(path: Path, gauge: Gauge, section: float) -> Columns:
    """section : of the tip, m². Raises MeasurementError."""
    for key, name in (("depth_column", gauge.depth_column), ("force_column", gauge.column)):
        if not name:
            raise MeasurementError(path, f"record.{key}", "is missing; name the column of the table")
    try:
        lines = read_lines(path)
    except LabsimError as trouble:
        raise MeasurementError(path, "record.file", trouble.message) from None
    if len(lines) < 2:
        raise MeasurementError(path, "record.file", "holds no table; export it with its heading")
    mark = find_mark(lines[0][1])
    heading = split_line(lines[0][1], mark)
    for name in (gauge.depth_column, gauge.column):
        if heading.count(name) != 1:
            raise MeasurementError(
                path,
                f"line {lines[0][0]}",
                f"has {heading.count(name) or 'no'} column{'s' * (heading.count(name) > 1)} {name!r}; "
                f"the columns are {', '.join(heading)[:200]}",
            )
    places = [heading.index(gauge.depth_column), heading.index(gauge.column)]
    rows = np.array(
        [
            [_read_cell(path, number, split_line(text, mark), k, mark) for k in places]
            for number, text in lines[1:]
        ]
    )
    pressure = rows[:, 1] * gauge.unit
    return Columns(rows[:, 0] * gauge.depth_unit, pressure / section if gauge.is_force else pressure)


def _read_cell(path: Path, number: int, cells: list[str], place: int, mark: str) -> float:
    cell = cells[place] if place < len(cells) else ""
    if cell == "":
        return math.nan
    try:
        return float(cell.replace(",", ".") if mark != "," else cell)
    except ValueError:
        raise MeasurementError(
            path, f"line {number}", f"{cell[:40]!r} is not a number; correct or remove the line"
        ) from None
