"""A gauge's record of a tip that is pushed: pressure on the tip's section against depth.

One file a format, found by listing this folder: ``SUFFIXES`` that it reads and ``read(path, gauge, section) -> Columns``. What
no format claims is a table with named columns (``table.py``). Depth is positive below the surface, pressure positive against
the motion; a cone's pressure is corrected for the pore water behind it, qt = qc + (1 - a) u (Lunne, Robertson & Powell 1997).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..errors import CampaignError, MeasurementError
from ..extensions import list_modules
from ..records import FloatArray, Gauge, Sleeve
from ..tables import Table

DEPTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
FORCE_UNITS = {"N": 1.0, "kN": 1e3, "mN": 1e-3}
PRESSURE_UNITS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6}
FEWEST = 20  # rows
LARGEST = 1e10  # Pa, beyond which nothing is believed


@dataclass(frozen=True)
class Columns:
    """What a format's reader finds. depth : m; pressure : Pa, on the tip's section, corrected where the record says how; sleeve,
    pore : Pa, empty where there are none. All (n,)."""

    depth: FloatArray
    pressure: FloatArray
    sleeve: FloatArray = field(default_factory=lambda: np.empty(0))
    pore: FloatArray = field(default_factory=lambda: np.empty(0))


def correct_for_water(
    path: Path,
    key: str,
    area_ratio: float,
    depth: FloatArray,
    tip: FloatArray,
    sleeve: FloatArray,
    pore: FloatArray,
) -> Columns:
    """A cone sounding with qt = qc + (1 - a) u where pore water was measured. (n,), m and Pa, NaN where there is nothing; key :
    what the file calls the area ratio. Raises MeasurementError."""
    measured = bool(np.isfinite(pore).any())
    if measured and not 0.0 <= area_ratio <= 1.0:
        raise MeasurementError(
            path, key, f"is {area_ratio:g}, not an area ratio between 0 and 1; write it into the heading"
        )
    if measured:  # a row without u is lost: nobody knows its correction
        tip = tip + (1.0 - area_ratio) * pore
    nothing = np.empty(0)
    return Columns(
        depth, tip, sleeve if np.isfinite(sleeve).any() else nothing, pore if measured else nothing
    )


@dataclass(frozen=True)
class ForceRecord:
    """One record inside its window, sorted by depth. depth (m), pressure (Pa) : (n,); lost : rows without a number; lifted : rows
    that are no deeper than one before, as where a rod is added; step : m, between rows."""

    depth: FloatArray
    pressure: FloatArray
    sleeve: FloatArray
    pore: FloatArray
    lost: int
    lifted: int
    step: float


def read_gauge(table: Table) -> Gauge:
    """The keys of ``[record]`` that say what the gauge is. Raises CampaignError."""
    forces, pressures = table.has("force_column"), table.has("pressure_column")
    if forces and pressures:
        raise table.wrong("force_column", "and pressure_column are both there; keep the one that is meant")
    window = None
    if table.has("window_mm"):
        window = table.span("window_mm", 0.0, 1e5, write="two depths as [5.0, 40.0]", first="shallower depth")
    units = FORCE_UNITS if forces else PRESSURE_UNITS
    if forces or pressures:
        name = table.choice("force_unit", tuple(units))
    else:  # formats without named columns state their unit; this one is that of the errors
        units = FORCE_UNITS | PRESSURE_UNITS
        name = table.choice("force_unit", tuple(units), "MPa")
    unit = units[name]
    top = LARGEST / unit
    return Gauge(
        depth_column=table.text("depth_column", ""),
        column=table.text("force_column", "") or table.text("pressure_column", ""),
        is_force=name in FORCE_UNITS,
        depth_unit=DEPTH_UNITS[table.choice("depth_unit", tuple(DEPTH_UNITS), "m")],
        unit=unit,
        sigma=table.number("sigma", 0.0, top, unit=unit),
        offset_sigma=table.number("offset_sigma", 0.0, top, unit=unit, default=0.0),
        scale_sigma=table.number("scale_sigma", 0.0, 0.5, default=0.0),
        window=(0.0, math.inf) if window is None else (window[0] * 1e-3, window[1] * 1e-3),
        surface=1e-3 * table.number("surface_mm", -1e5, 1e5, default=0.0),
        sleeve=_read_sleeve(table),
    )


def _read_sleeve(table: Table) -> Sleeve:
    """The keys that say what the friction sleeve's gauge is. Raises CampaignError."""
    column, compared = table.text("sleeve_column", ""), table.get("sleeve", False)
    if not isinstance(compared, bool):
        raise table.wrong("sleeve", f"{compared!r} is neither true nor false; write true where it counts")
    if column and not table.has("pressure_column"):
        raise table.wrong(
            "sleeve_column",
            "needs pressure_column: a sleeve is compared with what the tip alone meets, a force holds the shaft too",
        )
    if compared and table.has("force_column"):
        raise table.wrong(
            "sleeve", "is true for a force, which holds the shaft too; give pressure_column or write false"
        )
    if compared and table.has("pressure_column") and not column:
        raise table.wrong("sleeve", "is true, but no sleeve_column is there; name the column of the table")
    unit = PRESSURE_UNITS[table.choice("sleeve_unit", tuple(PRESSURE_UNITS), "kPa")]
    top = LARGEST / unit
    # a ratio without an error would count without bound, so whoever lets it count states the noise
    sigma = (
        table.number("sleeve_sigma", 0.0, top, unit=unit)
        if compared
        else table.number("sleeve_sigma", 0.0, top, unit=unit, default=0.0)
    )
    return Sleeve(
        column,
        unit,
        sigma,
        table.number("sleeve_offset_sigma", 0.0, top, unit=unit, default=0.0),
        table.number("sleeve_scale_sigma", 0.0, 0.5, default=0.0),
        compared,
    )


