"""A folder of TIFF, PNG or BMP slices with numbered names, with or without a SkyScan/NRecon ``_rec.log``."""

from __future__ import annotations

import math
import re
from collections import Counter
from pathlib import Path

import numpy as np
import tifffile
from PIL import Image

from ...errors import LabsimError, MeasurementError
from ...tiff_pages import check_size, count_pages
from ..slices.skyscan import check_log, find_log, read_log
from ..slices.stack import SliceStack

SUFFIXES = (".tif", ".tiff", ".png", ".bmp")


def recognises(path: Path) -> bool:
    return path.is_dir() and any(item.suffix.lower() in SUFFIXES for item in path.iterdir())


def open_stack(path: Path) -> SliceStack:
    """Open the numbered images of a folder in the order of their numbers. Raises MeasurementError."""
    files = _list_slices(path)
    first = read_image(files[0])
    facts: dict = {"format": files[0].suffix.lower().lstrip("."), **read_rescale(files[0])}
    voxel, warnings = None, []
    log_path = find_log(path)
    if log_path is not None:
        log = read_log(log_path)
        warnings += check_log(log, len(files), first.shape, first.dtype)
        voxel = log.voxel
        facts["log"] = log.sections
        facts["slice_spacing"] = log.slice_spacing
    return SliceStack(
        path, len(files), first.shape, first.dtype, lambda k: read_image(files[k]), voxel, facts, warnings,
        names=[file.name for file in files], packed=sum(file.stat().st_size for file in files),
    )  # fmt: skip


def read_image(file: Path) -> np.ndarray:
    """One grey slice, (ny, nx). Raises MeasurementError for colour and for files that cannot be read."""
    if file.stat().st_size == 0:
        raise MeasurementError(file, "", "is empty (0 bytes); export this slice again")
    try:
        if file.suffix.lower() in (".tif", ".tiff"):
            count_pages(file)
            with tifffile.TiffFile(file) as tiff:
                series = tiff.series[0]
                check_size(file, "", math.prod(series.shape[:-1]), series.shape[-1])
                image = series.asarray()
        else:
            with Image.open(file) as picture:
                check_size(file, "", picture.height, picture.width)
                image = np.asarray(picture.convert("L") if picture.mode == "P" else picture)
    except LabsimError:
        raise
    except Exception as trouble:
        text = (str(trouble).splitlines() or [type(trouble).__name__])[0][:120]
        raise MeasurementError(
            file, "", f"cannot be read as an image ({text}); export this slice again"
        ) from None
    if image.ndim == 3 and image.shape[2] in (3, 4) and (image[..., :1] == image[..., :3]).all():
        image = image[..., 0]
    if image.ndim != 2 or image.dtype.kind not in "uif":
        raise MeasurementError(
            file, "", f"is not a grey image (shape {image.shape}, {image.dtype}); export 8- or 16-bit grey"
        )
    return image


def read_rescale(file: Path) -> dict:
    """Slope and offset of grey -> attenuation where a TIFF states them in its description."""
    if file.suffix.lower() not in (".tif", ".tiff"):
        return {}
    with tifffile.TiffFile(file) as tiff:
        text = tiff.pages.first.description
    found = {}
    for name in ("slope", "offset"):
        match = re.search(
            rf"{name}[^-+0-9.]+([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)(?![0-9.])", text, re.IGNORECASE
        )
        if match:
            found[name] = float(match.group(1))
    return found if len(found) == 2 else {}


def _list_slices(folder: Path) -> list[Path]:
    images = [
        item for item in folder.iterdir() if item.suffix.lower() in SUFFIXES and not item.name.startswith(".")
    ]
    suffix = Counter(item.suffix.lower() for item in images).most_common(1)[0][0]
    numbered: dict[str, list[tuple[int, Path]]] = {}
    for item in images:
        match = re.search(r"^(.*?)(\d+)$", item.stem)
        if match and item.suffix.lower() == suffix:  # other names are previews, such as NRecon's _spr.bmp
            numbered.setdefault(match.group(1), []).append((int(match.group(2)), item))
    if len(images) == 1:
        raise MeasurementError(
            folder, "scan.slices",
            f"holds one image only; where its pages are the slices, name the file itself: {folder.name}/{images[0].name}",
        )  # fmt: skip
    if not numbered:
        raise MeasurementError(
            folder, "scan.slices", "no image has a number at the end of its name; number the slices"
        )
    longest = max(len(series) for series in numbered.values())
    slices = sorted(next(series for series in numbered.values() if len(series) == longest))
    if len(slices) < 8:
        raise MeasurementError(folder, "scan.slices", f"only {len(slices)} slices; a scan needs 8 or more")
    numbers = np.array([number for number, _ in slices])
    steps = np.diff(numbers)
    step = int(Counter(steps.tolist()).most_common(1)[0][0])
    if step < 1 or (steps != step).any():
        at = int(np.flatnonzero(steps != step)[0])
        raise MeasurementError(
            folder,
            "scan.slices",
            f"slices are missing or doubled between {slices[at][1].name} and {slices[at + 1][1].name}; "
            "put the missing ones back",
        )
    return [item for _, item in slices]
