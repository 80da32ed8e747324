"""Profiles of a SnowMicroPen (``.pnt``): force of the tip, one number a step of the motor.

Big-endian: float32 at byte 6 is the step (mm), float32 at 10 the force of a count (N), int32 at 358 the number of counts, which
are int16 from byte 512 on. Schneebeli & Johnson (1998), Ann. Glaciol. 26, 107. Depth counts from where the motor started:
``surface_mm`` says where the snow began.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np

from ..errors import MeasurementError
from ..records import Gauge
from . import Columns

SUFFIXES = (".pnt",)
HEADER = 512  # bytes
LONGEST = 20_000_000  # bytes; a profile of 3 m has 1.5 MB


def read(path: Path, gauge: Gauge, section: float) -> Columns:
    """section : of the tip, m². Raises MeasurementError."""
    try:
        with path.open("rb") as stream:
            content = stream.read(LONGEST + 1)
    except OSError as trouble:
        raise MeasurementError(
            path, "record.file", f"cannot be read ({trouble.strerror}); make it readable"
        ) from None
    if not HEADER < len(content) <= LONGEST:
        raise MeasurementError(
            path, "record.file", f"has {len(content)} bytes, which no profile has; copy it again"
        )
    step, per_count = struct.unpack_from(">ff", content, 6)
    (count,) = struct.unpack_from(">i", content, 358)
    there = (len(content) - HEADER) // 2
    if not (
        math.isfinite(step) and 1e-4 < step < 10.0 and math.isfinite(per_count) and 0.0 < per_count < 10.0
    ):
        raise MeasurementError(
            path, "header", f"says {step:g} mm a step and {per_count:g} N a count; this is no profile"
        )
    if not 0 < count <= there:
        raise MeasurementError(
            path, "header", f"says {count} counts where the file has {there}; it is cut short, copy it again"
        )
    force = np.frombuffer(content, ">i2", count, HEADER) * per_count
    return Columns(1e-3 * step * np.arange(count), force / section)
