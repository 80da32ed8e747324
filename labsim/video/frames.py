"""A video as the tracker sees it: grey pictures one after the other, with what the camera says about time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType

import numpy as np

from ..errors import MeasurementError
from ..extensions import list_modules
from ..records import FloatArray

MAX_KEPT_BYTES = 120_000_000


@dataclass
class Frames:
    """Pictures of a video, read when they are asked for, (rows, columns) of uint8 or uint16, row 0 at the top.

    start : begins to read at the first picture and yields one after the other.
    count : pictures the file says it has; a truncated file may give fewer.
    numbers : (count,) int, the camera's own frame numbers, with gaps where frames were dropped.
    stamps : (count,) s, the camera's own time of each picture, or None.
    header_rate : Hz, what the header says; for slow-motion clips this is the play-back rate.
    lossy : whether the codec throws information away; quality : 1-100 where it is known.
    """

    path: Path
    start: Callable[[], Iterator[np.ndarray]]
    count: int
    shape: tuple[int, int]
    bits: int
    numbers: np.ndarray
    stamps: FloatArray | None = None
    exposure: float = 0.0  # s
    header_rate: float | None = None
    lossy: bool = False
    codec: str = ""
    warnings: list[str] = field(default_factory=list)
    _kept: list[np.ndarray] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[np.ndarray]:
        if self._kept is not None:
            yield from self._kept
            return
        size = self.shape[0] * self.shape[1] * (1 if self.bits <= 8 else 2)
        keep: list[np.ndarray] | None = [] if size * self.count <= MAX_KEPT_BYTES else None
        seen = 0
        for picture in self.start():
            if picture.shape != self.shape:
                raise MeasurementError(
                    self.path,
                    f"frame {seen}",
                    f"is {picture.shape}, the first is {self.shape}; use one picture size",
                )
            seen += 1
            if keep is not None:
                keep.append(picture)
            yield picture
        if seen < self.count:
            self.warnings.append(f"truncated: {seen} of {self.count} frames can be read")
            self.count, self.numbers = seen, self.numbers[:seen]
            self.stamps = None if self.stamps is None else self.stamps[:seen]
        self._kept = keep

    def section(self, first: int, last: int) -> Frames:
        """Only the pictures first to last (counted from 0, both included); their frame numbers stay."""
        last = min(last, self.count - 1)
        if not 0 <= first <= last:
            raise MeasurementError(self.path, "--frames", f"{first}-{last} is not inside 0-{self.count - 1}")
        start = self.start
        return replace(
            self,
            start=lambda: itertools.islice(start(), first, last + 1),
            count=last + 1 - first,
            numbers=self.numbers[first : last + 1],
            stamps=None if self.stamps is None else self.stamps[first : last + 1],
            warnings=list(self.warnings),
            _kept=None,
        )

    def cut(self, region: tuple[int, int, int, int]) -> Frames:
        """Only the columns left to right and the rows top to bottom of every picture (px, both ends included)."""
        left, top, right, bottom = region
        height, width = self.shape
        if not (0 <= left < right < width and 0 <= top < bottom < height):
            raise MeasurementError(
                self.path,
                "record.region_px",
                f"[{left}, {top}, {right}, {bottom}] is not inside the picture; columns go to {width - 1}, rows to {height - 1}",
            )
        start = self.start
        return replace(
            self,
            start=lambda: (np.ascontiguousarray(p[top : bottom + 1, left : right + 1]) for p in start()),
            shape=(bottom + 1 - top, right + 1 - left),
            warnings=list(self.warnings),
            _kept=None,
        )

    def turned(self, degrees: int) -> Frames:
        """The same video turned anticlockwise by 90, 180 or 270 degrees."""
        if degrees % 360 == 0:
            return self
        if degrees % 90:
            raise MeasurementError(
                self.path, "--rotate", f"{degrees} is no multiple of 90; small angles are fitted"
            )
        turns = degrees // 90
        shape = self.shape[::-1] if turns % 2 else self.shape
        start = self.start
        return replace(
            self,
            start=lambda: (np.ascontiguousarray(np.rot90(p, turns)) for p in start()),
            shape=shape,
            _kept=None,
        )


def list_formats() -> dict[str, ModuleType]:
    """Modules of ``labsim/video/formats`` and of other packages by name; each has NAME, ``recognises(path)`` and
    ``open_file(path)``."""
    return list_modules("labsim.video.formats", "labsim.video_formats")


def open_frames(path: Path | str) -> Frames:
    """Open a video file or a folder of pictures by its name and contents. Raises MeasurementError."""
    path = Path(path)
    if not path.exists():
        raise MeasurementError(path, "video", "does not exist; name a video file or a folder of pictures")
    if path.is_file() and path.stat().st_size == 0:
        raise MeasurementError(path, "video", "is empty (0 bytes); copy or record it again")
    formats = list_formats()
    for module in formats.values():
        if module.recognises(path):
            frames: Frames = module.open_file(path)
            if frames.count < 1:
                raise MeasurementError(path, "video", "holds no frame; record or export it again")
            return frames
    known = "; ".join(module.NAME for module in formats.values())
    raise MeasurementError(path, "video", f"is of no known format; labsim reads {known}")
