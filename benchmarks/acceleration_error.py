"""How far the solver's deceleration is known: fourteen drops beside a Lagrangian mesh, and what the code of a run keeps of it.

    python benchmarks/acceleration_error.py

Mean specific force over each fortieth of the stopping time, as the likelihood compares it, at equal shares of each run's own
stopping time, in % of the largest; a mean over the drop is p_m's and is taken off. The mesh (benchmarks/lagrangian_mesh) has 16
cells in a tip radius, and 20 to say how far it is known itself.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np

from labsim.inference.curves import decode_speed, encode_speeds
from labsim.inference.observe_acceleration import BINS, COMPARED
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

sys.path.append(str(Path(__file__).parent / "lagrangian_mesh"))
import mesh

CELLS = (5, 8, 11)
# radius (m), mass over a bead's, speed (m/s)
DROPS = (
    (0.5e-3, 1.0, 0.60),
    (0.75e-3, 1.0, 0.30),
    (0.75e-3, 1.0, 0.50),
    (0.75e-3, 2.5, 0.30),
    (1.5e-3, 1.0, 0.25),
    (1.5e-3, 1.0, 0.42),
    (1.5e-3, 2.5, 0.22),
)
STRENGTHS = (1000.0, 2200.0)  # Pa
LAGS = (1, 2, 4, 8)  # stretches


def bin_force(speed_at: Callable[[np.ndarray], np.ndarray], stop: float) -> np.ndarray:
    """Mean deceleration (m/s²) over each stretch."""
    edges = np.linspace(0.0, stop, BINS + 1)
    return -np.diff(speed_at(edges)) / np.diff(edges)


def main() -> None:
    compared = round(COMPARED * BINS)
    rows: dict[str, list[np.ndarray]] = {}
    for (radius, heavier, speed), p_m in product(DROPS, STRENGTHS):
        mass = mesh.BEAD_DENSITY * 4 / 3 * math.pi * radius**3 * heavier
        reference = {}
        for cells in (16.0, 20.0):
            run = mesh.run_drop(mesh.Dust(p_m=p_m), radius, speed, mesh.Numerics(cells=cells), mass=mass)
            reference[cells] = bin_force(
                lambda t, run=run: np.interp(t, run.time, run.speed), run.stopping_time
            )
        peak = reference[16.0].max()
        rows.setdefault("mesh, 20 cells", []).append((reference[20.0] - reference[16.0]) / peak)
        for cells in CELLS:
            own = simulate(
                DropSetting(
                    Projectile("hemisphere", radius, mass), speed, Material(p_m=p_m), spacing=radius / cells
                )
            )
            plain = bin_force(lambda t, own=own: np.interp(t, own.time, own.velocity), own.stopping_time)
            code = encode_speeds(own)
            kept = bin_force(lambda t, code=code: decode_speed(code, t), own.stopping_time)
            rows.setdefault(f"labsim, {cells} spacings", []).append((plain - reference[16.0]) / peak)
            rows.setdefault(f"its code, {cells} spacings", []).append((kept - reference[16.0]) / peak)
    print("| beside the mesh of 16 cells | rms, % of the peak | of the mean over the drops | correlation after "
          + ", ".join(map(str, LAGS)) + " stretches |\n|---|---|---|---|")  # fmt: skip
    for name, each in rows.items():
        off = np.array(each)[:, :compared]
        off = off - off.mean(axis=1, keepdims=True)
        alike = [float(np.mean(off[:, lag:] * off[:, :-lag]) / np.mean(off**2)) for lag in LAGS]
        print(
            f"| {name} | {100 * off.std():.2f} | {100 * off.mean(axis=0).std():.2f} | "
            + ", ".join(f"{one:.2f}" for one in alike)
            + " |"
        )


if __name__ == "__main__":
    main()
