"""Track files, read as rows of the projectile's tip: one file a format, one reader for every command.

Input: a table, or a file that a tracking program wrote. Output: TrackRows, in frames, seconds and pixels. Every module in this
folder that has ``recognises(path) -> bool`` is a format, with NAME and ``read_points(path) -> {name: Points}``; the folder is
listed, so a new format is one new file (docs/extend-measuring.md). ``table`` reads labsim's own ``track.csv`` and is asked last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from types import ModuleType

import numpy as np

from ..errors import MeasurementError
from ..extensions import list_modules
from ..records import Camera, FloatArray

OFF_FRAME = 0.2  # frames by which a time may miss the nearest frame of the stated rate


@dataclass(frozen=True)
class Points:
    """One tracked point as its file has it, arrays of shape (n,), None where the file says nothing.

    frame : number in the video; time : s; where both are there the time is the camera's own; row : px, growing downwards;
    height : m above the undisturbed surface; sigma : px; height_sigma : m. NaN where a frame has no position.
    Either frame or time and either row or height must be there.
    """

    frame: FloatArray | None = None
    time: FloatArray | None = None
    row: FloatArray | None = None
    height: FloatArray | None = None
    sigma: FloatArray | None = None
    height_sigma: FloatArray | None = None

    def take(self, places: np.ndarray) -> Points:
        """Only the lines ``places``, in that order."""
        columns = {each.name: getattr(self, each.name) for each in fields(self)}
        return Points(
            **{name: None if column is None else column[places] for name, column in columns.items()}
        )

    def split(self, names: Sequence[str]) -> dict[str, Points]:
        """By the particle that each line belongs to; a number has one name, however it is written."""
        labels = np.array([_name_particle(name) for name in names])
        return {str(name): self.take(np.flatnonzero(labels == name)) for name in dict.fromkeys(labels)}


@dataclass(frozen=True)
class TrackRows:
    """The one track that was asked for. frame : (n,) int, growing; time : (n,) s; row, sigma : (n,) px, NaN where there is no
    position, sigma NaN where not given."""

    name: str
    frame: np.ndarray
    time: FloatArray
    row: FloatArray
    sigma: FloatArray
    warnings: tuple[str, ...] = ()


def list_formats() -> dict[str, ModuleType]:
    """Modules that are formats, of this folder and of other packages, by name; the general one last."""
    found = list_modules(__name__, "labsim.track_formats")
    formats = [name for name in found if hasattr(found[name], "recognises")]
    return {name: found[name] for name in sorted(formats, key=lambda name: hasattr(found[name], "GENERAL"))}


def find_format(path: Path | str) -> ModuleType | None:
    """The module that reads this file; None where no format is recognised."""
    path = Path(path)
    if not path.is_file():
        return None
    return next((module for module in list_formats().values() if module.recognises(path)), None)


def read_rows(path: Path | str, camera: Camera) -> TrackRows:
    """Read one track; of several in a file, the one that has the name of the file's folder (drops/D01 takes "D01").

    camera : its frame rate places times on frames; its pixel size (m) and surface row place heights on rows.
    Raises MeasurementError, which names file, column and remedy.
    """
    return place_points(path, *read_points(path), camera)


def read_points(
    path: Path | str, particle: str | None = None, columns: Mapping[str, str] | None = None
) -> tuple[str, Points]:
    """Name and points of the one track that is wanted, as the file has them.

    particle : of several tracks the one of this name; columns : what the columns of a table are (``labsim.tracks.table``).
    Raises MeasurementError.
    """
    path = Path(path)
    if not path.is_file():
        said = "is no plain file; name" if path.exists() else "does not exist; name"
        raise MeasurementError(
            path, "track", f"{said} a table of frame,tip_row_px or a file of a tracking program"
        )
    module = find_format(path)
    if module is None:
        known = "; ".join(each.NAME for each in list_formats().values())
        raise MeasurementError(path, "track", f"is of no known format; labsim reads {known}")
    if columns and not hasattr(module, "GENERAL"):
        raise MeasurementError(path, "--columns", f"is not for {module.NAME}; leave it out")
    found = module.read_points(path, columns) if columns else module.read_points(path)
    name = _choose(path, list(found), particle)
    points = found[name]
    position = points.row if points.row is not None else points.height
    if position is None:
        raise MeasurementError(path, "y", "is missing; export the column pixely (rows in the picture)")
    if points.frame is None and points.time is None:
        raise MeasurementError(path, "frame", "is missing, and so is a time; export the column frame too")
    if not np.isfinite(position).any():
        raise MeasurementError(path, name, "holds no position; mark the projectile in at least 12 frames")
    return name, points


def place_points(path: Path | str, name: str, points: Points, camera: Camera) -> TrackRows:
    """Points on the frames and rows of a camera. Its frame rate may be NaN where the points have times, its scale where they have
    rows. Raises MeasurementError."""
    path = Path(path)
    frame, row = _place_frames(path, points, camera.frame_rate), _place_rows(path, points, camera)
    sigma = np.full(row.shape, np.nan) if points.sigma is None else points.sigma
    if points.row is None and points.height_sigma is not None:
        sigma = points.height_sigma / camera.pixel_size
    seen = np.flatnonzero(np.isfinite(frame))
    order = seen[np.argsort(frame[seen], kind="stable")]
    whole = frame[order].astype(np.int64)
    if np.any(np.diff(whole) == 0):
        twice = int(whole[1:][np.diff(whole) == 0][0])
        raise MeasurementError(
            path, "frame", f"{twice} has two positions in {name}; keep one track of one point"
        )
    own = points.time[order] if points.time is not None else np.full(whole.shape, np.nan)
    if points.frame is None and np.isfinite(camera.frame_rate):
        own = np.full(whole.shape, np.nan)  # written times are rounded; the frame that they fall on is exact
    time = np.where(np.isfinite(own), own, whole / camera.frame_rate)
    if np.any(np.diff(time) <= 0):
        line = int(whole[1:][np.diff(time) <= 0][0])
        raise MeasurementError(path, "time", f"does not grow at frame {line}; correct or remove the column")
    return TrackRows(
        name, whole, time, row[order], sigma[order], _compare_clocks(whole, own, camera.frame_rate)
    )


def _compare_clocks(frame: np.ndarray, own: FloatArray, rate: float) -> tuple[str, ...]:
    """One line where the file's own times and the stated rate part by a frame or more over the record."""
    known = np.flatnonzero(np.isfinite(own))
    if len(known) < 2 or not np.isfinite(rate):
        return ()
    frames, seconds = np.ptp(frame[known]), np.ptp(own[known])
    if abs(seconds * rate - frames) < 1.0:
        return ()
    return (
        f"the file's own times make {frames / seconds:.6g} frames a second, {rate:.6g} are stated: the times are used; correct "
        "the rate, or remove the column if they are those of a replay",
    )


