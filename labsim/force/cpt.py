"""Cone soundings in the lines of Nordic loggers (``.cpt``): ``D=10.02,QC=0.8213,FS=12.1,U=301.5,...``, one a depth.

D in m, QC (tip) in MPa, FS (sleeve) and U (pore water behind the cone) in kPa; MA= in the heading is the cone's area ratio a.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from ..errors import LabsimError, MeasurementError
from ..records import Gauge
from ..tracks.lines import read_lines, read_number
from . import Columns, correct_for_water

SUFFIXES = (".cpt",)
FIELD = re.compile(r"(?:^|,)\s*([A-Za-z%]+)\s*=\s*([^,]*)")
KEYS = ("D", "QC", "FS", "U")


def read(path: Path, gauge: Gauge, section: float) -> Columns:
    """section is of no use: the record has pressures. Raises MeasurementError."""
    try:
        lines = read_lines(path)
    except LabsimError as trouble:
        raise MeasurementError(path, "record.file", trouble.message) from None
    area_ratio = math.nan
    rows: list[list[float]] = []
    for number, text in lines:
        fields = {key.upper(): value.strip() for key, value in FIELD.findall(text)}
        if "MA" in fields and not rows:
            area_ratio = _read(path, number, "MA", fields)
        if "D" in fields and "QC" in fields:
            rows.append([_read(path, number, key, fields) for key in KEYS])
    if not rows:
        raise MeasurementError(
            path, "record.file", "has no line with D= and QC=; name a sounding's .cpt file"
        )
    depth, tip, sleeve, pore = np.array(rows).T
    return correct_for_water(path, "MA", area_ratio, depth, tip * 1e6, sleeve * 1e3, pore * 1e3)


def _read(path: Path, number: int, key: str, fields: dict[str, str]) -> float:
    try:
        return read_number(fields.get(key, ""), ",")
    except ValueError as trouble:
        raise MeasurementError(path, f"line {number}", f"{key}={trouble}") from None
