"""Pictures in, an MP4 out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from ..errors import MeasurementError


def write_movie(pictures: Iterable[npt.NDArray[np.uint8]], path: Path, rate: float = 20.0) -> Path:
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
