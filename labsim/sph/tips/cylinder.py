"""A lying cylinder, in the plane: there its outline is that of a bead."""

from __future__ import annotations

import math

from ..plugins import Parameter
from ..profile import Arc, Piece

PARAMETERS: tuple[Parameter, ...] = ()
GEOMETRIES = ("planar",)


def draw(radius: float, values: dict[str, float]) -> tuple[Piece, ...]:
    return (Arc(radius, math.pi),)
