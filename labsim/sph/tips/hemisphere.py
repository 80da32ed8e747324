"""A rod with a round end."""

from __future__ import annotations

from ..plugins import Parameter
from ..profile import SIDE, Arc, Piece, shaft

PARAMETERS: tuple[Parameter, ...] = ()


def draw(radius: float, values: dict[str, float]) -> tuple[Piece, ...]:
    return Arc(radius, SIDE), *shaft(radius)
