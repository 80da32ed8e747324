"""A bead; on a thin rod it is the ball of a ball penetrometer."""

from __future__ import annotations

import math

from ..plugins import Parameter
from ..profile import SIDE, Arc, Line, Piece

PARAMETERS = (Parameter("rod_radius", "m", 0.0, 0.05, 0.0, "0: a free bead"),)


def draw(radius: float, values: dict[str, float]) -> tuple[Piece, ...]:
    rod = values["rod_radius"]
    if rod == 0.0:
        return (Arc(radius, math.pi),)
    return Arc(radius, math.pi - math.asin(min(rod / radius, 1.0))), Arc(0.0, SIDE), Line(math.inf)
