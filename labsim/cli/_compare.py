"""Two output folders, number by number. Pictures and pages are drawn from numbers that are compared, and are left out."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import LabsimError
from ..results import SAID
from ..text_files import load_json, load_toml
from ._provenance import KEY

# how long it took, where it lies, what was in the store: not results
NOT_RESULTS = {
    KEY,
    "wall_s",
    "wall",
    "runs_new",
    "runs_reused",
    "updates_per_s",
    "out",
    "store",
    "created",
    "peak_memory_bytes",
    "measured_new",
    "reused",
}
DRAWN = {".png", ".mp4", ".html", ".pvd"}
CHAIN = "chain.h5"  # the posterior's own working file


@dataclass
class Comparison:
    """differences : one line a place, empty where all is the same."""

    files: int = 0
    numbers: int = 0
    skipped: list[str] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)

    @property
    def same(self) -> bool:
        return not self.differences


def compare_folders(first: Path, second: Path, tolerance: float = 0.0) -> Comparison:
    """Every file of ``first`` with its namesake in ``second``; relative tolerance, 0 for bit by bit."""
    found = Comparison()
    names = {folder: _list(folder) for folder in (first, second)}
    for name in sorted(names[first] ^ names[second]):
        found.differences.append(f"{name}: only in {first if name in names[first] else second}")
    for name in sorted(names[first] & names[second]):
        if Path(name).suffix in DRAWN or Path(name).name == CHAIN:
            found.skipped.append(name)
            continue
        found.files += 1
        a, b = _read(first / name), _read(second / name)
        for key in sorted(set(a) ^ set(b)):
            found.differences.append(f"{name}: {key}: only in {first if key in a else second}")
        for key in sorted(set(a) & set(b)):
            found.numbers += int(np.size(a[key])) if isinstance(a[key], (int, float, list, np.ndarray)) else 0
            if difference := _differ(a[key], b[key], tolerance):
                found.differences.append(f"{name}: {key}: {difference}")
    return found


def _list(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".") and path.name != SAID  # words over these numbers
    }


def _read(path: Path) -> dict[str, Any]:
    """key -> number, text or array. Raises nothing: what cannot be read is its bytes."""
    try:
        if path.suffix == ".json":
            return dict(_flatten(load_json(path, LabsimError, "")))
        if path.suffix == ".toml":
            return dict(_flatten(load_toml(path, LabsimError, "")))
        if path.suffix == ".csv":
            return _read_table(path)
        if path.suffix in {".h5", ".nc"}:
            return _read_arrays(path)
    except (LabsimError, OSError, ValueError, KeyError, RuntimeError, RecursionError):
        pass
    return {"content": path.read_bytes()}


def _flatten(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, item in value.items():
            if name not in NOT_RESULTS:
                yield from _flatten(item, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for place, item in enumerate(value):
            yield from _flatten(item, f"{key}[{place}]")
    else:
        yield key, value


def _read_table(path: Path) -> dict[str, Any]:
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    return {
        f"{column} (column)": [row[place] if place < len(row) else "" for row in rows[1:]]
        for place, column in enumerate(rows[0] if rows else [])
    }


def _read_arrays(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iufb":
            found[name] = item[()]

    with h5py.File(path, "r") as stored:
        stored.visititems(visit)
    return found


def _differ(a: Any, b: Any, tolerance: float) -> str:
    """What differs, in words; empty where nothing does."""
    if isinstance(a, list):
        if len(a) != len(b):
            return f"{len(a)} rows, now {len(b)}"
        places = [
            k
            for k, pair in enumerate(zip(a, b, strict=True))
            if _differ(_number(pair[0]), _number(pair[1]), tolerance)
        ]
        return (
            f"{len(places)} of {len(a)} rows differ, first row {places[0] + 1}: {a[places[0]]}, now {b[places[0]]}"
            if places
            else ""
        )
    if isinstance(a, np.ndarray):
        if a.shape != np.shape(b):
            return f"shape {a.shape}, now {np.shape(b)}"
        if np.array_equal(a, b, equal_nan=a.dtype.kind == "f"):
            return ""
        if tolerance and np.allclose(a, b, rtol=tolerance, atol=0.0, equal_nan=True):
            return ""
        off = np.abs(np.asarray(a, float) - np.asarray(b, float))
        return f"{np.count_nonzero(off != 0)} of {a.size} values differ, at most by {np.nanmax(off):.3g}"
    if _is_number(a) and _is_number(b):
        same = a == b or (math.isnan(a) and math.isnan(b)) or abs(a - b) <= tolerance * max(abs(a), abs(b))
        return "" if same else f"{a!r}, now {b!r} (relative {abs(a - b) / max(abs(a), abs(b)):.2g})"
    if a == b:
        return ""
    return "differs" if isinstance(a, bytes) else f"{a!r}, now {b!r}"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text
