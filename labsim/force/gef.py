"""Cone soundings in the Dutch exchange format (``.gef``), read by pygef: ``pip install "labsim[gef]"``.

Depth along the rod in m, cone resistance, sleeve friction and pore water behind the cone (u2) in MPa, the area ratio of the
cone as measurement variable 3.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LabsimError, MeasurementError
from ..records import FloatArray, Gauge
from ..tracks.lines import read_lines
from . import Columns, correct_for_water

SUFFIXES = (".gef",)
NAMES = ("penetrationLength", "coneResistance", "localFriction", "porePressureU2")


def read(path: Path, gauge: Gauge, section: float) -> Columns:
    """section is of no use: the record has pressures. Raises MeasurementError."""
    try:
        import pygef
    except ImportError:
        raise MeasurementError(
            path, "record.file", 'needs pygef; install it with pip install "labsim[gef]"'
        ) from None
    try:
        read_lines(path)  # within bounds, before a library reads it whole
        found = pygef.read_cpt(
            path, replace_column_voids=False
        )  # by itself it draws lines across what is missing
        columns = {name: _column(found, name) for name in NAMES}
    except LabsimError as trouble:
        raise MeasurementError(path, "record.file", trouble.message) from None
    except Exception as trouble:  # whatever pygef and polars raise at a damaged file, pyo3's panics apart
        said = " ".join(str(trouble).split())[:200]
        raise MeasurementError(
            path, "record.file", f"is no cone sounding that pygef reads ({said})"
        ) from None
    for name in NAMES[:2]:
        if not np.isfinite(columns[name]).any():
            raise MeasurementError(
                path, "record.file", f"has no column of {name}; export it with its columns"
            )
    depth, tip, sleeve, pore = (columns[name] for name in NAMES)
    ratio = found.cone_surface_quotient
    ratio = math.nan if ratio is None else float(ratio)
    return correct_for_water(path, "MEASUREMENTVAR 3", ratio, depth, tip * 1e6, sleeve * 1e6, pore * 1e6)


def _column(found: Any, name: str) -> FloatArray:
    """NaN where the file says that nothing was measured, or has no such column."""
    if name not in found.data.columns:
        return np.full(len(found.data), math.nan)
    values = np.asarray(found.data[name].to_numpy(), dtype=float)
    return np.where(values == found.column_void_mapping.get(name, math.nan), math.nan, values)
