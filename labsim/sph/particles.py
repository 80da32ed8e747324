"""The particles' state: one contiguous row a quantity, mirror images behind the particles."""

from __future__ import annotations

import numpy as np

from ..records import FloatArray
from .materials import porous_dust
from .setting import DropSetting

ROWS = (
    "x z u w mass area ring weight sound density zero_stress initial sxx szz sxz pressure work elastic heat "
    "gxx gxz gzz lxx lxz lzx lzz mxx mxz mzx mzz fx fz dxx dxz dzx dzz shear distance nx nz "
    "thickness rest_density compressive tensile"
).split()
(
    X, Z, U, W, MASS, AREA, RING, WEIGHT, SOUND, DENSITY, ZERO_STRESS, INITIAL, SXX, SZZ, SXZ, PRESSURE, WORK, ELASTIC,
    HEAT, GXX, GXZ, GZZ, LXX, LXZ, LZX, LZZ, MXX, MXZ, MZX, MZZ, FX, FZ, DXX, DXZ, DZX, DZZ, SHEAR,
    DISTANCE, NX, NZ, THICKNESS, REST_DENSITY, COMPRESSIVE, TENSILE,
) = range(len(ROWS))  # fmt: skip

WALL_LAYERS = 3  # of particles held still at the sides and the bottom


def initial_filling_factor(setting: DropSetting, depth: FloatArray) -> FloatArray:
    """φ0 at a depth (m, positive downwards) below the surface, with crust and gradient."""
    crust = setting.crust_excess * np.exp(-depth / setting.crust_length) if setting.crust_excess else 0.0
    return setting.filling_factor + crust + setting.filling_gradient * np.minimum(depth, setting.graded_depth)


def _filling_above(setting: DropSetting, depth: FloatArray) -> FloatArray:
    """Integral of the initial filling factor from the surface to ``depth``, m."""
    length, graded = setting.crust_length, np.minimum(depth, setting.graded_depth)
    crust = setting.crust_excess * length * (1 - np.exp(-depth / length)) if setting.crust_excess else 0.0
    gradient = setting.filling_gradient * (graded * depth - 0.5 * graded**2)
    return setting.filling_factor * depth + crust + gradient


def fill_at_rest(
    setting: DropSetting, x: FloatArray, z: FloatArray, phi: FloatArray, pressure: FloatArray | float = 0.0
) -> FloatArray:
    """State (rows, n) of particles at rest at x, z (m), one a spacing², under an elastic pressure (Pa) alone."""
    material = setting.material
    state = np.zeros((len(ROWS), x.size))
    state[X], state[Z] = x, z
    state[INITIAL] = phi
    state[DENSITY] = state[REST_DENSITY] = phi * setting.monomer_density
    state[RING] = x if setting.geometry == "axisymmetric" else 1.0
    state[AREA] = setting.spacing**2
    state[MASS] = state[DENSITY] * state[RING] * state[AREA]
    state[PRESSURE] = pressure
    state[ZERO_STRESS] = porous_dust.zero_stress_filling_factor(phi, state[PRESSURE], material)
    stiffness = porous_dust.bulk_modulus(phi, material)
    state[SOUND] = np.sqrt(stiffness * (1 + 4 / 3 * material.shear_to_bulk) / state[DENSITY])
    state[DXX] = state[DZZ] = state[THICKNESS] = 1.0
    return state


def place_particles(setting: DropSetting) -> tuple[FloatArray, np.ndarray]:
    """State (rows, n) of the dust at rest on a square lattice whose surface is z = 0, and which particles are walls.

    The dust starts in hydrostatic balance (isotropic, within 0.8 Σ): φ0' is what carries the weight above.
    """
    spacing = setting.spacing
    width, depth = setting.extent
    axisymmetric = setting.geometry == "axisymmetric"
    columns = (
        np.arange(round(width / spacing))
        if axisymmetric
        else np.arange(round(width / spacing)) - round(width / spacing) // 2
    )
    x, z = np.meshgrid((columns + 0.5) * spacing, -(np.arange(round(depth / spacing)) + 0.5) * spacing)
    x, z = x.ravel(), z.ravel()
    phi = initial_filling_factor(setting, -z)
    weight_above = setting.gravity * setting.monomer_density * _filling_above(setting, -z)
    strength = porous_dust.compressive_strength(phi, setting.material)
    state = fill_at_rest(setting, x, z, phi, np.minimum(weight_above, 0.8 * strength))
    edge = width if axisymmetric else width / 2
    wall = (z < -depth + WALL_LAYERS * spacing) | (np.abs(x) > edge - WALL_LAYERS * spacing)
    return state, wall
