"""Bodies of dust that are not drops, evolved without a projectile: for verification against exact answers, and for timing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..records import FloatArray, Material, Projectile
from . import particles as rows
from .drop import STEPS_AT_ONCE, Evolution, evolve
from .particles import fill_at_rest
from .setting import DropSetting, Numerics

UNBREAKABLE = 1.0e12  # strengths in units of the bulk modulus: such a body stays elastic


def elastic_material(bulk_modulus: float, shear_to_bulk: float) -> Material:
    """Material that never yields: p = K (φ/φ0 - 1), with Jaumann's rate for the deviatoric stress."""
    strength = UNBREAKABLE * bulk_modulus
    return Material(
        p_m=strength,
        tensile_log10_a=float(np.log10(strength)),
        tensile_log10_b=0.0,
        bulk_modulus=bulk_modulus,
        shear_to_bulk=shear_to_bulk,
    )


def set_body(
    material: Material,
    spacing: float,
    duration: float,
    *,
    geometry: str = "planar",
    filling_factor: float = 0.15,
    monomer_density: float = 2000.0,
    gravity: float = 0.0,
    numerics: Numerics | None = None,
) -> DropSetting:
    """A setting whose projectile is only there because the record wants one."""
    return DropSetting(
        projectile=Projectile("sphere", 8 * spacing, 1.0),
        impact_speed=1.0,
        material=material,
        filling_factor=filling_factor,
        monomer_density=monomer_density,
        gravity=gravity,
        geometry=geometry,  # type: ignore[arg-type]
        spacing=spacing,
        duration=duration,
        numerics=numerics or Numerics(),
    )


def fill_block(setting: DropSetting, columns: int, layers: int) -> FloatArray:
    """State of a block whose lower left corner is the origin, row by row from below."""
    x, z = np.meshgrid(np.arange(columns) + 0.5, np.arange(layers) + 0.5)
    phi = np.full(x.size, setting.filling_factor)
    return fill_at_rest(setting, x.ravel() * setting.spacing, z.ravel() * setting.spacing, phi)


def evolve_body(
    setting: DropSetting,
    state: FloatArray,
    wall: np.ndarray | None = None,
    watch: Callable[[float, FloatArray], None] | None = None,
    steps_at_once: int = STEPS_AT_ONCE,
    planes: tuple[float, ...] = (),
) -> Evolution:
    """Evolve a body for ``setting.duration``; wall particles keep their velocity. The log has no meaning here."""
    if wall is None:
        wall = np.zeros(state.shape[1], dtype=bool)
    nowhere = np.array([1.0e9, -1.0e-30, 0.0, 0.0, 0.0])
    return evolve(setting, state, wall, nowhere, watch, steps_at_once, planes)


def place_rings(spacing: float, duration: float, speed: float = 0.059) -> tuple[DropSetting, FloatArray]:
    """Two elastic rings (radii 3 and 4, centres at ±5) flying at each other, in units of density and bulk modulus 1.

    Swegle (1995), Monaghan (2000): each moves at ``speed`` in units of the sound speed, μ = 0.22 K.
    """
    material = elastic_material(1.0, 0.22)
    setting = set_body(material, spacing, duration, filling_factor=0.15, monomer_density=1 / 0.15)
    half = np.arange(-int(4 / spacing) - 1, int(4 / spacing) + 1) + 0.5
    x, z = np.meshgrid(half * spacing, half * spacing)
    ring = (np.hypot(x, z) > 3) & (np.hypot(x, z) < 4)
    x, z = x[ring], z[ring]
    both = np.concatenate([x - 5, x + 5])
    state = fill_at_rest(setting, both, np.tile(z, 2), np.full(both.size, setting.filling_factor))
    state[rows.U] = -np.sign(both) * speed
    return setting, state
