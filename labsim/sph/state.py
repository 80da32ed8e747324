"""What the compiled loop works on, by name: records of rows and of numbers. A row is an array with one number a particle.

Row 0 to n - 1 are the particles, behind them their mirror images. A law's own rows and numbers are records of its own file.
``laid`` is the depth, m, at which a particle lay at the start.
"""

from __future__ import annotations

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from ..records import FloatArray

Rows = namedtuple(
    "Rows",
    "x z u w mass area ring weight sound density initial sxx szz sxz pressure work elastic heat "
    "gxx gxz gzz lxx lxz lzx lzz mxx mxz mzx mzz fx fz dxx dxz dzx dzz shear distance nx nz "
    "thickness grip wall_rate compaction diffusivity exchange exchanged crushing push_x push_z yield_square laid",
)

LOG = (
    "time",
    "depth",
    "velocity",
    "force",
    "wall_impulse",
    "external_impulse",
    "heat",
    "friction",
    "contact",
    "outside",
    "driver",
    "shaft",
)

REST = 1.0e-3  # m/s: forces that fade at rest fade below it
TIP, SPEED, TIME, FRICTION, LAST_STEP = range(5)  # what the array ``body`` holds: m, m/s (upwards), s, J, s


class Lists(NamedTuple):
    """Who belongs to whom: neighbours of particle i are ``neighbour[start[i] : start[i + 1]]``; image k mirrors ``source[k]`` at
    x = ``twice_plane[k]``/2; ``fixed`` keep their velocity; ``near`` may touch the projectile, ``inner`` the axis."""

    start: np.ndarray
    neighbour: np.ndarray
    source: np.ndarray
    twice_plane: FloatArray
    fixed: np.ndarray
    near: np.ndarray
    inner: np.ndarray
    films: np.ndarray  # room for as many as are near
    origin: FloatArray  # x, z of the particles when near and inner were made, m; (2, n)


class Lines(NamedTuple):
    """Neighbours' numbers as cache lines (see ``lines``), and the buffers that sums read them into, (8, ROOM)."""

    front: FloatArray
    back: FloatArray
    nearby: FloatArray
    beyond: FloatArray
    lost: FloatArray  # what contact spent in the last step and what friction did, W, and the force along a shaft, N; (3,)


class Numbers(NamedTuple):
    """What stays the same throughout a run; SI, masses and forces per radian in r-z and per metre in the plane."""

    n: int
    axisymmetric: bool
    free_mass: float  # of particles that are no wall
    profile: FloatArray  # of the projectile (see ``profile``), m
    body_mass: float
    gravity: float
    friction: float  # Coulomb's, of dust on the projectile
    spacing: float
    h: float
    courant: float
    alpha: float
    beta: float
    affine: float
    front: float
    hold_apart: tuple[int, ...]  # empty: no artificial stress; a type, so known to the compiler
    artificial_stress: float
    per_kernel: float  # 1 over the kernel, as (1 - q/2)⁴ (1 + 2q), at one spacing
    diffusivity: float  # m², times the rate of crushing
    reference: float  # φ that the exchange compares compactions at


class Outside(NamedTuple):
    """What acts on the projectile besides the dust in the simulation: forces of the immersed length, of depth, of speed, of time,
    of depth and speed; dust that sticks to it; and a driver, where there is a path."""

    side_friction: float  # N/m
    depth_knots: FloatArray
    depth_force: FloatArray
    speed_knots: FloatArray
    speed_force: FloatArray
    time_knots: FloatArray  # s
    time_force: FloatArray
    viscosity_knots: FloatArray  # m
    viscosity: FloatArray  # N s/m
    drag_knots: FloatArray  # m
    drag: FloatArray  # N s²/m²
    mass_knots: FloatArray  # m
    stuck: FloatArray  # kg
    gathered_knots: FloatArray  # m
    gathered: FloatArray  # kg
    path_time: FloatArray
    path_depth: FloatArray


class Stretch(NamedTuple):
    """What is asked of one call of the loop: at most ``steps`` steps, logged from row ``first`` on."""

    steps: int
    first: int
    allowed: float  # m, what a point may move before the lists are made anew
    body_origin: float  # m, height of the tip when they were made
    stopped: bool  # it has stopped before, or need not
