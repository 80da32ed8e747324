"""The lines of a text table, read within bounds."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import LabsimError, MeasurementError
from ..records import FloatArray

# a record of more frames than this is none of a drop (1 s at 1 MHz); its table would take minutes and gigabytes to fit
MOST_FRAMES = 1_000_000
MOST_BYTES = 150 * MOST_FRAMES  # labsim's own lines have some 60
LONGEST_LINE = 10_000  # characters; a longer one is no line of a table
MARKS = ("\t", ";", ",")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def read_lines(path: Path, most: int | None = None) -> list[tuple[int, str]]:
    """(number, text) of every line that is not blank, the ``most`` first of them. Raises MeasurementError."""
    try:
        size = path.stat().st_size
        if size > MOST_BYTES and most is None:
            raise _too_large(path, f"{size} bytes")
        with path.open("rb") as stream:
            content = stream.read(MOST_BYTES if most is None else most * LONGEST_LINE)
    except OSError as trouble:
        raise MeasurementError(
            path, "track", f"cannot be read ({trouble.strerror}); make it readable"
        ) from None
    if most is None and content.count(b"\n") + content.count(b"\r") > 2 * MOST_FRAMES:
        raise _too_large(path, "millions of lines")
    found = []
    for number, text in enumerate(_decode(content).splitlines(), start=1):
        if len(text) > LONGEST_LINE:
            raise MeasurementError(
                path,
                "track",
                f"line {number} is longer than {LONGEST_LINE} characters; that is no line of a table",
            )
        if text := text.strip("\0").rstrip():
            found.append((number, text.lstrip(" ")))
        if most is not None and len(found) >= most:
            break
    if len(found) > MOST_FRAMES:
        raise _too_large(path, f"{len(found)} lines")
    return found


def _too_large(path: Path, what: str) -> MeasurementError:
    return MeasurementError(
        path,
        "track",
        f"has {what}; a record of a drop has at most {MOST_FRAMES} frames: keep those about the impact",
    )


def _decode(content: bytes) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:  # a spreadsheet on Windows
        return content.decode("cp1252", errors="replace")


def find_mark(line: str) -> str:
    """What separates the cells of a line: tab, semicolon, comma, or blanks."""
    return next((mark for mark in MARKS if mark in line), " ")


def split_line(line: str, mark: str) -> list[str]:
    """Cells without quotes and blanks about them; a # before the first is left out."""
    line = line.lstrip("#")
    cells = line.split() if mark == " " else line.split(mark)
    return [cell.strip(" \"\t\r'") for cell in cells]


def read_number(cell: str, mark: str) -> float:
    """A cell's number, with a decimal comma where commas do not separate; NaN where it is empty or says so.

    Raises ValueError where it is anything else.
    """
    text = cell if mark == "," else cell.replace(",", ".")
    if not text or text.lower() == "nan":
        return math.nan
    if NUMBER.fullmatch(text) is None or not math.isfinite(number := float(text)):
        raise ValueError(f"{cell[:40]!r} is not a number; correct or remove it")
    return number


def read_named_columns(path: Path, names: Sequence[str]) -> tuple[list[int], FloatArray]:
    """Numbers of the lines below the heading, and what stands in the named columns, (lines, names), NaN where there is nothing.

    Raises MeasurementError.
    """
    try:
        lines = read_lines(path)
    except LabsimError as trouble:
        raise MeasurementError(path, "record.file", trouble.message) from None
    if len(lines) < 2:
        raise MeasurementError(path, "record.file", "holds no table; export it with its heading")
    mark = find_mark(lines[0][1])
    heading = split_line(lines[0][1], mark)
    for name in names:
        if (count := heading.count(name)) != 1:
            raise MeasurementError(
                path,
                f"line {lines[0][0]}",
                f"has {count or 'no'} column{'s' * (count > 1)} {name!r}; "
                f"the columns are {', '.join(heading)[:200]}",
            )
    places = [heading.index(name) for name in names]
    rows = np.full((len(lines) - 1, len(names)), math.nan)
    for row, (number, text) in zip(rows, lines[1:], strict=True):
        cells = split_line(text, mark)
        try:
            row[:] = [read_number(cells[k], mark) if k < len(cells) else math.nan for k in places]
        except ValueError as trouble:
            raise MeasurementError(path, f"line {number}", str(trouble)) from None
    return [number for number, _ in lines[1:]], rows
