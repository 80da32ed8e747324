"""Multipage TIFF, 8 to 16 bit, through tifffile."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import tifffile

from ...errors import MeasurementError
from ...tiff_pages import check_size, count_pages
from ..frames import Frames

NAME = "multipage TIFF"
logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # damage is reported by labsim, in its own words


def recognises(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in {".tif", ".tiff"}


def open_file(path: Path) -> Frames:
    count_pages(path)  # a chain without end is refused before tifffile follows it
    try:
        with tifffile.TiffFile(path) as file:
            count = len(file.pages)
            check_size(path, "video", *file.pages[0].shape[:2])
            first = make_grey(file.pages[0].asarray(), path)
    except MeasurementError:
        raise
    except Exception as trouble:  # tifffile raises many kinds on damaged files
        raise MeasurementError(
            path, "video", f"is no TIFF that can be read ({_first_line(trouble)})"
        ) from None
    return Frames(
        path=path,
        start=lambda: _read(path),
        count=count,
        shape=first.shape,
        bits=8 * first.dtype.itemsize,
        numbers=np.arange(count),
        codec="tiff",
    )


def _read(path: Path) -> Iterator[np.ndarray]:
    with tifffile.TiffFile(path) as file:
        try:
            for page in file.pages:
                yield make_grey(page.asarray(), path)
        except MeasurementError:
            raise
        except Exception:  # a truncated file: what was readable has been given
            return


def make_grey(picture: np.ndarray, path: Path) -> np.ndarray:
    """uint8 or uint16, two dimensions; the mean of colour channels. Raises MeasurementError for other kinds."""
    if picture.ndim == 3 and picture.shape[2] in (2, 3, 4):
        colours = picture[..., : 3 if picture.shape[2] >= 3 else 1]
        picture = np.round(colours.mean(axis=2)).astype(picture.dtype)
    if picture.ndim == 3:
        raise MeasurementError(
            path,
            "video",
            f"holds {picture.shape[0]} pictures in one file; name the file itself, not its folder",
        )
    if picture.ndim != 2:
        raise MeasurementError(path, "video", f"has pictures of shape {picture.shape}; export grey pictures")
    if picture.dtype == np.bool_:
        picture = picture.astype(np.uint8) * 255
    if picture.dtype not in (np.uint8, np.uint16):
        raise MeasurementError(
            path, "video", f"has pixels of type {picture.dtype}; export 8- or 16-bit whole numbers"
        )
    return picture


def _first_line(trouble: Exception) -> str:
    return (str(trouble).splitlines() or [type(trouble).__name__])[0][:120]
