"""The friction ratio of a simulated push, sleeve friction over the tip's resistance: what spacing and length of the push change.

A cone of 30° half angle on its shaft, in clay (law von_mises) without a stress at rest, as labsim compares soundings with it.
Printed: R_f = (R / L) W_shaft / W_tip, that over the contact friction, and the tip's resistance in cohesions.

    python benchmarks/sleeve.py [--cells 4 5 8 11] [--friction 0.2] [--rigidity 100] [--end 8 11.5] [--width 10]

A push from 4 to 11.5 tip radii leaves a shaft as long as the sleeve of a standard cone.
"""

from __future__ import annotations

import argparse
import itertools
import math

import numpy as np
from cone_factor import START, push_cone
from flat_punch import COHESION, RADIUS

from labsim.inference.observations.push_model import encode_push
from labsim.inference.observations.sleeve_friction import encode_sleeve


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, nargs="+", default=[4, 5, 8, 11], help="in a tip radius")
    parser.add_argument("--friction", type=float, nargs="+", default=[0.2])
    parser.add_argument("--rigidity", type=float, nargs="+", default=[100.0])
    parser.add_argument("--end", type=float, nargs="+", default=[8.0], help="of the push, tip radii")
    parser.add_argument("--speed", type=float, default=0.5)
    parser.add_argument("--width", type=float, default=10.0, help="half width of the ground, tip radii")
    given = parser.parse_args()
    found = []
    for rigidity, friction, end, cells in itertools.product(
        given.rigidity, given.friction, given.end, given.cells
    ):
        run = push_cone(cells, rigidity, given.speed, 0.0, given.width, end, friction)
        ratio = float(encode_sleeve(run)[0])
        found.append(ratio / friction)
        factor = math.exp(float(encode_push(run, whole=False)[0])) / COHESION
        print(
            f"R/dx {cells}, to {end:g} radii ({(end - START) * RADIUS * 1e3:.3g} mm of way), rigidity {rigidity:g}, "
            f"friction {friction:g}: R_f {100 * ratio:.2f} %, over the friction {ratio / friction:.3f}, "
            f"tip {factor:.2f} cohesions; energy {run.energy_error:+.1%}, {run.wall:.0f} s",
            flush=True,
        )
    if len(found) > 1:
        mean = float(np.mean(found))
        print(
            f"R_f over the friction {mean:.3f} ± {100 * np.std(found, ddof=1) / mean:.0f} % over these runs"
        )


if __name__ == "__main__":
    main()
