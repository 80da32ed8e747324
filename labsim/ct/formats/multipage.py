"""One TIFF file with a page a slice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tifffile

from ...errors import MeasurementError
from ...tiff_pages import count_pages
from ..slices.stack import SliceStack


def recognises(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in (".tif", ".tiff")


def open_stack(path: Path) -> SliceStack:
    """Open the pages of a TIFF file as slices. Raises MeasurementError."""
    pages = count_pages(path)
    try:
        with tifffile.TiffFile(path) as tiff:
            series = tiff.series[0]
            shape, dtype = series.shape, series.dtype
    except Exception as trouble:
        raise MeasurementError(path, "scan.slices", f"is not a readable TIFF ({trouble})") from None
    if len(shape) != 3 or shape[0] < 8 or dtype.kind not in "uif":
        raise MeasurementError(
            path, "scan.slices", f"holds an array of shape {shape}, {dtype}; 8 or more grey pages are needed"
        )
    packed, facts = path.stat().st_size, {"format": "tiff"}
    if pages == shape[0]:
        return SliceStack(
            path, shape[0], shape[1:], dtype, lambda k: _read_page(path, k), facts=facts, packed=packed
        )
    try:
        volume = tifffile.memmap(path, mode="r")  # ImageJ's contiguous stacks have one page for all slices
    except ValueError as trouble:
        raise MeasurementError(
            path, "scan.slices", f"has {pages} pages for {shape[0]} slices ({trouble}); write a page a slice"
        ) from None
    return SliceStack(path, shape[0], shape[1:], dtype, lambda k: volume[k], facts=facts, packed=packed)


def _read_page(path: Path, k: int) -> np.ndarray:
    with tifffile.TiffFile(path) as tiff:
        return tiff.pages[k].asarray()
