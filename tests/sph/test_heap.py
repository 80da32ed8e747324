"""A heap of dry grains in the plane stands up to its angle of repose and flows beyond it.

Grains that keep their volume as they flow (no dilatancy) have the same stress out of the plane as the mean of the plane, so that
√J2 = α p says sin(angle) = α there: Davis (1968), in Soil mechanics: selected topics, 341. α = M/√3 of triaxial compression.
"""

import math

import numpy as np
import pytest

from labsim.records import Material
from labsim.sph import particles as rows
from labsim.sph.bodies import evolve_body, set_body
from labsim.sph.particles import fill_at_rest

SPACING, HALF, DURATION = 2e-3, 0.1, 0.8  # m, m, s
GRAVITY, FILLING, GRAIN = 9.81, 0.6, 2600.0
CALMING = 0.97  # of the speed is left after sixteen steps, so that a heap which begins to flow does not run


def measure_sinking(friction: float, slope: float) -> float:
    """Share of its height that the heap's middle loses a second, in the second half of the time. Angles in degrees."""
    moduli = (("bulk_modulus", 2e5), ("shear_modulus", 1.2e5))
    law = (("friction_angle", friction), ("dilatancy_angle", 0.0), *moduli)
    setting = set_body(
        Material(law="drucker_prager_cap", constants=law),
        SPACING,
        DURATION,
        gravity=GRAVITY,
        filling_factor=FILLING,
        monomer_density=GRAIN,
    )
    columns, tall = int(HALF / SPACING), 2 * int(HALF * math.tan(math.radians(slope)) / SPACING)
    x, z = np.meshgrid(
        (np.arange(-2 * columns, 2 * columns) + 0.5) * SPACING, (np.arange(-4, tall) + 0.5) * SPACING
    )
    top = (HALF - np.abs(x)) * math.tan(math.radians(slope))
    there = z < np.maximum(top, 0.0)
    x, z, top = x[there], z[there], top[there]
    weight = np.maximum(top - z, 0.0) * FILLING * GRAIN * GRAVITY
    state = fill_at_rest(setting, x, z, np.full(x.size, FILLING), weight)
    floor = z < 0.0
    seen = []

    def watch(time, now):
        seen.append((time, np.mean(now[rows.Z][~floor])))
        now[rows.U] *= CALMING
        now[rows.W] *= CALMING

    evolve_body(setting, state, floor, watch, 16)
    time, height = np.array(seen).T
    late = time > 0.5 * DURATION
    return float(
        -np.ptp(height[late]) / height[0] / np.ptp(time[late]) * np.sign(np.diff(height[late]).sum())
    )


@pytest.mark.parametrize("friction", [20.0, 25.0])
def test_a_heap_rests_at_its_angle_of_repose(friction):
    sine = math.sin(math.radians(friction))
    alpha = 6 * sine / (3 - sine) / math.sqrt(3)
    repose = math.degrees(math.asin(alpha))
    below, above = (measure_sinking(friction, repose + off) for off in (-2.0, 2.0))
    print(
        f"friction {friction}°, repose {repose:.1f}°: sinks {below:.1e} /s two degrees below, {above:.1e} /s above"
    )
    assert abs(below) < 5e-5 and above > 2e-3
