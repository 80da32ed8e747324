"""A cone with a rounded point on a rod; in the plane a wedge."""

from __future__ import annotations

import math

from ..plugins import Parameter
from ..profile import SIDE, Arc, Line, Piece, shaft

PARAMETERS = (
    Parameter(
        "half_angle",
        "rad",
        math.radians(5),
        math.radians(85),
        math.radians(30),
        "cone penetration test, ISO 22476-1",
    ),
    Parameter("point_radius", "m", 0.0, 0.05, 0.0, "0: sharp"),
    Parameter("rod_radius", "m", 0.0, 0.05, 0.0, "0: the rod is as wide as the cone"),
)


def draw(radius: float, values: dict[str, float]) -> tuple[Piece, ...]:
    angle = values["half_angle"]
    point = min(values["point_radius"], radius)
    flank = (radius - point * math.cos(angle)) / math.sin(angle)
    return Arc(point, SIDE - angle), Line(flank), Arc(0.0, SIDE), *shaft(radius, values["rod_radius"])
