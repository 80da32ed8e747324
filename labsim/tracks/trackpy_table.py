"""Data frames of trackpy saved as CSV: columns y and frame, and where they exist particle and ep.

trackpy counts y downwards from the middle of the first row of pixels, in px; ``ep`` is its estimate of the error of a position.
What it finds is the middle of a bright feature, not the tip of a rod: docs/interchange.md says what that means.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import MeasurementError
from . import Points

NAME = "trackpy data frames (CSV with frame, x, y, particle)"


def recognises(path: Path) -> bool:
    if path.suffix.lower() not in {".csv", ".txt"}:
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        names = {cell.strip().strip('"') for cell in stream.readline().split(",")}
    return {"frame", "x", "y"} <= names and not names & {"t", "tip_row_px"}


def read_points(path: Path) -> dict[str, Points]:
    """Every particle by its number. Raises MeasurementError."""
    try:
        table = pd.read_csv(path, skipinitialspace=True)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as trouble:
        raise MeasurementError(
            path, "track", f"is no table ({trouble}); save it with DataFrame.to_csv"
        ) from None
    table.columns = [str(name).strip() for name in table.columns]
    for name in {"frame", "y", "ep"} & set(table.columns):
        numbers = pd.to_numeric(table[name], errors="coerce")
        wrong = np.flatnonzero((numbers.isna() & table[name].notna()).to_numpy())
        if wrong.size:
            value = table[name].iloc[wrong[0]]
            raise MeasurementError(
                path, name, f"line {wrong[0] + 2} holds {value!r}; write a number or nothing"
            )
        table[name] = numbers
    return split_particles(table)


def split_particles(table: pd.DataFrame) -> dict[str, Points]:
    """A trackpy data frame (``trackpy.locate`` or ``trackpy.link``) by particle."""
    if "particle" not in table.columns:
        return {"particle": _take(table)}
    return {f"{name:g}" if isinstance(name, float) else str(name): _take(part)
            for name, part in table.groupby("particle")}  # fmt: skip


def _take(part: pd.DataFrame) -> Points:
    sigma = None
    if "ep" in part.columns:
        error = part["ep"].to_numpy(float)
        sigma = np.where(error > 0, error, np.nan)
    return Points(frame=part["frame"].to_numpy(float), row=part["y"].to_numpy(float), sigma=sigma)
