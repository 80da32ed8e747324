"""Recordings of enDAQ and Slam Stick sensors (``.ide``), read by idelib: ``pip install "labsim[ide]"``.

A file holds channels of one clock each, and subchannels in them, one an axis: 8.2 is the third of channel 8. The file states
unit, calibration and mostly the range. Nothing is taken off a mean: it is what a sensor feels, and where its zero is.
"""

from __future__ import annotations

import logging
import math
import re
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeasurementError
from ..records import Accelerometer, FloatArray
from . import UNITS, Readings

SUFFIXES = (".ide",)
MAGIC = b"\x1a\x45\xdf\xa3"  # of EBML
MOST_BYTES = 300_000_000
MOST_SAMPLES = 5_000_000  # of one sensor: four minutes at 20 kHz
MOST_ELEMENTS = 1_000_000
BLOCKS = ("ChannelDataBlock", "SimpleChannelDataBlock")
# as files write them: as drop.toml does
FILE_UNITS = {"g": "g", "m/s^2": "m/s^2", "m/s²": "m/s^2", "m/s2": "m/s^2"}
# idelib evaluates what stands here as Python: only a number or a ratio may
RATIO = re.compile(r"\s*\d+\.?\d*(e[+-]?\d{1,2})?\s*(/\s*\d+\.?\d*)?\s*", re.ASCII | re.IGNORECASE)
FORMAT = re.compile(r"[<>=]?[bBhHiIlLqQfd]{1,64}", re.ASCII)  # idelib allocates what stands here
NAMED_RANGE = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?) ?g\b")  # "X (100g)", "16g DC Acceleration"


def read(path: Path, accelerometer: Accelerometer) -> Readings:
    """Raises MeasurementError."""
    if accelerometer.time_column:
        raise MeasurementError(
            path,
            "record.time_column",
            f'is "{accelerometer.time_column}", but an .ide file has a clock of its own; remove the key',
        )
    try:
        with _quiet():
            import idelib.importer as importer
    except ImportError:
        raise MeasurementError(
            path, "record.file", 'needs idelib; install it with pip install "labsim[ide]"'
        ) from None
    content = _read_whole_elements(path)
    with _quiet():
        try:
            return _read(path, content, importer, accelerometer)
        except MeasurementError:
            raise
        except Exception as trouble:  # whatever idelib and ebmlite raise at a damaged file
            said = " ".join(f"{type(trouble).__name__}: {trouble}".split())[:200]
            raise MeasurementError(
                path,
                "record.file",
                f"is no recording that idelib reads ({said}); copy it from the sensor again",
            ) from None


@contextmanager
def _quiet() -> Iterator[None]:
    """idelib adds a handler to the root logger as it is imported, and warns of damage that labsim reports in its own words."""
    root, disabled = logging.getLogger(), logging.root.manager.disable
    nothing = logging.NullHandler()
    root.addHandler(nothing)
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)
        root.removeHandler(nothing)


def _read_whole_elements(path: Path) -> bytes:
    """The file up to its last whole element: idelib takes a block that was cut short for a whole one."""
    try:
        with path.open("rb") as stream:
            content = stream.read(MOST_BYTES + 1)
    except OSError as trouble:
        raise MeasurementError(
            path, "record.file", f"cannot be read ({trouble.strerror}); make it readable"
        ) from None
    if len(content) > MOST_BYTES:
        raise MeasurementError(
            path,
            "record.file",
            f"has more than {MOST_BYTES} bytes; cut it to the seconds about the impact",
        )
    if not content.startswith(MAGIC):
        what = "begins as no .ide file does" if content else "is empty"
        raise MeasurementError(path, "record.file", f"{what}; copy it from the sensor again")
    end = 0
    for _ in range(MOST_ELEMENTS):
        begin = _skip_number(content, end, 4)
        size = _skip_number(content, begin, 8) if begin else 0
        if not size:
            break
        length = int.from_bytes(content[begin:size], "big") & ((1 << 7 * (size - begin)) - 1)
        if size + length > len(content):
            break  # also where the length is unknown, which is all ones
        end = size + length
    return content[:end]


def _skip_number(content: bytes, at: int, most: int) -> int:
    """Where a number of EBML ends, whose leading zeros say how many bytes follow; 0 where there is none."""
    first = content[at] if at < len(content) else 0
    width = 9 - first.bit_length()
    return at + width if first and width <= most and at + width <= len(content) else 0


def _read(path: Path, content: bytes, importer: Any, accelerometer: Accelerometer) -> Readings:
    _check_header(path, content)
    document = importer.openFile(BytesIO(content), quiet=True)
    found = [_find(path, sensor.column, document) for sensor in accelerometer.sensors]
    chosen = [subchannel for subchannel, _ in found]
    channels = {subchannel.parent.id: subchannel.parent for subchannel in chosen}
    if len(channels) > 1:
        raise MeasurementError(
            path,
            "record.acceleration_column",
            f"names channels {' and '.join(map(str, channels))}, each with a clock of its own; name sensors of one channel",
        )
    if len({subchannel.id for subchannel in chosen}) < len(chosen):
        raise MeasurementError(
            path, "record.acceleration_column", "names a sensor twice; name each once, as 8.0 or by its name"
        )
    (channel,) = channels.values()
    stated = next(name for name, unit in UNITS.items() if unit == accelerometer.unit)
    for subchannel in chosen:
        if (unit := FILE_UNITS[subchannel.units[1]]) != stated:
            raise MeasurementError(
                path,
                "record.unit",
                f'is "{stated}", but {subchannel.name!r} is in {unit}; write "{unit}", and sigma, offset_sigma and range in it',
            )
    channel.singleSample = False  # idelib guesses it of the first block, and then reads one sample of each
    importer.readData(document)
    if document.fileDamaged:
        raise MeasurementError(
            path, "record.file", "is damaged between its blocks; copy it from the sensor again"
        )
    columns = [_read_subchannel(path, subchannel, document) for subchannel in chosen]
    values = [sign * column[1] * accelerometer.unit for (_, sign), column in zip(found, columns, strict=True)]
    ranges = tuple(_find_range(subchannel) * accelerometer.unit for subchannel in chosen)
    return Readings(1e-6 * columns[0][0], np.column_stack(values), ranges)


