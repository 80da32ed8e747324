"""Projects of OSP Tracker, .trk (XML) and .trz (the same, zipped).

As Tracker 5 and 6 write them: <object class="….TrackerPanel"> with a property "tracks" that lists objects; those of class
….PointMass hold "name" and "framedata", an array whose elements "[n]" are frames of the video (not steps of the clip) with x
and y in pixels of the picture, y downwards, whatever axes and scale the user has drawn. Frames without a mark have no element.
"""

from __future__ import annotations

import re
import struct
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from ..errors import MeasurementError
from . import Points

NAME = "OSP Tracker projects (.trk, .trz)"
LARGEST = 200_000_000  # bytes of XML; a project of an hour's video has a few


# all that zipfile lets through where bytes of an archive are changed or missing
DAMAGED_ZIP = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    LookupError,
    OSError,
    RuntimeError,
    ValueError,
)


def recognises(path: Path) -> bool:
    return path.suffix.lower() in {".trk", ".trz"}


def read_points(path: Path) -> dict[str, Points]:
    """Every point mass of a project by its name. Raises MeasurementError."""
    root = _parse(path, _unzip(path) if path.suffix.lower() == ".trz" else path.read_bytes())
    if not root.get("class", "").endswith(".TrackerPanel"):
        raise MeasurementError(
            path, "track", f'holds {root.get("class") or root.tag}, no project; in Tracker use "Save Tab As"'
        )
    found: dict[str, Points] = {}
    for item in root.findall("./property[@name='tracks']/property/object"):
        if not item.get("class", "").endswith(".PointMass"):
            continue
        name = (item.findtext("./property[@name='name']") or "mass").strip()
        frames = item.findall("./property[@name='framedata']/property")
        marked = [_read_mark(path, name, each) for each in frames if each.find("object") is not None]
        if marked:
            frame, row = np.array(marked, dtype=float).T
            found[name if name not in found else f"{name} ({len(found) + 1})"] = Points(frame=frame, row=row)
    return found


def _read_mark(path: Path, name: str, element: Element) -> tuple[float, float]:
    place = re.fullmatch(r"\[(\d+)\]", element.get("name", ""))
    text = element.findtext("./object/property[@name='y']")
    if place is None or text is None:
        raise MeasurementError(path, name, f"frame {element.get('name')} has no y; mark it again and save")
    try:
        return float(place[1]), float(text)
    except ValueError:
        raise MeasurementError(
            path, name, f"frame {place[1]}: y = {text!r} is not a number; mark the frame again and save"
        ) from None


def _parse(path: Path, content: bytes) -> Element:
    """The tree of a file that was handed over by somebody: no entities, nothing fetched, no bomb."""

    def refuse(*_: object) -> None:
        raise MeasurementError(
            path, "track", "declares XML entities, which Tracker never writes; save it again"
        )

    if len(content) > LARGEST:
        raise MeasurementError(
            path, "track", f"has {len(content)} bytes; a Tracker project has a few million"
        )
    builder, parser = TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
        return builder.close()
    except (expat.ExpatError, AssertionError, ValueError, LookupError) as trouble:
        raise MeasurementError(path, "track", f"is no XML ({trouble}); save it again in Tracker") from None


def _unzip(path: Path) -> bytes:
    try:
        with zipfile.ZipFile(BytesIO(path.read_bytes())) as archive:
            projects = [entry for entry in archive.infolist() if entry.filename.lower().endswith(".trk")]
            if len(projects) != 1:
                raise MeasurementError(
                    path, "track", f"holds {len(projects)} .trk files; unzip it and name one"
                )
            if projects[0].file_size > LARGEST:
                raise MeasurementError(
                    path, "track", f"unpacks to {projects[0].file_size} bytes; that is no project"
                )
            return archive.read(projects[0])
    except DAMAGED_ZIP as trouble:
        raise MeasurementError(
            path, "track", f"is no zip file ({trouble}); save it again in Tracker"
        ) from None