def read_force(path: Path, gauge: Gauge, radius: float) -> ForceRecord:
    """A record inside its window. radius : of the tip, m. A file that did not change is read once. Raises MeasurementError."""
    try:
        state = path.stat()
    except OSError:  # the format's reader says what is wrong
        return _read(path, gauge, radius, (0, 0))
    return _read(path, gauge, radius, (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=128)
def _read(path: Path, gauge: Gauge, radius: float, state: tuple[int, int]) -> ForceRecord:
    section = math.pi * radius**2
    formats = list_modules(__name__, "labsim.force_formats")
    claimed = (m for m in formats.values() if path.suffix.lower() in getattr(m, "SUFFIXES", ()))
    reader = next(claimed, formats["table"])
    found = reader.read(path, gauge, section)
    good = np.isfinite(found.depth) & np.isfinite(found.pressure)
    if good.sum() < FEWEST:
        raise MeasurementError(
            path,
            "record.file",
            f"has {int(good.sum())} rows with depth and force, fewer than {FEWEST}; export them all",
        )
    depth = found.depth[good] - gauge.surface
    sinking = depth > np.concatenate([[-math.inf], np.maximum.accumulate(depth)[:-1]])
    inside = sinking & (depth >= gauge.window[0]) & (depth <= gauge.window[1])
    if inside.sum() < FEWEST:
        low, high = (1e3 * each for each in gauge.window)
        raise MeasurementError(
            path,
            "record.window_mm",
            f"{low:g} to {high:g} mm holds {int(inside.sum())} rows of a record from {1e3 * depth.min():g} to "
            f"{1e3 * depth.max():g} mm; choose depths that the record has",
        )
    if np.abs(found.pressure[good]).max() > LARGEST:
        raise MeasurementError(
            path, "record.force_unit", f"gives pressures beyond {LARGEST:g} Pa; correct the unit"
        )

    def cut(values: FloatArray) -> FloatArray:
        return values[good][inside] if values.size else values

    kept = depth[inside]
    return ForceRecord(
        kept,
        cut(found.pressure),
        cut(found.sleeve),
        cut(found.pore),
        int(np.sum(~good)),
        int(np.sum(~sinking)),
        float(np.median(np.diff(kept))),
    )


def check_force(path: Path, gauge: Gauge, radius: float) -> None:
    """See that a record can be read, before anything is computed. Raises CampaignError."""
    try:
        record = read_force(path, gauge, radius)
    except MeasurementError as trouble:
        raise CampaignError(trouble.where, trouble.key, trouble.message) from None
    if np.median(record.pressure) <= 0.0:
        raise CampaignError(
            path,
            gauge.column or "record.file",
            f"is {np.median(record.pressure):.3g} Pa in the middle: what resists a push is positive; turn its sign",
        )
    if gauge.sleeve.compared and not record.sleeve.size:
        raise CampaignError(
            path, "record.sleeve", "is true, but the record has no sleeve friction; write false, or export it"
        )


__all__ = ["Columns", "ForceRecord", "check_force", "read_force", "read_gauge"]
