"""Tables with a line of column names: labsim's own ``track.csv``, spreadsheets, trackpy's data frames.

Separated by tab, semicolon, comma or blanks; decimal commas where the separator is another. Columns are known by their names,
whatever their case, with a unit behind: ``frame,tip_row_px``, ``Frame,Y``, ``t (ms);z (mm)``, ``time_ms,depth_mm``. What is
named otherwise is mapped, as ``frame=Bild,row=Zeile`` or ``time_ms=t,depth_mm=z``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray
from . import Points
from .lines import NUMBER, find_mark, read_lines, split_line

NAME = "tables (CSV) of frame or time, and row, depth or height"
GENERAL = True  # asked after all other formats
SUFFIXES = {".csv", ".txt", ".tsv", ".dat"}
SHOWN = "write frame,tip_row_px, or name them to labsim track: --columns frame=COLUMN,row=COLUMN"

# what a column is -> names that say so, without case, blanks and underscores; the first of each is labsim's own
NAMES = {
    "frame": ("frame", "frames", "framenumber", "frameno", "framenr"),
    "time": ("time", "t"),
    "row": ("tiprow", "row", "y"),
    "depth": ("depth", "z", "penetrationdepth"),
    "height": ("height", "h"),
    "sigma": ("sigma", "ep", "depthsigma", "heightsigma", "zsigma"),
    "particle": ("particle", "track"),
}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6}
PIXELS = {"px": 1.0, "pixel": 1.0, "pixels": 1.0}
# units that a column may have; a row, and what has no other, is in pixels
UNITS = {
    "frame": {},
    "time": TIMES,
    "row": PIXELS,
    "depth": LENGTHS,
    "height": LENGTHS,
    "sigma": {**PIXELS, **LENGTHS},
    "particle": {},
}
UNIT = "|".join(sorted({**TIMES, **LENGTHS, **PIXELS}, key=len, reverse=True))
HEADING = re.compile(
    rf"(?P<name>.*?[^\s_/(\[])(?:(?:\s+in\s+|[\s_/(\[]+)(?P<unit>{UNIT})\s*[)\]]?)?", re.IGNORECASE
)


def recognises(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES


def read_points(path: Path, columns: Mapping[str, str] | None = None) -> dict[str, Points]:
    """Every particle by its name; "track" where there is no such column. ``columns`` : frame, time, row, depth, height, sigma or
    particle, with ``_UNIT`` behind where the header says none -> name of the column. Raises MeasurementError."""
    lines = read_lines(path)
    at, mark = _find_header(path, lines)
    header = split_line(lines[at][1], mark)
    places = _map_columns(path, header, columns) if columns else _know_columns(path, header)
    body = [(number, split_line(text, mark)) for number, text in lines[at + 1 :] if text[0] != "#"]
    if not body:
        raise MeasurementError(path, "", "the track is empty; it needs one row per frame")
    found = {
        kind: _read_numbers(path, body, header, place, mark) * scale
        for kind, (place, scale) in places.items()
        if kind != "particle"
    }
    for kind in ("frame", "time"):
        if (
            kind in found
            and not np.all(np.isfinite(found[kind]))
            and (kind == "frame" or "frame" not in found)
        ):
            line = body[int(np.argmin(np.isfinite(found[kind])))][0]
            raise MeasurementError(path, header[places[kind][0]], f"line {line} is empty; number every frame")
    lengths = "row" not in found
    sigma = found.get("sigma")
    if sigma is not None:
        sigma = np.where(sigma > 0, sigma, np.nan)
        stated = _unit_of(header[places["sigma"][0]], "sigma", columns)
        if (stated in LENGTHS) != lengths:
            raise MeasurementError(
                path,
                header[places["sigma"][0]],
                f"is in {stated or 'px'}, the positions are {'lengths' if lengths else 'in px'}; write both alike",
            )
    height = found.get("height", -found["depth"] if "depth" in found else None)
    whole = Points(
        frame=found.get("frame"),
        time=found.get("time"),
        row=found.get("row"),
        height=height if lengths else None,
        sigma=None if lengths else sigma,
        height_sigma=sigma if lengths else None,
    )
    if "particle" in places:
        place = places["particle"][0]
        return whole.split([cells[place] if place < len(cells) else "" for _, cells in body])
    _check_order(path, header, places, whole, [number for number, _ in body])
    return {"track": whole}


def read_mapping(text: str) -> dict[str, str]:
    """``frame=Frame,row=Y`` as a mapping. Raises ValueError with what is wrong."""
    found = {}
    for part in text.split(","):
        key, equals, column = (piece.strip() for piece in part.partition("="))
        if not (equals and key and column):
            raise ValueError(f"{part.strip()!r} is no KEY=COLUMN; write frame=COLUMN,row=COLUMN")
        _read_key(key)
        found[key] = column
    return found


def _read_key(key: str) -> tuple[str, str | None]:
    """("time", "ms") of "time_ms". Raises ValueError."""
    kind, _, unit = key.partition("_")
    if kind not in UNITS or (unit and unit not in UNITS[kind]):
        known = ", ".join(UNITS)
        raise ValueError(f"{key!r} is not known; the keys are {known}, a unit behind as time_ms, depth_mm")
    return kind, unit or None


def _find_header(path: Path, lines: list[tuple[int, str]]) -> tuple[int, str]:
    """Index of the line of column names, and what separates them: the first line that is no comment, or, where that holds
    numbers, the comment before it (numpy writes so)."""
    at = next((k for k, (_, text) in enumerate(lines) if text[0] != "#"), None)
    if at is None:
        raise MeasurementError(path, "", "holds no column; the first line must be frame,tip_row_px")
    if any(
        NUMBER.fullmatch(cell.replace(",", ".")) for cell in split_line(lines[at][1], find_mark(lines[at][1]))
    ):
        if at == 0 or not set(_guess(split_line(lines[at - 1][1], find_mark(lines[at - 1][1])))) & set(NAMES):
            raise MeasurementError(path, "", "has no header line; write frame,tip_row_px above the numbers")
        at -= 1
    return at, find_mark(lines[at][1])


def _guess(header: list[str]) -> dict[str, list[int]]:
    """What the names of the columns say: kind -> places."""
    found: dict[str, list[int]] = {}
    for place, cell in enumerate(header):
        name = _split_heading(cell)[0]
        for kind, names in NAMES.items():
            if name in names:
                found.setdefault(kind, []).append(place)
    return found


def _split_heading(cell: str) -> tuple[str, str | None]:
    """("tiprow", "px") of "tip_row_px"; the unit None where there is none."""
    match = HEADING.fullmatch(cell)
    if match is None:
        return cell.lower(), None
    name = re.sub(r"[\W_]+", "", match["name"].lower())
    unit = match["unit"]
    return name, unit if unit is None or unit in {**TIMES, **LENGTHS, **PIXELS} else unit.lower()


def _know_columns(path: Path, header: list[str]) -> dict[str, tuple[int, float]]:
    """kind -> place and scale to SI (or px), from the names alone."""
    found = _guess(header)
    if "row" in found:  # pixels are what was measured; lengths and heights beside them were made of them
        found = {kind: places for kind, places in found.items() if kind not in ("depth", "height")}
    chosen = {}
    for kind, places in found.items():
        own = [place for place in places if _split_heading(header[place])[0] == NAMES[kind][0]]
        if len(own or places) > 1 and kind != "sigma":
            names = " and ".join(header[place] for place in (own or places))
            raise MeasurementError(
                path, "columns", f"{names} may both be the {kind}; say which: --columns {kind}=…"
            )
        chosen[kind] = (own or places)[0]
    shown = ", ".join(cell[:40] for cell in header[:8]) + (", …" if len(header) > 8 else "")
    for wanted in (("frame", "time"), ("row", "depth", "height")):
        if not any(kind in chosen for kind in wanted):
            raise MeasurementError(
                path,
                wanted[0] if wanted[0] == "frame" else "tip_row_px",
                f"no such column among {shown}; {SHOWN}",
            )
    if "depth" in chosen and "height" in chosen:
        raise MeasurementError(
            path, "columns", "depth and height are both there; say which: --columns depth=…"
        )
    return {kind: (place, _scale(path, header[place], kind, None)) for kind, place in chosen.items()}


def _map_columns(path: Path, header: list[str], columns: Mapping[str, str]) -> dict[str, tuple[int, float]]:
    """The same where the user says what the columns are; what is not said is known by its name."""
    chosen: dict[str, tuple[int, float]] = {}
    for key, name in columns.items():
        try:
            kind, unit = _read_key(key)
        except ValueError as trouble:
            raise MeasurementError(path, "--columns", str(trouble)) from None
        same = [k for k, cell in enumerate(header) if cell == name] or [
            k for k, cell in enumerate(header) if cell.lower() == name.lower()
        ]
        if len(same) != 1:
            number = "no column" if not same else f"{len(same)} columns"
            raise MeasurementError(
                path, "--columns", f"{number} {name!r} among {', '.join(header[:8])}; name one that is there"
            )
        chosen[kind] = (same[0], _scale(path, header[same[0]], kind, unit))
    taken = {place for place, _ in chosen.values()}
    position, moment = {"row", "depth", "height"}, {"frame", "time"}
    rest = {
        kind: places
        for kind, places in _guess(header).items()
        if kind not in chosen
        and places[0] not in taken
        and not (kind in position and position & set(chosen))
        and not (kind in moment and moment & set(chosen))
        and kind != "sigma"
    }
    for kind, places in rest.items():
        chosen[kind] = (places[0], _scale(path, header[places[0]], kind, None))
    if len(position & set(chosen)) != 1 or not moment & set(chosen):
        raise MeasurementError(
            path,
            "--columns",
            "names no position or no time; give frame or time, and one of row, depth, height",
        )
    return chosen


def _unit_of(cell: str, kind: str, columns: Mapping[str, str] | None) -> str | None:
    stated = [_read_key(key)[1] for key in columns or {} if _read_key(key)[0] == kind]
    return (stated[0] if stated else None) or _split_heading(cell)[1]


def _scale(path: Path, cell: str, kind: str, stated: str | None) -> float:
    """From the column's unit to s, m or px; ``stated`` wins over the header's."""
    units = UNITS[kind]
    unit = stated or _split_heading(cell)[1]
    if not units or (unit is None and "px" in units):
        return 1.0
    if unit is None:
        example = "time_ms" if units is TIMES else f"{kind}_mm"
        raise MeasurementError(
            path, cell, f"has no unit; write {example} in the header, or --columns {example}={cell}"
        )
    if unit not in units:
        remedy = (
            f"--columns depth_{unit}={cell} or height_{unit}={cell}"
            if kind == "row"
            else f"use {', '.join(units)}"
        )
        raise MeasurementError(path, cell, f"a {kind} is not in {unit}; {remedy}")
    return units[unit]


def _read_numbers(
    path: Path, body: list[tuple[int, list[str]]], header: list[str], place: int, mark: str
) -> FloatArray:
    """(n,), NaN in empty cells."""
    numbers = np.full(len(body), np.nan)
    for k, (line, cells) in enumerate(body):
        cell = cells[place] if place < len(cells) else ""
        if not cell:
            continue
        text = cell if mark == "," else cell.replace(",", ".")
        if NUMBER.fullmatch(text) is None or not np.isfinite(float(text)):
            finite = (
                text.lower().lstrip("+-") in {"nan", "inf", "infinity"} or NUMBER.fullmatch(text) is not None
            )
            what = f"{cell[:40]} is not finite" if finite else f"{cell[:40]!r} is not a number"
            raise MeasurementError(
                path,
                header[place],
                f"line {line}: {what}; correct it, or leave it empty where there is no position",
            )
        numbers[k] = float(text)
    return numbers


def _check_order(
    path: Path, header: list[str], places: dict[str, tuple[int, float]], points: Points, lines: list[int]
) -> None:
    """One track is written in the order in which it was recorded: frames or times that do not grow are a mistake."""
    kind = "frame" if "frame" in places else "time"
    values = points.frame if kind == "frame" else points.time
    assert values is not None
    back = np.flatnonzero(np.diff(values) <= 0)
    if back.size:
        first, second = values[back[0]], values[back[0] + 1]
        what = f"{second:g} has two positions" if first == second else f"{second:g} does not follow {first:g}"
        raise MeasurementError(
            path,
            header[places[kind][0]],
            f"line {lines[back[0] + 1]}: {what}; write the {kind}s of one track in their order, each once",
        )
