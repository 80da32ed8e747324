"""What trapped gas changes of a drop's depth, by labsim, the material points and the Lagrangian mesh, as they are refined.

    OMP_NUM_THREADS=1 python -m benchmarks.material_points.compare_gas [--cells 8,12,16,24,32] [--spacings 5,8,12,16]
    OMP_NUM_THREADS=1 python -m benchmarks.material_points.compare_gas --speed 0.3 --mesh 8,12,16,24 --cells 8,12,16

A bead of 0.5 mm radius at 0.65 m/s into dust of p_m 900 Pa and K0 45 kPa, with 5 and 12 kPa of gas that cannot leave. Cells and
spacings in a radius. 32 cells take some four minutes a drop. The mesh tangles in soft dust with gas from about one radius on.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import numpy as np

from benchmarks.lagrangian_mesh import mesh
from benchmarks.material_points.compare import BEAD_DENSITY, drop_bead
from benchmarks.material_points.drop import Dust
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

RADIUS, P_M, BULK = 0.5e-3, 900.0, 45e3
PRESSURES = (5e3, 12e3)  # Pa


def drop_points(speed: float, cells: float, pressure: float) -> float:
    """Depth (m) by the material points."""
    return drop_bead(
        RADIUS, speed, Dust(p_m=P_M, bulk_modulus=BULK, gas_pressure=pressure), cells
    ).stopping_depth


def drop_particles(speed: float, spacings: float, pressure: float) -> float:
    """Depth (m) by labsim."""
    bead = Projectile("sphere", RADIUS, BEAD_DENSITY * 4 / 3 * np.pi * RADIUS**3)
    material = Material(p_m=P_M, bulk_modulus=BULK)
    setting = DropSetting(bead, speed, material, spacing=RADIUS / spacings, pore_gas=pressure)
    return simulate(setting).penetration_depth


def drop_mesh(speed: float, cells: float, pressure: float) -> float:
    """Depth (m) by the Lagrangian mesh; not a number where it tangles."""
    dust = mesh.Dust(p_m=P_M, bulk_modulus=BULK, gas_pressure=pressure)
    try:
        return mesh.run_drop(dust, RADIUS, speed, mesh.Numerics(cells=cells)).stopping_depth
    except RuntimeError:
        return math.nan


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", default="8,12,16,24,32")
    parser.add_argument("--spacings", default="5,8,12,16")
    parser.add_argument("--mesh", default="")
    parser.add_argument("--speed", type=float, default=0.65, help="m/s")
    chosen = parser.parse_args()
    print(
        "| code | in a radius | depth without gas, mm | "
        + " | ".join(f"{p / 1e3:g} kPa, %" for p in PRESSURES)
        + " |"
    )
    runs: list[tuple[str, str, Callable[[float, float, float], float]]] = [
        ("labsim", chosen.spacings, drop_particles),
        ("material points", chosen.cells, drop_points),
        ("Lagrangian mesh", chosen.mesh, drop_mesh),
    ]
    for code, numbers, drop in runs:
        for number in filter(None, numbers.split(",")):
            plain = drop(chosen.speed, float(number), 0.0)
            changes = [
                100 * math.log(drop(chosen.speed, float(number), pressure) / plain) for pressure in PRESSURES
            ]
            print(
                f"| {code} | {number} | {plain * 1e3:.4f} | "
                + " | ".join(f"{c:+.2f}" for c in changes)
                + " |",
                flush=True,
            )


if __name__ == "__main__":
    main()
