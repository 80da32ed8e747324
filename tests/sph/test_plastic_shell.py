"""Imploding shell (V9, Verney): a cylinder of beryllium, perfectly plastic, whose motion is spent when its inner radius is known.

Incompressible plane flow v = -V0 R0/r. Its kinetic energy at the start is set equal to the plastic work, 2/√3 Y ln(r0/r) per
volume, up to the wanted inner radius: so that is where it must come to rest.
"""

import math

import numpy as np
import pytest

from labsim.records import Material
from labsim.sph import Numerics
from labsim.sph import particles as rows
from labsim.sph.bodies import UNBREAKABLE, evolve_body, set_body
from labsim.sph.particles import fill_at_rest

INNER, OUTER, FINAL = 8.0, 10.0, 4.0  # cm
DENSITY, BULK, SHEAR, YIELD = 1.845, 1.11, 1.51, 0.0033  # g/cm³, Mbar: time in µs


def speed_that_reaches(final):
    """V0 (cm/µs) at the inner surface."""
    r = np.linspace(INNER, OUTER, 20001)
    now = np.sqrt(r**2 - INNER**2 + final**2)
    work = np.trapezoid(2 / math.sqrt(3) * YIELD * np.log(r / now) * r, r)
    return math.sqrt(2 * work / (DENSITY * INNER**2 * math.log(OUTER / INNER)))


def choose_material(law):
    """Y is twice the cohesion; of the dust all else is made so strong that it never matters."""
    if law == "von_mises":
        constants = (("cohesion", YIELD / 2), ("shear_modulus", SHEAR), ("bulk_modulus", BULK))
        return Material(law=law, constants=constants)
    strength = UNBREAKABLE * BULK
    return Material(
        p_m=strength, delta=1e-9, tensile_log10_a=math.log10(strength), tensile_log10_b=0.0,
        bulk_modulus=BULK, shear_to_bulk=SHEAR / BULK, shear_factor=YIELD / strength,
    )  # fmt: skip


def place_shell(law, layers, speed, numerics):
    """Concentric layers of particles, each particle about as wide as its layer is thick."""
    spacing = (OUTER - INNER) / layers
    setting = set_body(
        choose_material(law),
        spacing,
        3 * (INNER - FINAL) / speed,
        monomer_density=DENSITY / 0.15,
        numerics=numerics,
    )
    radius, angle, area = [], [], []
    for layer in range(layers):
        r = INNER + (layer + 0.5) * spacing
        count = round(2 * math.pi * r / spacing)
        radius.append(np.full(count, r))
        angle.append(2 * math.pi * (np.arange(count) + 0.5 * (layer % 2)) / count)
        area.append(np.full(count, 2 * math.pi * r * spacing / count))
    radius, angle, area = (np.concatenate(each) for each in (radius, angle, area))
    x, z = radius * np.cos(angle), radius * np.sin(angle)
    state = fill_at_rest(setting, x, z, np.full(x.size, 0.15))
    state[rows.MASS] *= area / state[rows.AREA]
    state[rows.AREA] = area
    state[rows.U], state[rows.W] = -speed * INNER / radius**2 * np.array([x, z])
    return setting, state, radius < INNER + spacing


@pytest.mark.parametrize(("law", "layers"), [("porous_dust", 6), ("porous_dust", 12), ("von_mises", 12)])
def test_imploding_shell_stops_where_its_energy_is_spent(law, layers):
    speed = speed_that_reaches(FINAL)
    setting, state, innermost = place_shell(law, layers, speed, Numerics(smoothing=1.5))
    middle = INNER + 0.5 * setting.spacing
    path = []

    def watch(time, now):
        squared = np.mean(now[rows.X, innermost] ** 2 + now[rows.Z, innermost] ** 2)
        path.append(math.sqrt(squared - middle**2 + INNER**2))  # of the surface: nothing is compressed

    end = evolve_body(setting, state, watch=watch, steps_at_once=8).state
    filling = end[rows.DENSITY] / setting.monomer_density
    print(f"{law}, {layers} layers: inner radius {min(path):.3f} cm, at the end {path[-1]:.3f}")
    assert min(path) == pytest.approx(FINAL, abs=0.05)
    assert path[-1] == pytest.approx(min(path), abs=0.02)
    np.testing.assert_allclose(filling, 0.15, rtol=0.01)
