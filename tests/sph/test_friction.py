"""Friction between projectile and dust: Coulomb's where it slides, the shear strength of the matter where it is rough."""

import numpy as np
import pytest

from labsim.records import Material, Motion, Projectile
from labsim.sph import DropRun, DropSetting, Numerics, simulate
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


SETTLED = 0.07  # spacings by which dust in equilibrium at a wall is nearer than half a cell


def push_rod_through_tube(friction: float) -> tuple[float, float, float]:
    """Mean forces of 2 ms on a rod that moves down through a tube of elastic dust under uniform pressure, N a radian: by the work
    booked on its shaft and by its impulse; and μ p A. Around the tube is a mirror, its ends are held."""
    radius, columns, layers, pressure = 10 * SPACING, 16, 30, 0.02 * MODULUS
    material = elastic_material(MODULUS, 0.5).replace(contact_friction=friction)
    rod = Projectile("hemisphere", radius, 1e9)
    setting = set_body(material, SPACING, 2e-3, geometry="axisymmetric").replace(projectile=rod)
    x, z = np.meshgrid(np.arange(columns) + 0.5 - SETTLED, np.arange(layers) + 0.5)
    x, z = radius + SPACING * x.ravel(), SPACING * z.ravel()
    state = fill_at_rest(setting, x, z, np.full(x.size, setting.filling_factor), pressure)
    held = (z < 3 * SPACING) | (z > (layers - 3) * SPACING)
    body = np.array([-5 * radius, -SPEED, 0.0, 0.0, 0.0])
    mirror = radius + (columns - SETTLED) * SPACING
    log = evolve(setting, state, held, body, planes=(mirror,)).log
    by_impulse = np.trapezoid(log[1:, 3], log[1:, 0]) / np.ptp(log[1:, 0])
    return log[-1, 11] / np.ptp(log[:, 1]), by_impulse, friction * pressure * radius * layers * SPACING


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2, 0.3])
def test_a_shaft_under_uniform_pressure(friction):
    """What a sleeve feels is μ p A, and all of it is booked as the shaft's."""
    by_work, by_impulse, expected = push_rod_through_tube(friction)
    print(
        f"μ {friction}: by work {by_work:.4e}, by impulse {by_impulse:.4e}, μ p A {expected:.4e} N a radian"
    )
    assert by_work == pytest.approx(expected, rel=0.04, abs=1e-12)
    assert by_impulse == pytest.approx(by_work, rel=0.01, abs=1e-12)


@pytest.mark.parametrize("speed", [0.25, 0.65])
def test_a_rough_drop_balances_its_book_at_the_full_step(speed):
    """Dust that sticks to the bead is not shaken: half the step gives the same depth, and no energy comes from nowhere."""
    bead = Projectile("sphere", 5e-4, 1.5e-6)
    rough = DropSetting(bead, speed, material=Material(p_m=1300.0, contact_friction=0.8), spacing=1e-4)
    whole, half = (simulate(rough.replace(numerics=Numerics(courant=courant))) for courant in (0.9, 0.45))
    print(f"energy {whole.energy_error:+.4f}, D {whole.penetration_depth / half.penetration_depth - 1:+.1e}")
    assert abs(whole.energy_error) < 0.004
    assert whole.penetration_depth == pytest.approx(half.penetration_depth, rel=1e-3)


COHESION, RADIUS = 5e3, 5e-4  # Pa, m


def push_cone(friction: float) -> DropRun:
    """A cone of 30° into von Mises' matter of rigidity 100, from 4 to 9 radii deep at 5 spacings in a radius."""
    law = (("cohesion", COHESION), ("shear_modulus", 100 * COHESION), ("bulk_modulus", 1000 * COHESION))
    return simulate(
        DropSetting(
            Projectile("cone", RADIUS, 1e-6),
            1.0,
            material=Material(law="von_mises", constants=law, contact_friction=friction),
            filling_factor=0.5,
            gravity=0.0,
            spacing=RADIUS / 5,
            width=12 * RADIUS,
            depth=14 * RADIUS,
            motion=Motion("pushed", 4 * RADIUS, (("speed", 0.5), ("end_depth", 9 * RADIUS))),
        )
    )


def test_a_rough_cone_in_clay():
    """A rough cone meets 1.3 cohesions more than a smooth one says Lu et al. (2004), 2.4 Teh & Houlsby (1991); what its shaft
    meets is no part of that, and not more than the shear strength on it."""
    found = []
    for friction in (0.0, 1.0):
        run = push_cone(friction)
        assert abs(run.energy_error) < 0.01
        late = run.depth > 7 * RADIUS
        way, section = np.ptp(run.depth[late]), np.pi * RADIUS**2 * COHESION
        work = np.trapezoid(run.force[late], run.depth[late])
        shaft = np.ptp(run.shaft_work[late])
        found.append(((work - shaft) / way / section, shaft / way / section))
    (smooth, nothing), (rough, shaft) = found
    most = (
        2 * (8.0 - 3**0.5) * 2 / 3**0.5
    )  # in the middle of that way, of shear strength 2/√3 cohesion all over it
    print(f"smooth {smooth:.2f}, rough {rough:.2f} cohesions; shaft {shaft:.2f} of at most {most:.2f}")
    assert nothing == 0.0 and 0.0 < shaft < most
    assert 1.3 < rough - smooth < 2.4
