"""The friction ratio of a simulated push, sleeve friction over the tip's resistance: what spacing and length of the push change.

A cone of 30° half angle on its shaft, without a stress at rest, as labsim compares soundings with it: in clay (von_mises), in
snow (drucker_prager_cap with cohesion and cap) or in porous_dust, which know no --rigidity, --start, --end and --width.
Printed: R_f = (R / L) W_shaft / W_tip, that over the contact friction, and the tip's resistance.

    python -m benchmarks.solver.sleeve [--cells 4 5 8 11] [--friction 0.2] [--rigidity 100] [--start 4] [--end 8 11.5]
                                      [--width 10]
    python -m benchmarks.solver.sleeve --law porous_dust

A push from 12 to 19.5 tip radii leaves a shaft as long as the sleeve of a standard cone.
"""

from __future__ import annotations

import argparse
import itertools
import math

import numpy as np

from benchmarks.solver.cone_factor import START, push_cone
from benchmarks.solver.flat_punch import RADIUS
from labsim.inference.emulation.grid import hasten, set_push
from labsim.inference.observations.push_model import extract_push
from labsim.inference.observations.sleeve_friction import extract_sleeve
from labsim.records import Material, Projectile
from labsim.sph import DropRun, DropSetting, simulate

SNOW = (("friction_angle", 35.0), ("cohesion", 1e3), ("cap_pressure", 2e4))


def push_in_law(law: str, cells: int, friction: float) -> DropRun:
    """From 4 to 8 tip radii, in snow or dust."""
    constants = SNOW if law == "drucker_prager_cap" else ()
    setting = DropSetting(
        projectile=Projectile("cone", RADIUS, 1e-6),
        impact_speed=1.0,
        material=Material(law=law, constants=constants, contact_friction=friction),
        filling_factor=0.2,
        spacing=RADIUS / cells,
    )
    return simulate(hasten(set_push(setting, 1e-3)))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, nargs="+", default=[4, 5, 8, 11], help="in a tip radius")
    parser.add_argument(
        "--law", choices=("von_mises", "drucker_prager_cap", "porous_dust"), default="von_mises"
    )
    parser.add_argument("--friction", type=float, nargs="+", default=[0.2])
    parser.add_argument("--rigidity", type=float, nargs="+", default=[100.0])
    parser.add_argument("--start", type=float, default=START, help="of the push, tip radii")
    parser.add_argument("--end", type=float, nargs="+", default=[8.0], help="of the push, tip radii")
    parser.add_argument("--speed", type=float, default=0.5)
    parser.add_argument("--width", type=float, default=10.0, help="half width of the ground, tip radii")
    given = parser.parse_args()
    found = []
    for rigidity, friction, end, cells in itertools.product(
        given.rigidity, given.friction, given.end, given.cells
    ):
        if given.law == "von_mises":
            run = push_cone(cells, rigidity, given.speed, 0.0, given.width, end, friction, given.start)
        else:
            run = push_in_law(given.law, cells, friction)
        ratio = float(extract_sleeve(run)[0])
        found.append(ratio / friction)
        resistance = math.exp(float(extract_push(run, whole=False)[0]))
        print(
            f"{given.law}, R/dx {cells}, from {given.start:g} to {end:g} radii, rigidity {rigidity:g}, friction {friction:g}: "
            f"R_f {100 * ratio:.2f} %, over the friction {ratio / friction:.3f}, tip {resistance / 1e3:.3g} kPa; "
            f"energy {run.energy_error:+.1%}, "
            f"{run.wall:.0f} s",
            flush=True,
        )
    if len(found) > 1:
        mean = float(np.mean(found))
        print(
            f"R_f over the friction {mean:.3f} ± {100 * np.std(found, ddof=1) / mean:.0f} % over these runs"
        )


if __name__ == "__main__":
    main()
