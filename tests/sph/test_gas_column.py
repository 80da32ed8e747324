"""A closed column of dust with gas that cannot leave its pores: pressed slowly, and as a sound wave crosses it, in closed form.

At one temperature the gas presses with P0 (1 - φi)/(1 - φ) where it had P0; what is over P0 is added to the dust's own stress.
"""

import math

import numpy as np
import pytest

from labsim.records import Material
from labsim.sph import particles as rows
from labsim.sph import sirono
from labsim.sph.bodies import elastic_material, evolve_body, fill_block, set_body

SPACING, COLUMNS, WALL = 1e-4, 8, 3


def side_planes(geometry):
    edge = COLUMNS * SPACING
    return (edge,) if geometry == "axisymmetric" else (0.0, edge)


@pytest.mark.parametrize("geometry", ["planar", "axisymmetric"])
def test_slow_press(geometry):
    """The piston feels Σ + 2Y/3 of the dust and the gas's P0 (φ - φi)/(1 - φ), at every depth alike."""
    material, layers, speed, gas = Material(), 24, 0.06, 12e3
    setting = set_body(material, SPACING, 10e-3, geometry=geometry).replace(pore_gas=gas)
    state = fill_block(setting, COLUMNS, layers)
    layer = np.round(state[rows.Z] / SPACING - 0.5).astype(int)
    wall = (layer < WALL) | (layer >= layers - WALL)
    state[rows.W][layer >= layers - WALL] = -speed
    result = evolve_body(setting, state, wall, planes=side_planes(geometry))
    middle = np.abs(layer - layers / 2 + 0.5) < 5
    now = result.state[:, middle]
    phi = now[rows.DENSITY] / 2000.0
    trapped = gas * (phi - 0.15) / (1.0 - phi)
    own = sirono.compressive_strength(phi, material)
    axial = own + 2 / 3 * sirono.shear_strength(phi, material) + trapped
    print(
        f"{geometry}: φ {phi.min():.4f} to {phi.max():.4f}, gas {trapped.mean() / axial.mean():.0%} of the stress"
    )
    assert phi.mean() > 0.19
    assert trapped.mean() > 0.4 * axial.mean()
    np.testing.assert_allclose(now[rows.PRESSURE], own + trapped, rtol=0.01)
    np.testing.assert_allclose(now[rows.PRESSURE] - now[rows.SZZ], axial, rtol=0.01)


@pytest.mark.parametrize("geometry", ["planar", "axisymmetric"])
def test_speed_of_sound(geometry):
    """A pulse travels at √((K + 4μ/3 + P0 φ/(1 - φ))/ρ); with 1 bar in soft dust twice as fast as without gas."""
    modulus, gas, layers = 4.5e3, 1e5, 160
    stiffness = modulus * (1 + 2 / 3) + gas * 0.15 / 0.85
    sound, dry = math.sqrt(stiffness / 300.0), math.sqrt(modulus * (1 + 2 / 3) / 300.0)
    reach = layers * SPACING
    width = reach / 7
    setting = set_body(elastic_material(modulus, 0.5), SPACING, 0.4 * reach / sound, geometry=geometry)
    setting = setting.replace(pore_gas=gas)
    state = fill_block(setting, COLUMNS, layers)
    distance = np.abs(state[rows.Z] - 0.25 * reach)
    strain = np.where(distance < width, 1e-4 * np.cos(0.5 * np.pi * distance / width) ** 2, 0.0)
    state[rows.W] = sound * strain
    state[rows.DENSITY] *= 1 + strain
    state[rows.PRESSURE] = (modulus + gas * 0.15 / 0.85) * strain
    state[rows.SZZ], state[rows.SXX] = -2 / 3 * modulus * strain, 1 / 3 * modulus * strain
    middle = np.abs(state[rows.X] - COLUMNS * SPACING / 2) < 3 * SPACING
    places = []

    def watch(time, now):
        if time > 0.3 * setting.duration:
            v, z = now[rows.W, middle], now[rows.Z, middle]
            crest = v > 0.3 * v.max()
            places.append((time, np.sum(v[crest] * z[crest]) / np.sum(v[crest])))

    evolve_body(setting, state, watch=watch, steps_at_once=4, planes=side_planes(geometry))
    measured = np.polyfit(*np.array(places).T, 1)[0]
    print(f"{geometry}: {measured:.3f} m/s, exact {sound:.3f}, without gas {dry:.3f}")
    assert sound > 1.8 * dry
    assert measured == pytest.approx(sound, rel=0.02)
