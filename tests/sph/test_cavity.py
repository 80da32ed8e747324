"""Expansion of a cavity, driven through the laws' own updates on one radius of particles, against limit pressures.

Incompressible matter: the motion is known, r³ = R³ + a³ - a0³, so are all strains; the pressure on the wall is the
integral of equilibrium. Else a cavity that grows from nothing has a similarity solution, an ordinary differential equation:
a particle led along it has to end at its limit pressure.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labsim.records import Material
from labsim.sph.bodies import set_body
from labsim.sph.materials import find_law
from labsim.sph.particles import fill_at_rest, name_rows

PHI, SOLID = 0.6, 2500.0
NEAR = 1.01  # radii of the cavity: nearer, a motion that is given would have to be known to ever more digits


class Radius:
    """Particles along a radius; a step takes their strains along it and around it (sphere: twice around, cylinder: once)."""

    def __init__(self, material, count, sphere, pressure=0.0):
        self.setting = set_body(material, 1e-4, 1.0, filling_factor=PHI, monomer_density=SOLID)
        self.law, self.sphere = find_law(material.law), sphere
        state = fill_at_rest(self.setting, np.ones(count), np.zeros(count), np.full(count, PHI), pressure)
        self.s, self.own = name_rows(self.setting, state)
        self.constants, self.tables = (
            self.law.make_constants(self.setting),
            self.law.make_tables(self.setting),
        )

    def strain(self, along, around, dt=1.0):
        s = self.s
        s.lxx[:], s.u[:], s.lzz[:] = along / dt, around / dt, around / dt if self.sphere else 0.0
        self.law.update(0, s.lxx.size, dt, True, s, self.own, self.constants, self.tables)

    @property
    def difference(self):
        """Stress around less stress along (tension positive), Pa."""
        return -2 * self.s.sxx - self.s.szz


@pytest.mark.parametrize("rigidity", [50.0, 100.0, 300.0])
@pytest.mark.parametrize("sphere", [True, False])
def test_limit_pressure_of_incompressible_clay(sphere, rigidity):
    """4/3 c (1 + ln(G/c)), c half the triaxial strength; cylinder: c (1 + ln(G/c)), c the strength in shear, 2/√3 of that."""
    cohesion = 1e3
    constants = (
        ("cohesion", cohesion),
        ("shear_modulus", rigidity * cohesion),
        ("bulk_modulus", 1e6 * cohesion),
    )
    power = 3 if sphere else 2
    start = np.geomspace(
        1.0, 3000.0 if sphere else 30000.0, 1500
    )  # of the middle of what each particle stands for
    clay = Radius(Material(law="von_mises", constants=constants), start.size, sphere)
    r = start.copy()
    for a in np.geomspace(1.0, 30.0, 3001)[1:]:
        new = (start**power + a**power - 1.0) ** (1 / power)
        around = np.log(new / r)
        clay.strain(-(power - 1) * around, around)
        r = new
    found = np.trapezoid((power - 1) * clay.difference, np.log(r))
    strength = cohesion if sphere else 2 / math.sqrt(3) * cohesion
    exact = (4 / 3 if sphere else 1.0) * strength * (1 + math.log(rigidity * cohesion / strength))
    print(
        f"{'sphere' if sphere else 'cylinder'}, G/c {rigidity:g}: {found / exact - 1:+.2%} of {exact / cohesion:.3f} c"
    )
    assert found == pytest.approx(exact, rel=0.01)


def solve_similarity(m, flow, k, bulk, shear, p0):
    """Limit pressure of a spherical cavity that grows from nothing, p0 far away; q = k + m p, dε_v = -flow dε_q.

    All depends on ξ = r/c, c the radius of what has yielded; V = v/ċ. Equilibrium gives p(ξ), the rate of p gives V.
    """
    strength = k + m * p0
    power = -2 / (1 + 2 * m / 3)

    def slope(x, velocity):
        v = velocity[0]
        q = strength * x ** (m * power)
        dp = power * q / x  # of p over ξ
        # (V - ξ) p' = K (-V' - 2 V/ξ + flow λ'),  λ' = (-2 G (V' - V/ξ) + K m (V' + 2 V/ξ))/(3 G + K m flow)
        per = flow / (3 * shear + bulk * m * flow)
        of_dv = bulk * (-1 + per * (-2 * shear + bulk * m))
        rest = bulk * (-2 * v / x + per * (2 * shear * v / x + 2 * bulk * m * v / x))
        return [((v - x) * dp - rest) / of_dv]

    def wall(x, velocity):
        return velocity[0] - x

    wall.terminal = True
    solution = solve_ivp(
        slope,
        (1.0, 1e-4),
        [3 * strength / (6 * shear)],
        events=wall,
        rtol=1e-11,
        atol=1e-14,
        dense_output=True,
    )

    def radial(x):
        q = strength * x ** (m * power)
        return ((q - k) / m if m else p0 - 2 * k * math.log(x)) + 2 * q / 3

    return radial, solution.t_events[0][0], lambda x: (solution.sol(x)[0], slope(x, solution.sol(x))[0])


def follow(material, p0, yielding, near, field, steps):
    """Radial pressure of one particle that the cavity comes ``near`` to, strained as the similarity solution says."""
    particle = Radius(material, 1, True, p0)
    for _ in range(100):
        particle.strain(-2 * yielding / 100, yielding / 100)
    x = 1.0
    while x > near:
        dt = 1.0 / steps
        v, dv = field(x)
        middle = x + 0.5 * dt * (v - x)
        v, dv = field(middle)
        particle.strain(np.array([dt * dv]), np.array([dt * v / middle]))
        x += dt * (v - middle)
    return float(particle.s.pressure[0] - particle.s.sxx[0])


SAND = dict(friction_angle=30.0, cohesion=100.0, bulk_modulus=1e6, shear_modulus=6e5, cap_exponent=0.0)
CASES = {
    "von_mises": (dict(cohesion=1e4, bulk_modulus=1e7, shear_modulus=6e5), 0.0),
    "no dilatancy": (SAND | dict(dilatancy_angle=0.0), 1e3),
    "dilatancy 10°": (SAND | dict(dilatancy_angle=10.0), 1e3),
    "as the friction": (SAND | dict(dilatancy_angle=30.0, cohesion=0.0), 3e3),
}


@pytest.mark.parametrize("case", list(CASES))
def test_limit_pressure_of_a_cavity_from_nothing(case):
    """What the cavity meets in the end is the limit pressure that equilibrium asks for, dilatancy and compression included."""
    constants, p0 = CASES[case]
    bulk, shear = constants["bulk_modulus"], constants["shear_modulus"]
    law = "von_mises" if case == "von_mises" else "drucker_prager_cap"
    if law == "von_mises":
        m, flow, k = 0.0, 0.0, 2 * constants["cohesion"]
    else:
        sine, dilation = (
            math.sin(math.radians(constants[f"{each}_angle"])) for each in ("friction", "dilatancy")
        )
        m, flow = 6 * sine / (3 - sine), 6 * dilation / (3 - dilation)
        k = 6 * constants["cohesion"] * math.sqrt(1 - sine**2) / (3 - sine)
    radial, wall, field = solve_similarity(m, flow, k, bulk, shear, p0)
    if law == "von_mises":  # Hill (1950): 2/3 Y (1 + ln(E/(3 (1 - ν) Y)))
        young, poisson = (
            9 * bulk * shear / (3 * bulk + shear),
            (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear),
        )
        hill = 2 / 3 * k * (1 + math.log(young / (3 * (1 - poisson) * k)))
        print(f"Hill: {hill:.0f} Pa")
        assert radial(wall) == pytest.approx(p0 + hill, rel=0.03)
    material = Material(law=law, constants=tuple(constants.items()))
    found = follow(material, p0, (k + m * p0) / (6 * shear), NEAR * wall, field, 4000)
    exact = radial(NEAR * wall)
    print(
        f"{case}: limit {radial(wall):.0f} Pa, at {NEAR:g} radii {exact:.0f} Pa, {found / exact - 1:+.2%}; "
        f"yielded to {1 / wall:.2f} radii of the cavity"
    )
    assert found == pytest.approx(exact, rel=0.005)
