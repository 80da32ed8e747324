"""The nine drops of an independent axisymmetric material-point solver against labsim's SPH.

    python -m benchmarks.solver.independent_curves [A_OVER_DX ...]

For each number of spacings in a tip radius: depth and stopping time at the same p_m, then one p_m refitted to all
nine curves (local logarithmic slope from a second set of runs) and the rms of what is left, in % of each depth.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

TABLE = Path(__file__).parents[2] / "data" / "reference" / "independent_curves.csv"
STOPS = TABLE.with_name(
    "independent_stops.csv"
)  # D, T_s and compacted volumes; a curve goes on a little after the stop
BEAD_DENSITY = 2540.0


def set_drop(radius: float, speed: float, p_m: float, cells: float) -> DropSetting:
    mass = BEAD_DENSITY * 4 / 3 * math.pi * radius**3
    material = Material(p_m=p_m)
    return DropSetting(Projectile("hemisphere", radius, mass), speed, material, spacing=radius / cells)


def compare(cells: float) -> None:
    table = pd.read_csv(TABLE)
    stops = pd.read_csv(STOPS).set_index(["tip_radius_mm", "speed_m_s"])
    rows, ratio, slope, sizes = [], [], [], []
    for (radius, speed), group in table.groupby(["tip_radius_mm", "speed_m_s"]):
        time = group["time_ms"].to_numpy() * 1e-3
        limit = group["depth_mm_limit"].to_numpy() * 1e-3
        base = simulate(set_drop(radius * 1e-3, speed, 1300.0, cells))
        soft = simulate(set_drop(radius * 1e-3, speed, 1300.0 / 1.2, cells))
        mine, other = base.depth_at(time), soft.depth_at(time)
        depth = limit[-1]
        ratio.append((mine - limit) / depth)
        slope.append((other - mine) / depth / math.log(1 / 1.2))
        sizes.append(len(time))
        rows.append(
            {
                "a_mm": radius,
                "v_m_s": speed,
                "D_mm": base.penetration_depth * 1e3,
                "D_error_%": 100 * (base.penetration_depth / depth - 1),
                "T_ms": base.stopping_time * 1e3,
                "T_error_%": 100
                * (1e3 * base.stopping_time / stops.stopping_time_ms_limit[radius, speed] - 1),
                "V20": base.compacted_volume(0.2) / (4 / 3 * math.pi * (radius * 1e-3) ** 3),
                "energy_error_%": 100 * base.energy_error,
                "steps": base.steps,
                "wall_s": base.wall,
            }
        )
    weights = np.concatenate([np.full(n, 1 / math.sqrt(n)) for n in sizes])
    left, tangent = np.concatenate(ratio), np.concatenate(slope)
    shift = -np.sum(weights**2 * left * tangent) / np.sum(weights**2 * tangent**2)
    rms = [100 * math.sqrt(np.mean((r + shift * s) ** 2)) for r, s in zip(ratio, slope, strict=True)]
    frame = pd.DataFrame(rows)
    frame["left_%"] = rms
    print(f"a/dx = {cells:g}")
    print(frame.to_string(index=False, float_format=lambda x: f"{x:.3f}"))
    print(
        f"p_m refitted: {1300 * math.exp(shift):.0f} Pa, left {math.sqrt(np.mean(np.square(rms))):.2f} % of D rms\n",
        flush=True,
    )


if __name__ == "__main__":
    for argument in sys.argv[1:] or ["8"]:
        compare(float(argument))