def _check_header(path: Path, content: bytes) -> None:
    """See that the file describes its channels, in words that idelib can be trusted with."""
    from idelib.dataset import SCHEMA_FILE, loadSchema

    described = False
    for element in loadSchema(SCHEMA_FILE).load(BytesIO(content)):
        if element.name in BLOCKS:
            break  # what describes channels stands before the samples
        if element.name != "RecordingProperties":
            continue
        for table in _list_tables(element.dump()):
            described |= "SensorID" in table
            for key, allowed in (("TimeCodeScale", RATIO), ("SampleRate", RATIO), ("ChannelFormat", FORMAT)):
                if key in table and allowed.fullmatch(text := str(table[key])) is None:
                    raise MeasurementError(
                        path,
                        key,
                        f"is {text[:40]!r} in the file, which is damaged; copy it from the sensor again",
                    )
    if not described:  # idelib would take it for a recorder of 2013, with a calibration of its own
        raise MeasurementError(
            path, "record.file", "does not describe its sensors; export it as a table and name its columns"
        )


def _list_tables(tree: Any) -> Iterator[dict[str, Any]]:
    """Every table of a header, at any depth."""
    if isinstance(tree, dict):
        yield tree
        tree = list(tree.values())
    if isinstance(tree, list):
        for each in tree:
            yield from _list_tables(each)


def _find(path: Path, column: str, document: Any) -> tuple[Any, float]:
    """The subchannel of a name or of an id such as 8.2, and its sign: a minus before either turns it."""
    everything = [each for channel in document.channels.values() for each in channel.children]
    felt = [each for each in everything if each.units[1] in FILE_UNITS]
    for name, sign in ((column, 1.0), (column.removeprefix("-").strip(), -1.0)):
        same = [each for each in felt if name in (each.name, f"{each.parent.id}.{each.id}")]
        if len(same) > 1:
            ids = " or ".join(f'"{each.parent.id}.{each.id}"' for each in same)
            raise MeasurementError(
                path,
                "record.acceleration_column",
                f"{column!r} is the name of {len(same)} sensors; write {ids}",
            )
        if same:
            return same[0], sign
    there = "; ".join(_describe(each) for each in felt or everything)
    what = "the accelerations are" if felt else "there are no accelerations, only"
    raise MeasurementError(
        path, "record.acceleration_column", f"{column!r} is no acceleration of the file; {what} {there[:400]}"
    )


def _describe(subchannel: Any) -> str:
    name, unit = (repr(str(text))[1:-1] for text in (subchannel.name, subchannel.units[1] or "?"))
    reach = _find_range(subchannel)
    size = f", to {reach:g} {unit}" if math.isfinite(reach) else ""
    return f'{subchannel.parent.id}.{subchannel.id} "{name}" in {unit}{size}'


def _find_range(subchannel: Any) -> float:
    """In the file's unit: the stated one, else that of the name, which is in g; inf where there is none."""
    if subchannel.hasDisplayRange:
        largest = float(subchannel.displayRange[1])
        if 0.0 < largest < 1e6:
            return largest
    if subchannel.units[1] == "g":
        for name in (subchannel.name, subchannel.parent.name):
            if (found := NAMED_RANGE.search(str(name))) is not None and float(found[1]) > 0.0:
                return float(found[1])
    return math.inf


def _read_subchannel(path: Path, subchannel: Any, document: Any) -> FloatArray:
    """Time (µs) and value in the file's unit, (2, n)."""
    key = f"channel {subchannel.parent.id}.{subchannel.id}"
    if not isinstance(subchannel.parent.parser, struct.Struct):
        raise MeasurementError(
            path, key, "is stored in a way of old firmware; export it as a table and name its columns"
        )
    for part in (subchannel.parent, subchannel):
        if part.transform is None and part.transformId is not None:  # idelib would give plain counts
            raise MeasurementError(
                path,
                key,
                f"has calibration {part.transformId}, which the file lacks; copy it from the sensor again",
            )
        needed = getattr(part.transform, "channelId", None)
        if needed is None or not (part.transform.coefficients[0] or part.transform.coefficients[2]):
            continue
        other = document.channels.get(needed)
        if other is None or not len(other.getSession()):  # idelib would calibrate as at zero degrees
            raise MeasurementError(
                path,
                key,
                f"is calibrated by channel {needed} (temperature), which has no samples in the file; name another sensor",
            )
    events = subchannel.getSession()
    events.removeMean = False
    count = len(events)
    if not 0 < count <= MOST_SAMPLES:
        raise MeasurementError(
            path,
            key,
            f"has {count} samples; keep the seconds about the impact"
            if count
            else "has no samples; name another sensor",
        )
    found: FloatArray = events.arraySlice()
    if found.shape != (2, count):
        raise MeasurementError(
            path, key, "has fewer samples than the file states; copy it from the sensor again"
        )
    return found
