"""Hugoniot of a crushed solid (P-alpha): an elastic precursor at crush_start, and a shock on the crush curve behind it.

The law is isothermal, so the Hugoniot is the crush curve: u - u_e = √((p - p_e)(1/ρ_e - 1/ρ)) across the second front.
Both fronts are shocks (p is straight in ρ before crush_start, so convex in 1/ρ).
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from labsim.records import Material
from labsim.sph import Numerics
from labsim.sph import particles as rows
from labsim.sph.bodies import evolve_body, fill_block, set_body

SOLID, START = 2000.0, 0.4
MODULUS, SPEED, LOW, HIGH = 1e7, 0.5, 2e3, 2e5
SPACING, COLUMNS, LAYERS, WALL = 1e-4, 8, 300, 3
FOAM = Material(
    law="p_alpha",
    constants=(
        ("solid_modulus", MODULUS), ("elastic_speed", SPEED), ("crush_start", LOW), ("crush_end", HIGH),
        ("shear_modulus", 1e3), ("cohesion", 0.0),
    ),
)  # fmt: skip


def solve_fronts(piston):
    """φ and p behind the second front, the speeds of both, m/s."""
    edge = START + LOW / (MODULUS * SPEED**2)
    excess = 1 / (edge - LOW / MODULUS) - 1

    def curve(p):
        x = max(HIGH - p, 0.0) / (HIGH - LOW)
        return 1 / (1 + excess * x * x) + p / MODULUS

    precursor_speed = math.sqrt(LOW / (START * SOLID) / (1 - START / edge))
    ahead = precursor_speed * (1 - START / edge)  # of the dust between the fronts

    def jump(p):
        return math.sqrt((p - LOW) * (1 / edge - 1 / curve(p)) / SOLID)

    p = brentq(lambda p: ahead + jump(p) - piston, LOW * (1 + 1e-9), 5 * HIGH)
    front = ahead + (p - LOW) / (SOLID * edge * jump(p))
    return curve(p), p, front, precursor_speed


@pytest.mark.parametrize(("geometry", "piston"), [("planar", 2.0), ("planar", 6.0), ("axisymmetric", 4.0)])
def test_both_fronts(geometry, piston):
    phi, p, front, precursor = solve_fronts(piston)
    duration = 0.9 * LAYERS * SPACING / precursor
    setting = set_body(
        FOAM, SPACING, duration, geometry=geometry, filling_factor=START, monomer_density=SOLID,
        numerics=Numerics(affine=0.0, alpha=0.5),
    )  # fmt: skip
    state = fill_block(setting, COLUMNS, LAYERS)
    layer = np.round(state[rows.Z] / SPACING - 0.5).astype(int)
    wall = (layer < WALL) | (layer >= LAYERS - WALL)
    state[rows.W][layer < WALL] = piston
    edge = COLUMNS * SPACING
    seen = []

    def average(now):
        return np.array([np.bincount(layer, row) / np.bincount(layer) for row in now])

    def place(z, values, level):
        last = np.nonzero(values > level)[0].max()
        return np.interp(-level, -values[last : last + 2], z[last : last + 2])

    def watch(time, now):
        if time > 0.4 * duration:
            profile = average(now)
            z = profile[rows.Z]
            middle = 0.5 * (phi + START)
            seen.append(
                (
                    time,
                    place(z, profile[rows.DENSITY] / SOLID, middle),
                    place(z, profile[rows.PRESSURE], 0.5 * LOW),
                )
            )

    result = evolve_body(
        setting, state, wall, watch, 8, (edge,) if geometry == "axisymmetric" else (0.0, edge)
    )
    profile = average(result.state)
    times, shock, first = np.array(seen).T
    z = profile[rows.Z]
    face = (WALL + 0.5) * SPACING + piston * result.log[-1, 0]
    inside = (z > face + 6 * SPACING) & (z < shock[-1] - 6 * SPACING)
    assert inside.sum() > 8
    between = (z > shock[-1] + 15 * SPACING) & (z < first[-1] - 15 * SPACING)
    assert between.sum() > 20
    found = np.array(
        [
            profile[rows.DENSITY][inside].mean() / SOLID, profile[rows.PRESSURE][inside].mean(),
            np.polyfit(times, shock, 1)[0], np.polyfit(times, first, 1)[0],
        ]
    )  # fmt: skip
    off = 100 * (found / [phi, p, front, precursor] - 1)
    plateau = profile[rows.PRESSURE][between].mean() / LOW - 1
    print(
        f"{geometry}, {piston} m/s: φ {phi:.4f} {off[0]:+.2f} %, p {p:.0f} Pa {off[1]:+.2f} %, "
        f"front {front:.2f} m/s {off[2]:+.2f} %, precursor {precursor:.2f} m/s {off[3]:+.2f} %, "
        f"{100 * plateau:+.2f} % of crush_start between"
    )
    assert np.all(np.abs(off) < (1.5, 4.0, 1.5, 1.5))
    assert abs(plateau) < 0.02
