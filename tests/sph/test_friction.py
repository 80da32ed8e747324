"""Coulomb friction between projectile and dust: a block that slides under a flat carries μ times its pressure in shear."""

import numpy as np
import pytest

from labsim.records import Projectile
from labsim.sph import particles as rows
from labsim.sph.bodies import elastic_material, fill_block, set_body
from labsim.sph.drop import evolve
from labsim.sph.particles import fill_at_rest

SPACING, COLUMNS, LAYERS = 1e-4, 60, 12
MODULUS, SPEED = 45e3, 0.2  # Pa, m/s


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.1])
def test_a_block_that_slides_under_a_flat(friction):
    """Its floor moves on at a steady speed. Below the flat σ_xz = μ σ_zz on average, and the heat is μ N u t.

    More friction rocks the block, and particles that are pressed harder slide more slowly.
    """
    material = elastic_material(MODULUS, 0.5).replace(contact_friction=friction)
    flat = Projectile("sphere", 1e5 * SPACING, 1e9)
    setting = set_body(material, SPACING, 6e-3).replace(projectile=flat)
    state = fill_block(setting, COLUMNS, LAYERS)
    x, z = state[rows.X] - 0.5 * COLUMNS * SPACING, state[rows.Z] - LAYERS * SPACING
    state = fill_at_rest(setting, x, z, state[rows.INITIAL], 0.02 * MODULUS)
    state[rows.U] = SPEED
    floor = z < -(LAYERS - 3) * SPACING
    middle = (np.abs(x) < 15 * SPACING) & (z > -5 * SPACING) & (z < -SPACING)
    seen = []

    def watch(time, now):
        if time > 3e-3:
            pressure = now[rows.PRESSURE] - now[rows.SZZ]
            seen.append((np.mean(now[rows.SXZ][middle]), np.mean(pressure[middle])))

    log = evolve(setting, state, floor, np.array([-0.07 * SPACING, -1e-7, 0.0, 0.0, 0.0]), watch, 16).log
    assert log[-1, 0] == pytest.approx(6e-3, rel=0.01)
    shear, normal = np.mean(seen, axis=0)
    late = log[:, 0] > 3e-3
    heat = log[late, 7][-1] - log[late, 7][0]
    expected = friction * np.trapezoid(log[late, 3], log[late, 0]) * SPEED
    print(f"μ {friction}: shear over normal {-shear / normal:.4f}, heat {heat:.4e} J/m of {expected:.4e}")
    assert shear == pytest.approx(-friction * normal, abs=0.005 * normal)
    assert heat == pytest.approx(expected, rel=0.02)