def _name_particle(text: str) -> str:
    try:
        return f"{float(text):g}"
    except ValueError:
        return text or "particle"


def _choose(path: Path, names: list[str], particle: str | None) -> str:
    if not names:
        raise MeasurementError(path, "track", "holds no tracked point; track the projectile and save again")
    shown = ", ".join(names[:6]) + (", …" if len(names) > 6 else "")
    if particle is not None:
        if particle not in names:
            raise MeasurementError(
                path, "--particle", f"{particle!r} is not among its tracks; name one of {shown}"
            )
        return particle
    if len(names) == 1:
        return names[0]
    wanted = path.resolve().parent.name
    if wanted in names:
        return wanted
    example = f'"{names[0]}"' if " " in names[0] else names[0]
    raise MeasurementError(
        path,
        "track",
        f"holds {len(names)} tracks ({shown}); choose one with --particle {example} (labsim track)",
    )


def _place_frames(path: Path, points: Points, rate: float) -> FloatArray:
    if points.frame is not None:
        finite = points.frame[np.isfinite(points.frame)]
        if np.any(finite != np.round(finite)):
            bad = finite[finite != np.round(finite)][0]
            raise MeasurementError(path, "frame", f"{bad:g} is no whole number; give the number of the frame")
        if np.any(np.abs(finite) > 2**53):
            raise MeasurementError(path, "frame", "is beyond 2^53; count frames 0, 1, 2 …")
        return points.frame
    assert points.time is not None
    if not np.isfinite(rate):
        return _count_frames(points.time)
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


def _count_frames(time: FloatArray) -> FloatArray:
    """Frames of times without a rate, 0 the first: the usual step is one frame, longer ones are gaps."""
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else 1.0
    if not usual > 0:
        return np.arange(len(time), dtype=float)
    return np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / usual), 1.0))])


def _place_rows(path: Path, points: Points, camera: Camera) -> FloatArray:
    if points.row is not None:
        return points.row
    assert points.height is not None
    if not (np.isfinite(camera.surface_row) and 0 < camera.pixel_size < 0.1):
        raise MeasurementError(
            path, "y", "is a height: pixel size and surface row must be known to place it on rows; state both"
        )
    seen = points.height[np.isfinite(points.height)]
    if seen[-1] > seen[0]:
        raise MeasurementError(
            path,
            "y",
            f"goes up by {1e3 * (seen[-1] - seen[0]):.3g} mm: heights count upwards from the undisturbed surface, depths "
            "downwards; name the column as what it is, or correct its sign",
        )
    return camera.surface_row - points.height / camera.pixel_size
