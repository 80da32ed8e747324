"""A folder of TIFF, PNG or BMP pictures in natural order; gaps in their numbers are dropped frames."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import tifffile
from PIL import Image

from ...errors import MeasurementError
from ..frames import Frames
from .tiff import make_grey

NAME = "folders of TIFF, PNG or BMP pictures"
SUFFIXES = {".tif", ".tiff", ".png", ".bmp"}


def recognises(path: Path) -> bool:
    return path.is_dir()


def open_file(path: Path) -> Frames:
    found = Counter(p.suffix.lower() for p in path.iterdir() if p.suffix.lower() in SUFFIXES)
    if not found:
        raise MeasurementError(
            path, "video", "holds no TIFF, PNG or BMP picture; export the frames as one of these"
        )
    suffix = found.most_common(1)[0][0]
    files = [p for p in path.iterdir() if p.suffix.lower() == suffix]
    numbers = [_last_number(p) for p in files]
    warnings = []
    if len(found) > 1:
        warnings.append(f"several picture formats in one folder: only *{suffix} is read")
    if all(n is not None for n in numbers) and len(set(numbers)) == len(numbers):
        order = sorted(range(len(files)), key=lambda i: numbers[i] or 0)
        index = np.array([numbers[i] for i in order])
        index -= index[0]
    else:
        order = sorted(range(len(files)), key=lambda i: _natural(files[i].name))
        index = np.arange(len(files))
    files = [files[i] for i in order]
    gaps = np.diff(index) - 1
    if np.any(gaps > 0):
        warnings.append(
            f"{int(gaps.sum())} frames dropped (gaps in the file numbers, first after {files[int(np.argmax(gaps > 0))].name})"
        )
    first = read_picture(files[0])
    return Frames(
        path=path,
        start=lambda: _read(files),
        count=len(files),
        shape=first.shape,
        bits=8 * first.dtype.itemsize,
        numbers=index,
        codec=suffix[1:],
        warnings=warnings,
    )


def read_picture(path: Path) -> np.ndarray:
    """One grey picture, uint8 or uint16. Raises MeasurementError."""
    try:
        if path.suffix.lower() in {".tif", ".tiff"}:
            try:
                return make_grey(tifffile.imread(path), path)
            except ValueError:  # a compression that tifffile leaves to a package of its own
                pass
        content = np.fromfile(path, np.uint8)
        if path.suffix.lower() == ".png":
            with Image.open(io.BytesIO(content.tobytes())) as picture_file:
                picture_file.verify()  # its checksums: libpng has words of its own for a damaged one
        picture = cv2.imdecode(content, cv2.IMREAD_ANYDEPTH | cv2.IMREAD_GRAYSCALE)
    except MeasurementError:
        raise
    except Exception as trouble:
        raise MeasurementError(path, "picture", f"cannot be read ({str(trouble).splitlines()[:1]})") from None
    if picture is None:
        raise MeasurementError(path, "picture", "cannot be read; export it again")
    return make_grey(picture, path)


def _read(files: list[Path]) -> Iterator[np.ndarray]:
    for file in files:
        yield read_picture(file)


def _last_number(path: Path) -> int | None:
    digits = re.findall(r"\d+", path.stem)
    return int(digits[-1]) if digits else None


def _natural(name: str) -> list[object]:
    return [int(part) if part.isdigit() else part.lower() for part in re.split(r"(\d+)", name)]
