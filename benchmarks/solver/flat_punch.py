"""A flat punch on cohesive matter that flows at constant volume (law von_mises): resistance against the answers of plasticity.

Prandtl: a strip on matter of shear strength k carries (2 + π) k = 5.14 k. A smooth round punch on Tresca's matter carries 5.69 k
(Shield 1955, Eason & Shield 1960). In the plane von Mises' matter is Tresca's with k = 2/√3 cohesion. In r and z it is not: its
circle lies between Tresca's hexagons of k = cohesion and k = 2/√3 cohesion, so its answer lies between 5.69 and 6.57 cohesions.

    python -m benchmarks.solver.flat_punch [--cells 8 16] [--rigidity 500] [--geometry planar axisymmetric]
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from labsim.records import Material, Motion, Projectile
from labsim.sph import DropRun, DropSetting, simulate
from labsim.sph.setting import base_area

RADIUS = 5e-4  # m
COHESION = 5e3  # Pa
PRANDTL, ROUND = 2 + math.pi, 5.69  # shear strengths
BETWEEN = (0.06, 0.10)  # tip radii of depth over which the resistance is taken


def push_punch(geometry: str, cells: int, rigidity: float = 500.0, speed: float = 0.1, tip: str = "flat",
               shape: tuple[tuple[str, float], ...] = (), depth: float = BETWEEN[1], start: float = 0.0) -> DropRun:  # fmt: skip
    """Pushed to ``depth`` (in tip radii); no gravity, smooth."""
    shear = rigidity * COHESION
    law = (("cohesion", COHESION), ("shear_modulus", shear), ("bulk_modulus", 10 * shear))
    return simulate(
        DropSetting(
            projectile=Projectile(tip, RADIUS, 1e-6, shape=shape),
            impact_speed=1.0,
            material=Material(law="von_mises", constants=law),
            filling_factor=0.5,
            gravity=0.0,
            geometry=geometry,  # type: ignore[arg-type]
            spacing=RADIUS / cells,
            width=(16 if geometry == "planar" else 8) * RADIUS,
            depth=8 * RADIUS,
            motion=Motion("pushed", start * RADIUS, (("speed", speed), ("end_depth", depth * RADIUS))),
        )
    )


def read_resistance(run: DropRun, between: tuple[float, float] = BETWEEN) -> float:
    """Mean pressure of the tip on its section over that part of the way, in cohesions."""
    low, high = (share * RADIUS for share in between)
    part = (run.depth >= low) & (run.depth <= high)
    work = np.trapezoid(run.force[part], run.depth[part]) - np.ptp(run.shaft_work[part])
    return float(work / np.ptp(run.depth[part]) / base_area(run.setting) / COHESION)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, nargs="+", default=[8, 16])
    parser.add_argument("--rigidity", type=float, default=500.0)
    parser.add_argument("--speed", type=float, default=0.1)
    parser.add_argument("--geometry", nargs="+", default=["planar", "axisymmetric"])
    given = parser.parse_args()
    for geometry in given.geometry:
        for cells in given.cells:
            run = push_punch(geometry, cells, given.rigidity, given.speed)
            found = read_resistance(run)
            if geometry == "planar":
                exact = PRANDTL * 2 / math.sqrt(3)
                answer = f"Prandtl {exact:.2f}, {found / exact - 1:+.1%}"
            else:
                answer = f"between {ROUND:.2f} and {ROUND * 2 / math.sqrt(3):.2f}"
            print(
                f"{geometry}, R/dx {cells}: {found:.3f} cohesions ({answer}); energy {run.energy_error:+.1%}, viscosity "
                f"{run.viscous_share:.1%}, contact {run.energy_share('contact'):+.1%}, {run.wall:.0f} s",
                flush=True,
            )
            steps = np.linspace(0.01, BETWEEN[1], 10)
            print(
                "  ",
                [
                    round(
                        float(
                            np.interp(s * RADIUS, run.depth, run.force) / base_area(run.setting) / COHESION
                        ),
                        2,
                    )
                    for s in steps
                ],
            )


if __name__ == "__main__":
    main()
