"""The particles' state: one contiguous row a quantity, mirror images behind the particles."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..records import FloatArray
from .materials import find_law
from .profile import measure_distance
from .setting import DropSetting
from .state import Rows
from .tips import make_profile

(
    X, Z, U, W, MASS, AREA, RING, WEIGHT, SOUND, DENSITY, INITIAL, SXX, SZZ, SXZ, PRESSURE, WORK, ELASTIC,
    HEAT, GXX, GXZ, GZZ, LXX, LXZ, LZX, LZZ, MXX, MXZ, MZX, MZZ, FX, FZ, DXX, DXZ, DZX, DZZ, SHEAR,
    DISTANCE, NX, NZ, THICKNESS, GRIP, WALL_RATE, COMPACTION, DIFFUSIVITY, EXCHANGE, EXCHANGED,
    CRUSHING, PUSH_X, PUSH_Z, YIELD_SQUARE, LAID,
) = range(len(Rows._fields))  # fmt: skip

WALL_LAYERS = 3  # of particles held still at the sides and the bottom


def name_rows(setting: DropSetting, state: FloatArray) -> tuple[Rows, Any]:
    """The rows of ``state`` by name: those that every law has, and the law's own."""
    common = len(Rows._fields)
    return Rows(*state[:common]), find_law(setting.material.law).State(*state[common:])


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
    law = find_law(setting.material.law)
    own, sound = law.start(setting, phi, pressure)
    state = np.zeros((len(Rows._fields) + len(own), x.size))
    state[X], state[Z] = x, z
    state[LAID] = -z
    state[INITIAL] = phi
    state[DENSITY] = phi * setting.monomer_density
    state[RING] = x if setting.geometry == "axisymmetric" else 1.0
    state[AREA] = setting.spacing**2
    state[MASS] = state[DENSITY] * state[RING] * state[AREA]
    state[PRESSURE] = pressure
    state[SOUND] = sound
    state[YIELD_SQUARE] = np.inf
    state[DXX] = state[DZZ] = state[THICKNESS] = 1.0
    for k, row in enumerate(own):
        state[len(Rows._fields) + k] = row
    return state


def place_particles(setting: DropSetting) -> tuple[FloatArray, np.ndarray]:
    """State (rows, n) of the dust at rest on a square lattice whose surface is z = 0, and which particles are walls.

    The dust starts in hydrostatic balance (isotropic, within what the law can bear).
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
    bearable = find_law(setting.material.law).bearable_pressure(setting, phi)
    state = fill_at_rest(setting, x, z, phi, np.minimum(weight_above, bearable))
    edge = width if axisymmetric else width / 2
    if setting.motion.start_depth > 0.0:
        clear = measure_distance(x, z, -setting.motion.start_depth, make_profile(setting.projectile)) > 0.0
        x, z, state = x[clear], z[clear], np.ascontiguousarray(state[:, clear])
    wall = (z < -depth + WALL_LAYERS * spacing) | (np.abs(x) > edge - WALL_LAYERS * spacing)
    return state, wall
