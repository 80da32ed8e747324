"""What would steps of their own, by powers of two, save a drop? The share of all sums over neighbours that would be left.

    python -m benchmarks.solver.local_steps

Each particle asks for a step (labsim/sph/kernels/gradients.py, bound_step; projectile.py, bound_contact); today all take the
shortest. With a step of 2, 4 or 8 times the shortest for those that allow it, these are summed less often. Particles within the
kernel's reach of one with a shorter step keep its pace: momentum is kept only if both sides of a pair are summed together. What
it costs to do so is not counted. A bead's mass, 0.66 m/s.

And what would a spacing that grows save, by GROWTH a particle, farther than EVEN radii to the side and below the surface? The
share of the particles that would be left, with the same free dust between the fixed layers, which have the width of the last.
"""

from __future__ import annotations

import math
from unittest.mock import patch

import numpy as np
from scipy.spatial import cKDTree

import labsim.sph.drop as drop
from benchmarks.lagrangian_mesh.mesh import grade
from labsim.records import FloatArray, Material, Projectile
from labsim.sph import DropSetting, simulate
from labsim.sph import particles as rows
from labsim.sph.kernels.gradients import FEW, HOOP_STIFFNESS

RADIUS, DENSITY, SPEED = 0.5e-3, 2540.0, 0.66  # m, kg/m³, m/s
DROPS = ((1300.0, 5), (1300.0, 8), (3000.0, 8), (300.0, 8))  # Pa, spacings in a tip radius
LEVELS = 4
EVERY = 2e-4  # s
EVEN, GROWTH = (1.5, 2.0), 1.15


def find_left(state: FloatArray, h: float) -> tuple[float, float]:
    """Share of the sums that would be left, and the median step over the shortest."""
    sound, few = state[rows.SOUND], np.maximum((state[rows.GXX] + state[rows.GZZ]) * 0.5 / FEW, 1.0)
    axis = (sound * few) * np.hypot(1.0, HOOP_STIFFNESS * h / state[rows.RING])
    contact = sound * np.hypot(1.0, HOOP_STIFFNESS * h * state[rows.GRIP])
    asked = 1.0 / np.maximum(axis, contact)
    level = np.minimum(np.floor(np.log2(asked / asked.min())).astype(int), LEVELS - 1)
    places = np.stack([state[rows.X], state[rows.Z]], axis=1)
    tree, left = cKDTree(places), 2.0 ** (1 - LEVELS)
    for k in range(LEVELS - 1):
        paced = tree.query_ball_point(places[level <= k], 2 * h)
        count = len(set().union(*paced)) if len(paced) else 0
        left += count / len(places) * (2.0**-k - 2.0 ** -(k + 1))
    return left, float(np.median(asked) / asked.min())


def count_graded(setting: DropSetting) -> float:
    """Share of the particles that would be left."""
    h, radius = setting.spacing, setting.projectile.tip_radius
    left = 1.0
    for even, whole in zip(EVEN, setting.extent, strict=True):
        free = len(grade(even * radius, whole - rows.WALL_LAYERS * h, h, GROWTH)) - 1
        left *= (free + rows.WALL_LAYERS) / round(whole / h)
    return left


def main() -> None:
    print(
        "| p_m, Pa | spacings in a tip radius | sums left | median step over the shortest | particles left |"
    )
    print("|---|---|---|---|---|")
    evolve = drop.evolve
    mass = DENSITY * 4 / 3 * math.pi * RADIUS**3
    for p_m, cells in DROPS:
        setting = DropSetting(
            Projectile("hemisphere", RADIUS, mass), SPEED, Material(p_m=p_m), spacing=RADIUS / cells
        )
        found: list[tuple[float, float]] = []

        def watch(time, state, found=found, h=setting.numerics.smoothing * setting.spacing):
            if time > EVERY * (1 + len(found)):
                found.append(find_left(state, h))

        with patch.object(drop, "evolve", lambda *given, watch=watch: evolve(*given[:4], watch)):
            simulate(setting)
        left, median = np.median(found, axis=0)
        print(f"| {p_m:g} | {cells} | {left:.2f} | {median:.1f} | {count_graded(setting):.2f} |")


if __name__ == "__main__":
    main()
