"""Text tables of OSP Tracker: exported with File | Export | Data File, or copied from a data table.

A line "#multi:" where there are several tracks; a line with the tracks' names, each above its first column; a line of columns
that starts with t; then one line a frame, empty cells where a track has no mark. Separated by tab, comma, semicolon or blanks;
decimal commas where the separator is another. Rows come from pixely. A y in a unit of length is taken as the height above the
undisturbed surface, upwards, and only where the header says its unit, as y (mm): Tracker does not write units itself.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray
from . import Points
from .lines import find_mark, read_lines, read_number

NAME = "OSP Tracker tables (t, x, y … with pixely)"
SUFFIXES = {".txt", ".csv", ".tsv", ".dat"}
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "s": 1.0, "ms": 1e-3}
COLUMN = re.compile(r"^(?P<name>[a-z]+)\s*[(\[_]?\s*(?P<unit>m|cm|mm|um|µm|s|ms)?\s*[)\]]?$")


def recognises(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and _find_header(_texts(path, 8)) is not None


def read_points(path: Path) -> dict[str, Points]:
    """Every track of a table by its name. Raises MeasurementError."""
    lines = _texts(path)
    found = _find_header(lines)
    assert found is not None
    at, mark = found
    header = _split(lines[at], mark)
    columns = [_read_column(cell) for cell in header]
    begins, names = _find_tracks(lines[:at], mark, len(header))
    rows = [_split(line, mark) for line in lines[at + 1 :]]
    numbers = _read_numbers(path, rows, header, at + 2, mark)
    time = numbers[:, 0] * columns[0][1]
    tracks: dict[str, Points] = {}
    for number, (begin, name) in enumerate(zip(begins, names, strict=True)):
        end = begins[number + 1] if number + 1 < len(begins) else len(header)
        here = {columns[k][0]: k for k in range(end - 1, begin - 1, -1)}
        row = numbers[:, here["pixely"]] if "pixely" in here else None
        height = None
        if row is None and "y" in here:
            unit = columns[here["y"]][1]
            if not np.isfinite(unit):
                raise MeasurementError(
                    path,
                    "y",
                    "has no unit; export the column pixely too, or write y (mm) in the header where y is "
                    "counted upwards from the undisturbed surface",
                )
            height = numbers[:, here["y"]] * unit
        frame = numbers[:, here["frame"]] if "frame" in here else None
        # t is the time of the video file, for high-speed recordings mostly that of the replay: frames win
        tracks[name] = Points(frame=frame, time=time if frame is None else None, row=row, height=height)
    return tracks


def _texts(path: Path, most: int | None = None) -> list[str]:
    return [text for _, text in read_lines(path, most)]


def _find_header(lines: list[str]) -> tuple[int, str] | None:
    """Line of the columns and what separates them: t first, then a y or pixely; None where there is no such line."""
    for at, line in enumerate(lines[:4]):
        mark = find_mark(line)
        names = [_read_column(cell)[0] for cell in _split(line, mark)]
        if names and names[0] == "t" and {"y", "pixely"} & set(names):
            return at, mark
    return None


def _split(line: str, mark: str) -> list[str]:
    line = line.lstrip("# ") if mark == "\t" else line.strip("# ")
    cells = line.split() if mark == " " else line.split(mark)
    return [cell.strip().strip('"') for cell in cells]


def _read_column(cell: str) -> tuple[str, float]:
    """Name of a column without the braces of its index, and its unit in SI; NaN where y says none."""
    name = (
        re.sub(r"_?\{(\w+)\}", r"\1", cell.lower()).replace("pixel_y", "pixely").replace("pixel_x", "pixelx")
    )
    match = COLUMN.match(name)
    if match is None:
        return name, float("nan")
    unit = match["unit"]
    if unit is None:
        return match["name"], 1.0 if match["name"] in {"t", "frame", "step", "pixelx", "pixely"} else float(
            "nan"
        )
    return match["name"], UNITS[unit]


def _find_tracks(above: list[str], mark: str, width: int) -> tuple[list[int], list[str]]:
    """First column and name of every track."""
    named = [line for line in above if not line.lstrip().startswith("#")]
    cells = _split(named[-1], mark) if named and mark != " " else []
    begins = [k for k, cell in enumerate(cells[:width]) if cell]
    if len(begins) < 2:
        return [1], [cells[begins[0]] if begins else "track"]
    return begins, [cells[k] for k in begins]


def _read_numbers(path: Path, rows: list[list[str]], header: list[str], first: int, mark: str) -> FloatArray:
    """(n, columns), NaN in empty cells."""
    numbers = np.full((len(rows), len(header)), np.nan)
    for i, cells in enumerate(rows):
        for k, cell in enumerate(cells[: len(header)]):
            if not cell:
                continue
            try:
                numbers[i, k] = read_number(cell, mark)
            except ValueError as trouble:
                if _read_column(header[k])[0] in {"t", "y", "pixely", "frame"}:
                    raise MeasurementError(path, header[k], f"line {first + i}: {trouble}") from None
    return numbers
