"""One drop on a Lagrangian mesh, and what the dust at the tip is like at the stop.

    python -m benchmarks.lagrangian_mesh.drop --speed 0.65,0.30 --tip-radius-mm 0.5 --cells 8,16

Speeds and cells may be lists; prints Markdown, a column a drop.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import numpy as np

from benchmarks.lagrangian_mesh.mesh import Dust, Numerics, Result, run_drop
from benchmarks.lagrangian_mesh.tip import THRESHOLDS, measure_tip, print_table

STOPS = Path(__file__).parents[2] / "data" / "reference" / "independent_stops.csv"


def find_limits(radius_mm: float, speed: float) -> tuple[float, float] | None:
    """D (mm) and T_s (ms) of the independent solver for a nominal drop; None where it has none."""
    with STOPS.open() as lines:
        for row in csv.DictReader(lines):
            if float(row["tip_radius_mm"]) == radius_mm and float(row["speed_m_s"]) == speed:
                return float(row["depth_mm_limit"]), float(row["stopping_time_ms_limit"])
    return None


def describe(
    found: Result, seconds: float, tip: float, cells: float, limits: tuple[float, float] | None
) -> dict[str, str]:
    """One drop's column of the table."""
    mine = found.stopping_depth * 1e3, found.stopping_time * 1e3
    off = ["" if limits is None else f" ({100 * (mine[k] / limits[k] - 1):+.1f} %)" for k in range(2)]
    half = np.interp(0.5 * found.stopping_time, found.time, found.depth) / found.stopping_depth
    column = {
        "D mm": f"{mine[0]:.4f}{off[0]}",
        "T_s ms": f"{mine[1]:.3f}{off[1]}",
        "D(T_s/2)/D": f"{half:.3f}",
    }
    places = (x.ravel() for x in (found.r, found.z, found.volume, found.phi))
    figures = measure_tip(*places, found.stopping_depth, tip, tip / cells)
    column |= {name: f"{value:.3f}" for name, value in figures.items()}
    at_contact = found.energies["kinetic at contact"]
    column |= {
        f"{name}, %": f"{100 * value / at_contact:.2f}"
        for name, value in found.energies.items()
        if name != "kinetic at contact"
    }
    return column | {
        "energy missing, %": f"{100 * found.energy_error:+.3f}",
        "cells": f"{found.phi.size}",
        "steps": f"{found.steps}",
        "CPU s": f"{seconds:.2f}",
    }


def append_row(path: Path, found: Result, tip_mm: float, speed: float, dust: Dust, cells: float) -> None:
    """One drop's figures as a line of a CSV, with a header where there is none."""
    places = (x.ravel() for x in (found.r, found.z, found.volume, found.phi))
    tip = tip_mm * 1e-3
    figures = measure_tip(*places, found.stopping_depth, tip, tip / cells)
    row = {
        "tip_radius_mm": f"{tip_mm:g}", "speed_m_s": f"{speed:.2f}", "p_m_pa": f"{dust.p_m:g}",
        "bulk_modulus_kpa": f"{dust.bulk_modulus * 1e-3:g}", "cells": f"{cells:g}",
        "depth_mm": f"{found.stopping_depth * 1e3:.4f}", "stopping_time_ms": f"{found.stopping_time * 1e3:.3f}",
        **{f"volume{100 * level:.0f}": f"{figures[f'V(>{level:.2f})']:.3f}" for level in THRESHOLDS},
        "largest_phi": f"{figures['max']:.3f}", "phi_999": f"{figures['99.9']:.3f}",
    }  # fmt: skip
    begins = not path.exists()
    with path.open("a", newline="") as lines:
        writer = csv.DictWriter(lines, list(row), lineterminator="\n")
        if begins:
            writer.writeheader()
        writer.writerow(row)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )

    def numbers(text: str) -> list[float]:
        return [float(part) for part in text.split(",")]

    parser.add_argument("--speed", type=numbers, default=[0.65], help="m/s")
    parser.add_argument("--tip-radius-mm", type=float, default=0.5)
    parser.add_argument("--mass-mg", type=float, help="a glass bead's of the tip's radius by default")
    parser.add_argument("--sphere", action="store_true", help="a sphere instead of the end of a rod")
    parser.add_argument("--cells", type=numbers, default=[8.0], help="in a tip radius")
    parser.add_argument("--p-m", type=float, default=Dust.p_m, help="Pa")
    parser.add_argument("--bulk-modulus-kpa", type=float, default=Dust.bulk_modulus * 1e-3)
    parser.add_argument("--gas-kpa", type=float, default=0.0, help="trapped in the pores")
    for choice in ("growth", "even", "width", "depth", "courant", "linear", "quadratic", "hourglass"):
        parser.add_argument(f"--{choice}", type=float, default=getattr(Numerics, choice))
    parser.add_argument("-o", "--output", type=Path, help="append the figures to this CSV as well")
    given = parser.parse_args()
    dust = Dust(p_m=given.p_m, bulk_modulus=given.bulk_modulus_kpa * 1e3, gas_pressure=given.gas_kpa * 1e3)
    tip = given.tip_radius_mm * 1e-3
    mass = None if given.mass_mg is None else given.mass_mg * 1e-6
    nominal = dust == Dust() and mass is None and not given.sphere
    run_drop(dust, tip, 0.1, Numerics(cells=3.0))  # compiles
    columns = {}
    for speed in given.speed:
        for cells in given.cells:
            numerics = Numerics(
                cells, given.growth, given.even, given.width, given.depth, given.courant, given.linear,
                given.quadratic, given.hourglass,
            )  # fmt: skip
            began = time.process_time()
            try:
                found = run_drop(dust, tip, speed, numerics, mass, given.sphere)
            except RuntimeError as error:
                print(f"{speed:g} m/s, a/dx {cells:g}: {error}")
                continue
            limits = find_limits(given.tip_radius_mm, speed) if nominal else None
            seconds = time.process_time() - began
            columns[f"{speed:g} m/s, a/dx {cells:g}"] = describe(found, seconds, tip, cells, limits)
            if given.output:
                append_row(given.output, found, given.tip_radius_mm, speed, dust, cells)
    print(
        f"tip radius {given.tip_radius_mm:g} mm, p_m {dust.p_m:g} Pa, K0 {dust.bulk_modulus * 1e-3:g} kPa; ",
        end="",
    )
    print(
        "in brackets % from the limit of the independent solver; energies in % of the kinetic one at contact\n"
    )
    print_table(columns)


if __name__ == "__main__":
    main()
