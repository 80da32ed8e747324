"""The chain of pages of a TIFF file, walked before any reader follows it: a chain that leads back into itself has no end.

Source: TIFF 6.0 (Adobe, 1992), section 2; BigTIFF (8-byte offsets) as tifffile reads it.
"""

from __future__ import annotations

import struct
from pathlib import Path

from .errors import MeasurementError

MOST_PAGES = 1_000_000
LARGEST_PICTURE = 2**25  # pixels; a reduction holds some 60 bytes for each, 2 GB


def count_pages(path: Path) -> int:
    """Pages of a TIFF file, up to where it is cut off. Raises MeasurementError: no TIFF, or a chain without end."""
    seen: set[int] = set()
    try:
        with path.open("rb") as file:
            order = {b"II": "<", b"MM": ">"}.get(file.read(2), "")
            version = struct.unpack(order + "H", file.read(2))[0] if order else 0
            if version == 42:
                counter, pointer, entry, first = "H", "I", 12, 4
            elif version == 43:
                counter, pointer, entry, first = "Q", "Q", 20, 8
            else:
                raise MeasurementError(path, "", "is not a TIFF file; export this picture again")
            file.seek(first)
            offset = _read(file, order + pointer)
            while offset:
                if offset in seen:
                    raise MeasurementError(
                        path, "", f"page {len(seen)} leads back to an earlier one, without end; write the file again"
                    )  # fmt: skip
                if len(seen) >= MOST_PAGES:
                    raise MeasurementError(path, "", f"has more than {MOST_PAGES} pages; split the file")
                seen.add(offset)
                file.seek(offset)
                file.seek(offset + struct.calcsize(counter) + entry * _read(file, order + counter))
                offset = _read(file, order + pointer)
    except (struct.error, OSError, OverflowError, ValueError):
        if not seen:
            raise MeasurementError(
                path, "", "is cut off before its first page; copy the file again"
            ) from None
    return len(seen)


def check_size(path: object, key: str, height: int, width: int) -> None:
    """Refuse a picture that would fill the memory, before it is unpacked. Raises MeasurementError."""
    if height * width > LARGEST_PICTURE:
        raise MeasurementError(
            path, key, f"has pictures of {width} x {height} pixels, more than {LARGEST_PICTURE / 1e6:.0f} million; "
            "crop or bin them",
        )  # fmt: skip


def _read(file, kind: str) -> int:
    return int(struct.unpack(kind, file.read(struct.calcsize(kind)))[0])
