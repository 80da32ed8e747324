"""How far the solver's deceleration is known: three spacings of a few drops, and what the code of a run keeps of it.

    python benchmarks/acceleration_error.py

Bins of 1/BINS of the stopping time, mean specific force over each, as the likelihood compares it. Shares of the largest bin.
"""

from __future__ import annotations

import math

import numpy as np

from labsim.inference.curves import decode_speed, encode_speeds
from labsim.records import STANDARD_GRAVITY, Material, Projectile
from labsim.sph import DropSetting, simulate

BINS = 40
CELLS = (5, 8, 11)
DROPS = (
    (0.5e-3, 0.4, 1300.0),
    (1.0e-3, 0.8, 1300.0),
    (2.5e-3, 1.5, 1300.0),
    (1.0e-3, 1.6, 800.0),
)  # m, m/s, Pa
DENSITY = 2540.0  # kg/m³


def bin_force(speed_at, edges):
    speed = speed_at(edges)
    return STANDARD_GRAVITY - np.diff(speed) / np.diff(edges)


def main() -> None:
    for radius, speed, p_m in DROPS:
        mass = DENSITY * 4 / 3 * math.pi * radius**3
        runs = [
            simulate(
                DropSetting(
                    Projectile("hemisphere", radius, mass), speed, Material(p_m=p_m), spacing=radius / cells
                )
            )
            for cells in CELLS
        ]
        edges = np.linspace(0.0, runs[-1].stopping_time, BINS + 1)
        own = [bin_force(lambda t, run=run: np.interp(t, run.time, run.velocity), edges) for run in runs]
        kept = [bin_force(lambda t, run=run: decode_speed(encode_speeds(run), t), edges) for run in runs]
        scaled = [
            bin_force(
                lambda t, run=run: np.interp(t, run.time, run.velocity),
                edges * run.stopping_time / edges[-1],
            )
            for run in runs
        ]
        peak = own[-1].max()
        print(f"a {radius * 1e3:g} mm, {speed:g} m/s, p_m {p_m:g} Pa: peak {peak / STANDARD_GRAVITY:.1f} g")
        for cells, run, mine, code, rate in zip(CELLS, runs, own, kept, scaled, strict=True):
            off = (code - mine) / peak
            far = (mine - own[-1]) / peak
            same = (rate - scaled[-1]) / peak
            near = np.corrcoef(same[:-1], same[1:])[0, 1] if cells != CELLS[-1] else math.nan
            print(
                f"  a/dx {cells:2d}: D {run.penetration_depth * 1e3:.3f} mm, T {run.stopping_time * 1e3:.3f} ms"
            )
            print(
                f"    code - run: rms {100 * np.sqrt(np.mean(off**2)):.2f} %, first bin {100 * off[0]:.2f}, last "
                f"{100 * off[-1]:.2f}; against the finest: rms {100 * np.sqrt(np.mean(far**2)):.2f} %, at equal t/T "
                f"{100 * np.sqrt(np.mean(same**2)):.2f} %, neighbours alike {near:.2f}"
            )
            print("    ", np.round(100 * same[::4], 1), np.round(mine[::4] / STANDARD_GRAVITY, 1))


if __name__ == "__main__":
    main()
