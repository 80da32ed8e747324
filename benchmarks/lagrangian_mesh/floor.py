"""What a hard floor takes of the depth of a drop, on the Lagrangian mesh.

    python -m benchmarks.lagrangian_mesh.floor [--cells 12 18]

A tip of 1.5 mm at 0.5 m/s in dust of p_m 1300 Pa. tests/effects/test_floor.py has the same of labsim.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.lagrangian_mesh.mesh import BEAD, Dust, Numerics, run_drop

RADIUS, SPEED, P_M = 1.5e-3, 0.5, 1300.0
GAPS = (0.8, 0.4, 0.2, 0.1)  # tip radii, from where it stops without a floor
DEPTH = 7.0  # tip radii, of the dust without one


def measure(cells: float, floor: float = np.inf) -> float:
    """Depth (m) at the stop."""
    numerics = Numerics(cells=cells, depth=DEPTH, floor=floor)
    return run_drop(Dust(p_m=P_M), RADIUS, SPEED, numerics, BEAD * RADIUS**3).stopping_depth


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=float, nargs="+", default=[12.0], help="a tip radius")
    for cells in parser.parse_args().cells:
        free = measure(cells)
        print(f"{cells:g} cells a radius: {1e3 * free:.4f} mm without a floor")
        for gap in GAPS:
            change = measure(cells, free + gap * RADIUS) / free - 1.0
            print(f"  {gap:g} radii below that: {100 * change:+.2f} %", flush=True)


if __name__ == "__main__":
    main()
