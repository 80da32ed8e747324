"""One file a tip, found by listing this folder; a file of the same kind may lie anywhere else (docs/extend.md has the recipe)."""

from __future__ import annotations

from functools import lru_cache

from ...records import FloatArray, Projectile
from ..plugins import shelf
from ..profile import walk

SHELF = shelf("tips", "projectile.tip")
list_tips, find_tip = SHELF.list, SHELF.find


def make_profile(projectile: Projectile) -> FloatArray:
    """The chain of arcs and lines (see ``profile``) of a projectile. Raises SimulationError."""
    return _make(projectile.tip, projectile.tip_radius, projectile.shape)


@lru_cache(maxsize=256)
def _make(tip: str, radius: float, shape: tuple[tuple[str, float], ...]) -> FloatArray:
    profile = walk(find_tip(tip).draw(radius, SHELF.read_values(tip, shape)))
    profile.flags.writeable = False
    return profile
