"""A rod cut off square, with a rounded edge; in the plane a strip."""

from __future__ import annotations

from ..plugins import Parameter
from ..profile import SIDE, Arc, Line, Piece, shaft

PARAMETERS = (
    Parameter("edge_radius", "m", 0.0, 0.05, 0.0, "0: sharp"),
    Parameter("rod_radius", "m", 0.0, 0.05, 0.0, "0: the rod is as wide as the tip"),
)


def draw(radius: float, values: dict[str, float]) -> tuple[Piece, ...]:
    edge = min(values["edge_radius"], radius)
    return Line(radius - edge), Arc(edge, SIDE), *shaft(radius, values["rod_radius"])
