"""Phantom .cine: uncompressed 8- and 16-bit pictures with a time stamp each.

Layout (little endian) as found in files of cameras from 2008 and 2013: header of 44 bytes ('CI', compression at 4,
count at 20, offsets of image header, setup and image table at 24, 28, 32, trigger time at 36), setup marked 'ST' at
+140 with its length at +142 and the frame rate at +768, then tagged blocks (u32 size, u16 type, u16 -) up to the image
table: 1002 = u64 times, upper 32 bits seconds, lower 32 the fraction; 1003 = u32 exposures in 2^-32 s.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import MeasurementError
from ..frames import Frames

NAME = "Phantom .cine (uncompressed)"


def recognises(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() == ".cine"


def open_file(path: Path) -> Frames:
    try:
        return _open_file(path)
    except (struct.error, IndexError, OverflowError, ValueError) as trouble:
        raise MeasurementError(path, "video", f"is a damaged .cine file ({trouble}); save it again") from None


def _open_file(path: Path) -> Frames:
    size = path.stat().st_size
    with open(path, "rb") as file:
        head = file.read(44)
        mark, _, compression, _ = struct.unpack_from("<2sHHH", head)
        if mark != b"CI":
            raise MeasurementError(path, "video", "is no .cine file (its first bytes are not CI)")
        if compression != 0:
            raise MeasurementError(
                path, "video", f"compression {compression} is not read; save it as uncompressed grey"
            )
        count, image_at, setup_at, table_at = struct.unpack_from("<IIII", head, 20)
        if not (0 < count <= size // 8 and max(image_at, setup_at, table_at) < size):
            raise MeasurementError(
                path, "video", f"is truncated or damaged (says {count} frames in {size} bytes)"
            )
        file.seek(image_at)
        _, width, height, _, depth, packing, image_size = struct.unpack("<IiiHHII", file.read(24))
        if depth not in (8, 16) or packing != 0:
            raise MeasurementError(
                path,
                "video",
                f"stores {depth} bit, packing {packing}; save it as uncompressed 8 or 16 bit grey",
            )
        if not (0 < width <= 1 << 15 and 0 < height <= 1 << 15) or width * height * depth // 8 != image_size:
            raise MeasurementError(
                path, "video", f"has pictures of {width} × {height} in {image_size} bytes: damaged"
            )
        file.seek(setup_at)
        setup = file.read(min(max(table_at - setup_at, 0), 1 << 16))
        if setup[140:142] != b"ST":
            raise MeasurementError(path, "video", "has no setup block (mark ST missing): damaged or too old")
        length = struct.unpack_from("<H", setup, 142)[0]
        rate = float(struct.unpack_from("<I", setup, 768)[0])
        real_bits = struct.unpack_from("<I", setup, 896)[0] if len(setup) > 900 else depth
        stamps, exposure = _read_tags(file, setup_at + length, table_at, count)
        file.seek(table_at)
        # what lies beyond the file's end is not there, however far
        offsets = np.minimum(np.frombuffer(file.read(8 * count), "<u8"), size)
        if len(offsets) < count:
            raise MeasurementError(path, "video", "is truncated inside its image table")
    inside = int(np.sum(offsets.astype(float) + image_size <= size))
    warnings = []
    header_rate = rate
    if stamps is not None and count > 2:
        quantum = 1.0e-6
        even = np.polyfit(np.arange(count), stamps, 1)
        measured = 1.0 / even[0] if even[0] > 0 else np.nan
        if not np.all(np.diff(stamps) > 0):
            warnings.append("time stamps do not grow; the header's frame rate is used")
            stamps = None
        else:
            if abs(measured / rate - 1.0) > 0.01:
                warnings.append(
                    f"header says {rate:.0f} frames per second, the stamps {measured:.1f}: the stamps are used"
                )
            header_rate = measured
            straight = np.polyval(even, np.arange(count))
            if np.max(np.abs(straight - stamps)) <= quantum:
                stamps = straight  # the stamps are an even clock read to one microsecond
            stamps = stamps - stamps[0]
    return Frames(
        path=path,
        start=lambda: _read(path, offsets, (height, width), depth, image_size),
        count=count,
        shape=(height, width),
        bits=int(real_bits) if 8 <= real_bits <= 16 else depth,
        numbers=np.arange(count),
        stamps=stamps,
        exposure=exposure,
        header_rate=header_rate,
        codec="cine",
        warnings=warnings
        + ([f"truncated: pictures of {inside} of {count} frames are there"] if inside < count else []),
    )


def _read_tags(file, start: int, end: int, count: int) -> tuple[np.ndarray | None, float]:
    """Times (s, since the first second) and the exposure (s) from the tagged blocks."""
    stamps, exposure, at = None, 0.0, start
    while at + 8 <= end:
        file.seek(at)
        size, kind = struct.unpack("<IH", file.read(6))
        if size < 8 or at + size > end:
            break
        file.seek(at + 8)
        if kind == 1002 and size >= 8 + 8 * count:
            raw = np.frombuffer(file.read(8 * count), "<u8")
            seconds = (raw >> np.uint64(32)).astype(np.int64)
            stamps = (seconds - seconds[0]) + (raw & np.uint64(0xFFFFFFFF)).astype(float) / 2.0**32
        elif kind == 1003 and size >= 8 + 4 * count:
            exposure = float(np.median(np.frombuffer(file.read(4 * count), "<u4"))) / 2.0**32
        at += size
    return stamps, exposure


def _read(
    path: Path, offsets: np.ndarray, shape: tuple[int, int], depth: int, image_size: int
) -> Iterator[np.ndarray]:
    with open(path, "rb") as file:
        for offset in offsets:
            file.seek(int(offset))
            head = file.read(4)
            if len(head) < 4:
                return
            file.seek(int(offset) + struct.unpack("<I", head)[0])
            raw = file.read(image_size)
            if len(raw) < image_size:
                return
            picture = np.frombuffer(raw, np.uint8 if depth == 8 else "<u2").reshape(shape)
            yield np.ascontiguousarray(picture[::-1])  # stored from the bottom row up
