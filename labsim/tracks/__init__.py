"""Tracks of other programs, read as rows of the projectile's tip: one file a format.

Input: a file that another tracking program wrote. Output: TrackRows, in frames and pixels. Every module in this folder is a
format and has NAME, ``recognises(path) -> bool`` and ``read_points(path) -> {name: Points}``; the folder is listed, so a new
format is one new file (docs/extend.md). labsim's own ``frame,tip_row_px`` is read in ``video.track_file``.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from ..errors import MeasurementError
from ..records import Camera, FloatArray

OFF_FRAME = 0.2  # frames by which a time may miss the nearest frame of the stated rate


@dataclass(frozen=True)
class Points:
    """One tracked point as its file has it, arrays of shape (n,), None where the file says nothing.

    frame : number in the video; time : s; row : px, growing downwards; height : m above the undisturbed surface; sigma : px.
    Either frame or time and either row or height must be there.
    """

    frame: FloatArray | None = None
    time: FloatArray | None = None
    row: FloatArray | None = None
    height: FloatArray | None = None
    sigma: FloatArray | None = None


@dataclass(frozen=True)
class TrackRows:
    """The one track that was asked for. frame : (n,) int, growing; row, sigma : (n,) px, sigma NaN where not given."""

    name: str
    frame: np.ndarray
    row: FloatArray
    sigma: FloatArray


def list_formats() -> dict[str, ModuleType]:
    """Modules of this folder by name."""
    names = sorted(info.name for info in pkgutil.iter_modules(__path__))
    return {name: importlib.import_module(f".{name}", __package__) for name in names}


def find_format(path: Path | str) -> ModuleType | None:
    """The module that reads this file; None where no other program's format is recognised."""
    path = Path(path)
    if not path.is_file():
        return None
    return next((module for module in list_formats().values() if module.recognises(path)), None)


def read_rows(path: Path | str, camera: Camera) -> TrackRows:
    """Read one track; of several in a file, the one that has the name of the file's folder (drops/D01 takes "D01").

    camera : its frame rate places times on frames; its pixel size (m) and surface row place heights on rows.
    Raises MeasurementError, which names file, column and remedy.
    """
    path = Path(path)
    module = find_format(path)
    if module is None:
        known = "; ".join(each.NAME for each in list_formats().values())
        raise MeasurementError(
            path, "track", f"is of no known format; labsim reads frame,tip_row_px and {known}"
        )
    found = module.read_points(path)
    name = _choose(path, list(found))
    points = found[name]
    frame, row = _place_frames(path, points, camera.frame_rate), _place_rows(path, points, camera)
    seen = np.isfinite(frame) & np.isfinite(row)
    if not seen.any():
        raise MeasurementError(path, name, "holds no position; mark the projectile in at least 12 frames")
    sigma = points.sigma if points.sigma is not None else np.full(row.shape, np.nan)
    whole = np.round(frame[seen]).astype(np.int64)
    order = np.argsort(whole, kind="stable")
    whole = whole[order]
    if np.any(np.diff(whole) == 0):
        twice = int(whole[1:][np.diff(whole) == 0][0])
        raise MeasurementError(
            path, "frame", f"{twice} has two positions in {name}; keep one track of one point"
        )
    return TrackRows(name, whole, row[seen][order], sigma[seen][order])


def _choose(path: Path, names: list[str]) -> str:
    if not names:
        raise MeasurementError(path, "track", "holds no tracked point; track the projectile and save again")
    if len(names) == 1:
        return names[0]
    wanted = path.resolve().parent.name
    if wanted in names:
        return wanted
    shown = ", ".join(names[:6]) + (", …" if len(names) > 6 else "")
    raise MeasurementError(
        path, "track", f"holds {len(names)} tracks ({shown}); keep one, or name it {wanted} like its folder"
    )


def _place_frames(path: Path, points: Points, rate: float) -> FloatArray:
    if points.frame is not None:
        finite = points.frame[np.isfinite(points.frame)]
        if np.any(finite != np.round(finite)):
            bad = finite[finite != np.round(finite)][0]
            raise MeasurementError(path, "frame", f"{bad:g} is no whole number; give the number of the frame")
        return points.frame
    if points.time is None:
        raise MeasurementError(path, "frame", "is missing, and so is a time; export the column frame too")
    place = points.time * rate
    finite = place[np.isfinite(place)]
    off = np.abs(finite - np.round(finite))
    if off.size and off.max() > OFF_FRAME:
        at = points.time[np.isfinite(place)][np.argmax(off)]
        raise MeasurementError(
            path,
            "t",
            f"{at:g} s falls between frames at {rate:g} Hz; export the column frame too, or correct the frame rate",
        )
    if finite.size > 1 and np.any(np.diff(np.sort(np.round(finite))) == 0):
        raise MeasurementError(
            path, "t", f"has several positions in one frame of {rate:g} Hz; correct the frame rate"
        )
    return np.round(place)


def _place_rows(path: Path, points: Points, camera: Camera) -> FloatArray:
    if points.row is not None:
        return points.row
    if points.height is None:
        raise MeasurementError(path, "y", "is missing; export the column pixely (rows in the picture)")
    if not (np.isfinite(camera.surface_row) and 0 < camera.pixel_size < 0.1):
        raise MeasurementError(
            path, "y", "is a height: pixel size and surface row must be known to place it on rows; state both"
        )
    return camera.surface_row - points.height / camera.pixel_size
