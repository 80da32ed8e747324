"""Whether a track file can be used, before anything is computed from it."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from .errors import CampaignError, MeasurementError
from .records import Camera
from .tracks import find_format, read_rows


def check_track_file(path: Path, camera: Camera) -> None:
    """See that a track can be used: a header, numbers, and rows that reach below the surface. Raises CampaignError."""
    surface_row = camera.surface_row
    if find_format(path) is not None:
        try:
            found = read_rows(path, camera)
        except MeasurementError as trouble:
            raise CampaignError(trouble.where, trouble.key, trouble.message) from None
        _check_surface_reached(path, "rows", float(found.row.max()), surface_row)
        return
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError) as trouble:
        raise CampaignError(
            path, "", f"cannot be read ({trouble}); give a CSV file with frame,tip_row_px"
        ) from None
    header = [name.strip() for name in rows[0]] if rows else []
    for column in ("frame", "tip_row_px"):
        if column not in header:
            raise CampaignError(
                path, column, "this column is missing; the first line must be frame,tip_row_px"
            )
    if len(rows) == 1:
        raise CampaignError(path, "", "the track is empty; it needs one row per frame")
    at_frame, at_row = header.index("frame"), header.index("tip_row_px")
    previous, deepest = -math.inf, -math.inf
    for number, row in enumerate(rows[1:], start=2):
        for column, place in (("frame", at_frame), ("tip_row_px", at_row)):
            text = row[place].strip() if place < len(row) else ""
            try:
                value = float(text)
            except ValueError:
                raise CampaignError(
                    path, column, f"line {number}: {text!r} is not a number; correct or remove it"
                ) from None
            if not math.isfinite(value):
                raise CampaignError(path, column, f"line {number}: {text} is not finite; leave the frame out")
            if column == "frame":
                if value <= previous:
                    raise CampaignError(
                        path, column, f"line {number}: {text} does not follow {previous:g}; sort the frames"
                    )
                previous = value
            else:
                deepest = max(deepest, value)
    _check_surface_reached(path, "tip_row_px", deepest, surface_row)


def _check_surface_reached(path: Path, column: str, deepest: float, surface_row: float) -> None:
    if deepest <= surface_row:
        raise CampaignError(
            path,
            column,
            f"the track never reaches the surface (largest row {deepest:g}, surface_row_px {surface_row:g}); "
            "rows grow downwards: check surface_row_px",
        )
