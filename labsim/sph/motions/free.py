"""A drop: only gravity and the dust move the projectile."""

from __future__ import annotations

from ..plugins import Parameter

PARAMETERS: tuple[Parameter, ...] = ()


def lead(start_depth: float, values: dict[str, float], table: tuple[tuple[float, float], ...]) -> None:
    return None
