"""How far a drop comes back up after its stop: labsim beside the Lagrangian mesh and material points.

    python -m benchmarks.lagrangian_mesh.rebound [--cells 5 8] [--points] [--box 6 7]

Prints, for several dusts and drops, the way up (µm) a quarter and half a stopping time after the stop, of the mesh and of labsim
with each number of spacings in a tip radius, and by how much labsim differs. --points: of material points too, in minutes.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from benchmarks.lagrangian_mesh import mesh
from benchmarks.material_points import drop as points
from labsim.records import FloatArray, Material, Projectile
from labsim.sph import DropSetting, simulate

AFTER = np.array([0.25, 0.5])  # stopping times after the stop
MESH_CELLS, POINT_CELLS = 12.0, 12.0  # in a tip radius
# radius (m), speed (m/s), p_m (Pa), bulk modulus (Pa), tensile and shear factor, friction on the side (N/m)
CASES = (
    (0.5e-3, 0.50, 1300.0, 45e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.25, 1300.0, 45e3, 1.0, 1.0, 0.0),
    (1.5e-3, 0.40, 1300.0, 45e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.40, 700.0, 45e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.60, 2500.0, 45e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 7e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 15e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 135e3, 1.0, 1.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 45e3, 0.3, 1.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 45e3, 3.0, 1.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 45e3, 1.0, 0.5, 0.0),
    (0.5e-3, 0.50, 1300.0, 45e3, 1.0, 2.0, 0.0),
    (0.5e-3, 0.50, 1300.0, 45e3, 1.0, 1.0, 0.2),
    (0.5e-3, 0.50, 1300.0, 45e3, 1.0, 1.0, 0.4),
    (0.5e-3, 0.25, 1300.0, 45e3, 1.0, 1.0, 0.4),
    (1.5e-3, 0.40, 1300.0, 45e3, 1.0, 1.0, 1.2),
)


def measure_lift(time: FloatArray, depth: FloatArray, stop: float, deepest: float) -> FloatArray:
    """Way up (µm) at AFTER; time (s), depth (m): (n,)."""
    return np.asarray(1e6 * (deepest - np.interp(stop * (1.0 + AFTER), time, depth)))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=float, nargs="+", default=[5.0, 8.0])
    parser.add_argument("--points", action="store_true")
    parser.add_argument("--box", type=float, nargs=2, help="width and depth of labsim's dust, tip radii")
    options = parser.parse_args()
    print(
        "radius mm, speed m/s, p_m Pa, K0 kPa, T/T0, Y/Y0, N/m | way up of the mesh, µm | of others, with the difference in %"
    )
    for radius, speed, p_m, bulk, tensile, shear, side in CASES:
        mass = mesh.BEAD * radius**3
        dust = mesh.Dust(p_m=p_m, bulk_modulus=bulk, tensile_factor=tensile, shear_factor=shear)
        numerics = mesh.Numerics(cells=MESH_CELLS, depth=6.0)
        forces = mesh.Forces(side=side)
        run = mesh.run_drop(dust, radius, speed, numerics, mass, forces=forces, after=1.0 + AFTER[-1])
        lift = measure_lift(run.time, run.depth, run.stopping_time, run.stopping_depth)
        line = (
            f"{1e3 * radius:g} {speed:g} {p_m:g} {1e-3 * bulk:g} {tensile:g} {shear:g} {side:g} | "
            + " ".join(f"{x:.1f}" for x in lift)
        )
        others = {}
        width, depth = (None, None) if options.box is None else (each * radius for each in options.box)
        for cells in options.cells:
            material = Material(p_m=p_m, bulk_modulus=bulk, shear_factor=shear)
            material = material.replace(tensile_log10_a=material.tensile_log10_a + math.log10(tensile))
            ours = simulate(
                DropSetting(
                    Projectile("hemisphere", radius, mass),
                    speed,
                    material,
                    spacing=radius / cells,
                    after_stop=AFTER[-1],
                    side_friction=side,
                    width=width,
                    depth=depth,
                )
            )
            others[f"labsim {cells:g}"] = measure_lift(
                ours.time, ours.depth, ours.stopping_time, ours.penetration_depth
            )
        if options.points and not side:
            found = points.run_drop(
                points.Dust(p_m=p_m, bulk_modulus=bulk, tensile_factor=tensile, shear_factor=shear),
                points.Body(radius=radius, mass=mass),
                speed,
                points.Numerics(cells=POINT_CELLS),
                stop_factor=1.0 + AFTER[-1],
            )
            others["points"] = measure_lift(
                found.time, found.depth, found.stopping_time, found.stopping_depth
            )
        for name, other in others.items():
            line += f" | {name} " + " ".join(
                f"{x:.1f} ({100 * (x / y - 1):+.0f})" for x, y in zip(other, lift, strict=True)
            )
        print(line, flush=True)


if __name__ == "__main__":
    main()
