"""A stack of horizontal slices that is read one slice at a time, top slice first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

from ...errors import LabsimError, MeasurementError
from ...extensions import list_modules
from ...tiff_pages import check_size

KEPT_IN_MEMORY = 256 * 2**20  # bytes; larger stacks are read again for every pass over them
MOST_PACKED = 100.0  # slices with noise in them shrink two to ten times; what shrinks more is no scan


@dataclass
class SliceStack:
    """Slices of one scan. ``read(k)`` gives slice k as stored, (ny, nx); ``slice`` and iteration keep small stacks.

    names : of the slices as stored, for messages; packed : bytes on the disk; voxel : m, where the files themselves state
    it; facts : what the files say about themselves.
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
    names: Sequence[str] | None = None
    packed: int = 0
    _kept: dict[int, npt.NDArray] = field(default_factory=dict, repr=False)

    @property
    def bytes(self) -> int:
        return self.count * self.shape[0] * self.shape[1] * self.dtype.itemsize

    def name(self, k: int) -> str:
        """What the user calls slice k, counted from the top: its file, or its number in the file from 0."""
        stored = self.count - 1 - k if self.flipped else k
        return self.names[stored] if self.names is not None else f"slice {stored}"

    def slice(self, k: int) -> npt.NDArray:
        """Slice k, counted from the top, (ny, nx). Raises MeasurementError that names it."""
        if k in self._kept:
            return self._kept[k]
        try:
            image = np.asarray(self.read(self.count - 1 - k if self.flipped else k))
        except LabsimError:
            raise
        except Exception as trouble:  # the readers raise many kinds on damaged files
            raise MeasurementError(
                self.source, self.name(k), f"cannot be read ({_first_line(trouble)}); export it again"
            ) from None
        if image.dtype.kind == "f" and not np.isfinite(image).all():
            raise MeasurementError(
                self.source,
                self.name(k),
                "holds values that are not finite (NaN or infinite); export this slice again",
            )
        if image.shape != self.shape:
            raise MeasurementError(
                self.source,
                self.name(k),
                f"is {image.shape[1]} x {image.shape[0]} pixels, the first one {self.shape[1]} x {self.shape[0]}; "
                "export all slices with one size",
            )
        if self.bytes <= KEPT_IN_MEMORY:
            self._kept[k] = image
        return image

    def __iter__(self) -> Iterator[npt.NDArray]:
        return (self.slice(k) for k in range(self.count))


def list_formats() -> dict[str, ModuleType]:
    """Modules of ``labsim/ct/formats`` and of other packages by name, each one format."""
    return list_modules("labsim.ct.formats", "labsim.ct_formats")


def open_stack(path: Path | str) -> SliceStack:
    """Open a folder of slices or a file that holds them; the first format that recognises it reads it.

    Raises MeasurementError where nothing recognises it, slices are missing or their sizes differ.
    """
    path = Path(path)
    if not path.exists():
        raise MeasurementError(path, "scan.slices", "does not exist; name the folder or file of the slices")
    modules = list_formats()
    for module in modules.values():
        if module.recognises(path):
            stack: SliceStack = module.open_stack(path)
            check_size(path, "scan.slices", *stack.shape)
            if stack.packed and stack.bytes > max(KEPT_IN_MEMORY, MOST_PACKED * stack.packed):
                raise MeasurementError(
                    path,
                    "scan.slices",
                    f"{stack.packed / 1e6:.1f} MB would unpack to {stack.bytes / 1e9:.1f} GB, more than slices with noise in "
                    "them can; export them again",
                )
            return stack
    raise MeasurementError(
        path,
        "scan.slices",
        f"holds no slices in a known format ({', '.join(modules)}); export 8- or 16-bit TIFF",
    )


def _first_line(trouble: Exception) -> str:
    return (str(trouble).splitlines() or [type(trouble).__name__])[0][:120]
