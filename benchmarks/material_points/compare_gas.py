"""What trapped gas changes of a drop's depth, by labsim and by the material points, as both are refined.

    OMP_NUM_THREADS=1 python benchmarks/material_points/compare_gas.py [--cells 8,12,16,24,32] [--spacings 5,8,12,16]

A bead of 0.5 mm radius at 0.65 m/s into dust of p_m 900 Pa and K0 45 kPa, with 5 and 12 kPa of gas that cannot leave. Cells and
spacings in a radius. 32 cells take some four minutes a drop.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import numpy as np
from compare import BEAD_DENSITY, drop_bead
from drop import Dust

from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

RADIUS, SPEED, P_M, BULK = 0.5e-3, 0.65, 900.0, 45e3
PRESSURES = (5e3, 12e3)  # Pa


def drop_points(cells: float, pressure: float) -> float:
    """Depth (m) by the material points."""
    return drop_bead(
        RADIUS, SPEED, Dust(p_m=P_M, bulk_modulus=BULK, gas_pressure=pressure), cells
    ).stopping_depth


def drop_particles(spacings: float, pressure: float) -> float:
    """Depth (m) by labsim."""
    bead = Projectile("sphere", RADIUS, BEAD_DENSITY * 4 / 3 * np.pi * RADIUS**3)
    material = Material(p_m=P_M, bulk_modulus=BULK)
    setting = DropSetting(bead, SPEED, material, spacing=RADIUS / spacings, pore_gas=pressure)
    return simulate(setting).penetration_depth


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", default="8,12,16,24,32")
    parser.add_argument("--spacings", default="5,8,12,16")
    chosen = parser.parse_args()
    print(
        "| code | in a radius | depth without gas, mm | "
        + " | ".join(f"{p / 1e3:g} kPa, %" for p in PRESSURES)
        + " |"
    )
    runs: list[tuple[str, str, Callable[[float, float], float]]] = [
        ("labsim", chosen.spacings, drop_particles),
        ("material points", chosen.cells, drop_points),
    ]
    for code, numbers, drop in runs:
        for number in filter(None, numbers.split(",")):
            plain = drop(float(number), 0.0)
            changes = [100 * math.log(drop(float(number), pressure) / plain) for pressure in PRESSURES]
            print(
                f"| {code} | {number} | {plain * 1e3:.4f} | "
                + " | ".join(f"{c:+.2f}" for c in changes)
                + " |",
                flush=True,
            )


if __name__ == "__main__":
    main()
