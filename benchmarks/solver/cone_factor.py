"""Deep penetration of a smooth cone into cohesive matter (law von_mises): resistance over cohesion, against published formulas.

Weightless matter without a stress at rest, so that the cone factor is the mean pressure on the cone's section over the cohesion.
Teh & Houlsby (1991): 4/3 (1 + ln I) (1.25 + I/2000), Lu et al. (2004): 3.4 + 1.6 ln I, both for a smooth cone of 30° half angle
under an isotropic stress at rest; I is the rigidity G/c.

    python -m benchmarks.solver.cone_factor [--cells 5 8] [--rigidity 100] [--width 20] [--end 13]
"""

from __future__ import annotations

import argparse
import math

from benchmarks.solver.flat_punch import COHESION, RADIUS, read_resistance
from labsim.records import Material, Motion, Projectile
from labsim.sph import DropRun, DropSetting, simulate

START = 4.0  # tip radii


def push_cone(
    cells: int,
    rigidity: float,
    speed: float,
    point: float = 0.0,
    width: float = 10.0,
    end: float = 9.0,
    friction: float = 0.0,
    start: float = START,
) -> DropRun:
    """From start to end tip radii; the cone begins in the ground. speed m/s; radius of the point, half width in tip radii;
    coefficient of Coulomb friction, rough where it is large: matter at the cone then yields before it slides."""
    shear = rigidity * COHESION
    law = (("cohesion", COHESION), ("shear_modulus", shear), ("bulk_modulus", 10 * shear))
    return simulate(
        DropSetting(
            projectile=Projectile("cone", RADIUS, 1e-6, shape=(("point_radius", point * RADIUS),)),
            impact_speed=1.0,
            material=Material(law="von_mises", constants=law, contact_friction=friction),
            filling_factor=0.5,
            gravity=0.0,
            spacing=RADIUS / cells,
            width=width * RADIUS,
            depth=(end + 5.0) * RADIUS,
            motion=Motion("pushed", start * RADIUS, (("speed", speed), ("end_depth", end * RADIUS))),
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, nargs="+", default=[5, 8])
    parser.add_argument("--rigidity", type=float, nargs="+", default=[100.0])
    parser.add_argument("--speed", type=float, default=0.5)
    parser.add_argument("--point", type=float, default=0.0)
    parser.add_argument("--friction", type=float, default=0.0, help="of the cone; 1 and above: rough")
    parser.add_argument("--width", type=float, default=20.0, help="half width of the ground, tip radii")
    parser.add_argument("--end", type=int, default=13, help="depth where the push ends, tip radii")
    given = parser.parse_args()
    for rigidity in given.rigidity:
        teh = 4 / 3 * (1 + math.log(rigidity)) * (1.25 + rigidity / 2000)
        print(
            f"rigidity {rigidity:g}: Teh & Houlsby {teh:.2f}, Lu et al. {3.4 + 1.6 * math.log(rigidity):.2f}"
        )
        for cells in given.cells:
            run = push_cone(cells, rigidity, given.speed, given.point, given.width, given.end, given.friction)
            found = [read_resistance(run, (at, at + 2.0)) for at in range(5, given.end, 2)]
            print(
                f"  R/dx {cells}: {', '.join(f'{each:.2f}' for each in found)} over two tip radii each from 5 on; energy "
                f"{run.energy_error:+.1%}, contact {run.energy_share('contact'):+.1%}, viscosity {run.viscous_share:.1%}, "
                f"{run.wall:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
