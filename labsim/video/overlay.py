"""The track drawn on the frames, for a look: an MP4 and a contact sheet of six frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np

from ..errors import MeasurementError
from ..records import Track
from .frames import Frames

GREEN, RED, BLUE, YELLOW = (80, 220, 60), (60, 60, 230), (230, 150, 40), (40, 210, 240)  # blue, green, red
LONGEST_MOVIE = 1500


def write_overlay(
    frames: Frames, track: Track, column: np.ndarray, surface_row: float | None, path: Path
) -> Path:
    """Write the frames with tip and surface as an MP4 (slow motion, 15 pictures a second). Raises MeasurementError."""
    every = max(1, len(track.frame) // LONGEST_MOVIE)
    drawn = _draw(frames, track, column, surface_row, _zoom(frames.shape))
    return write_movie((picture for i, picture in drawn if i % every == 0), path, 15.0)


def write_movie(pictures: Iterable[np.ndarray], path: Path, rate: float = 20.0) -> Path:
    """Write RGB pictures, (rows, columns, 3) uint8 and all of one size, as an MP4. Raises MeasurementError."""
    movie = None
    for picture in pictures:
        rows, columns = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2  # the codec wants even sizes
        if movie is None:
            movie = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate, (columns, rows))
            if not movie.isOpened():
                raise MeasurementError(path, "movie", "cannot be written: OpenCV has no MP4 encoder here")
        movie.write(np.ascontiguousarray(picture[:rows, :columns, ::-1]))
    if movie is not None:
        movie.release()
    return path


def draw_contact_sheet(
    frames: Frames, track: Track, column: np.ndarray, surface_row: float | None, moments: list[int]
) -> list[np.ndarray]:
    """The frames at ``moments`` (indices) with the track on them, (rows, columns, 3) uint8 RGB each."""
    wanted = set(moments)
    drawn = {}
    for i, picture in _draw(frames, track, column, surface_row, _zoom(frames.shape), wanted):
        drawn[i] = picture.copy()
    return [drawn[i] for i in moments if i in drawn]


def encode_picture(picture: np.ndarray, top: float) -> bytes:
    """One picture as PNG, grey levels without loss up to ``top``, which becomes nearly white."""
    done, content = cv2.imencode(".png", _brighten(picture, top), [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return content.tobytes()


def find_top(picture: np.ndarray) -> float:
    """Grey level of a picture's brightest parts, single pixels left out."""
    return max(float(np.percentile(picture, 99.5)), 1.0)


def _brighten(picture: np.ndarray, top: float) -> np.ndarray:
    return np.clip(picture.astype(np.float32) * (235.0 / top), 0, 255).astype(np.uint8)


def _zoom(shape: tuple[int, int]) -> int:
    return max(1, min(3, 700 // max(shape)))


def _draw(
    frames: Frames,
    track: Track,
    column: np.ndarray,
    surface_row: float | None,
    zoom: int,
    wanted: set[int] | None = None,
) -> Iterator[tuple[int, np.ndarray]]:
    """Index and RGB picture of each frame that is wanted."""
    top = None
    middle = float(np.nanmedian(column)) if np.isfinite(column).any() else frames.shape[1] / 2
    for i, picture in enumerate(frames):
        if i >= len(track.frame):
            return
        if wanted is not None and i not in wanted:
            continue
        if top is None:
            top = find_top(picture)
        large = cv2.resize(_brighten(picture, top), None, fx=zoom, fy=zoom, interpolation=cv2.INTER_NEAREST)
        image = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)

        def at(value: float) -> int:
            return round((value + 0.5) * zoom)

        if surface_row is not None:
            cv2.line(image, (0, at(surface_row)), (image.shape[1], at(surface_row)), BLUE, 1)
        if track.valid[i]:
            x, y = at(float(column[i])) if np.isfinite(column[i]) else at(middle), at(float(track.tip_row[i]))
            cv2.line(image, (x - 12 * zoom, y), (x + 12 * zoom, y), GREEN, 1)
            cv2.line(image, (x, y - 6 * zoom), (x, y + 6 * zoom), GREEN, 1)
            label, colour = f"{int(track.frame[i])}", GREEN
        else:
            label, colour = f"{int(track.frame[i])} rejected", RED
        cv2.putText(image, label, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(image, label, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
        yield i, image[..., ::-1]
