"""One TIFF file with a page a slice."""

from __future__ import annotations

from pathlib import Path

import tifffile

from ...errors import MeasurementError
from ..stack import SliceStack


def recognise(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in (".tif", ".tiff")


def open_stack(path: Path) -> SliceStack:
    """Open the pages of a TIFF file as slices. Raises MeasurementError."""
    try:
        with tifffile.TiffFile(path) as tiff:
            series = tiff.series[0]
            shape, dtype, pages = series.shape, series.dtype, len(tiff.pages)
    except Exception as trouble:
        raise MeasurementError(path, "scan.slices", f"is not a readable TIFF ({trouble})") from None
    if len(shape) != 3 or shape[0] < 8:
        raise MeasurementError(
            path, "scan.slices", f"holds an array of shape {shape}; 8 or more grey pages are needed"
        )
    if pages == shape[0]:
        return SliceStack(
            path, shape[0], shape[1:], dtype, lambda k: tifffile.imread(path, key=k), facts={"format": "tiff"}
        )
    volume = tifffile.memmap(path, mode="r")  # ImageJ's contiguous stacks have one page for all slices
    return SliceStack(path, shape[0], shape[1:], dtype, lambda k: volume[k], facts={"format": "tiff"})
