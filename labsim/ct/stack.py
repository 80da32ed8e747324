"""A stack of horizontal slices that is read one slice at a time, top slice first."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import MeasurementError

KEPT_IN_MEMORY = 256 * 2**20  # bytes; larger stacks are read again for every pass over them


@dataclass
class SliceStack:
    """Slices of one scan. ``read(k)`` gives slice k as stored, (ny, nx); ``slice`` and iteration keep small stacks.

    voxel : m, where the files themselves state it; facts : what the files say about themselves.
    """

    source: Path
    count: int
    shape: tuple[int, int]
    dtype: np.dtype
    read: Callable[[int], npt.NDArray]
    voxel: float | None = None
    facts: dict = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    flipped: bool = False
    _kept: dict[int, npt.NDArray] = field(default_factory=dict, repr=False)

    @property
    def bytes(self) -> int:
        return self.count * self.shape[0] * self.shape[1] * self.dtype.itemsize

    def slice(self, k: int) -> npt.NDArray:
        if k in self._kept:
            return self._kept[k]
        image = np.asarray(self.read(self.count - 1 - k if self.flipped else k))
        if image.shape != self.shape:
            raise MeasurementError(
                self.source,
                f"slice {k}",
                f"is {image.shape[1]} x {image.shape[0]} pixels, the first one {self.shape[1]} x {self.shape[0]}; "
                "export all slices with one size",
            )
        if self.bytes <= KEPT_IN_MEMORY:
            self._kept[k] = image
        return image

    def __iter__(self) -> Iterator[npt.NDArray]:
        return (self.slice(k) for k in range(self.count))


def list_formats() -> list[str]:
    """Names of the files in ``formats``, each one format."""
    from . import formats

    return sorted(info.name for info in pkgutil.iter_modules(formats.__path__))


def open_stack(path: Path | str) -> SliceStack:
    """Open a folder of slices or a file that holds them; the first format that recognises it reads it.

    Raises MeasurementError where nothing recognises it, slices are missing or their sizes differ.
    """
    path = Path(path)
    if not path.exists():
        raise MeasurementError(path, "scan.slices", "does not exist; name the folder or file of the slices")
    names = list_formats()
    for name in names:
        module = importlib.import_module(f"{__package__}.formats.{name}")
        if module.recognise(path):
            return module.open_stack(path)
    raise MeasurementError(
        path,
        "scan.slices",
        f"holds no slices in a known format ({', '.join(names)}); export 8- or 16-bit TIFF",
    )
