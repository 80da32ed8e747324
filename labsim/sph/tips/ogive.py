"""An arc that meets the rod without a kink (tangent ogive), with a rounded point."""

from __future__ import annotations

import math

from ..plugins import Parameter
from ..profile import SIDE, Arc, Piece, shaft

PARAMETERS = (
    Parameter("length_ratio", "1", 1.0, 20.0, 3.0, "length of the ogive before rounding, in tip radii"),
    Parameter("point_radius", "m", 0.0, 0.05, 0.0, "0: sharp"),
)


def draw(radius: float, values: dict[str, float]) -> tuple[Piece, ...]:
    """The arc's centre lies at r = radius - arc; the circle of the point touches it from within, on the axis."""
    point = min(values["point_radius"], radius)
    arc = 0.5 * radius * (1.0 + values["length_ratio"] ** 2)
    heading = math.asin((arc - radius) / (arc - point)) if arc > radius else 0.0
    return Arc(point, heading), Arc(arc, SIDE), *shaft(radius)
