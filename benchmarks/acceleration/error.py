"""How far the solver's deceleration is known: fourteen drops beside a Lagrangian mesh, and what the features of a run keep of it.

    python -m benchmarks.acceleration.error

Mean specific force over each fortieth of the stopping time, as the likelihood compares it, at equal shares of each run's own
stopping time, in % of the largest; a mean over the drop is p_m's and is taken off. The mesh (benchmarks/lagrangian_mesh) has 16
cells in a tip radius, and 20 to say how far it is known itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise, product

import numpy as np

from benchmarks.lagrangian_mesh import mesh
from benchmarks.lagrangian_mesh.make_campaigns import SERIES
from labsim.inference.emulation.curves import extract_speeds, interpolate_speed
from labsim.inference.emulation.grid import FELT_CELLS, FELT_SPACINGS
from labsim.inference.observations.observe_acceleration import BINS, COMPARED
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

CELLS = (5, 8, 11)
# radius (m), mass over a bead's, speed (m/s): the drops of the mesh's campaigns, and a small rod
DROPS = ((0.5e-3, 1.0, 0.60), *SERIES)
STRENGTHS = (1000.0, 2200.0)  # Pa
LAGS = (1, 2, 4, 8)  # stretches
# by depth: radius (m), mass over a bead's; speeds (m/s) and p_m (Pa)
PROJECTILE = (0.75e-3, 1.0)
SPEEDS = (0.22, 0.26, 0.31, 0.36, 0.43, 0.52, 0.62, 0.74)
P_M = (1000.0, 1250.0, 1500.0, 1750.0, 2000.0, 2400.0)
BANDS = (0.4, 0.55, 0.75, 1.0, 1.3, 2.2)  # of depth over tip radius


def bin_force(speed_at: Callable[[np.ndarray], np.ndarray], stop: float) -> np.ndarray:
    """Mean deceleration (m/s²) over each stretch."""
    edges = np.linspace(0.0, stop, BINS + 1)
    return -np.diff(speed_at(edges)) / np.diff(edges)


def simulate_features(radius: float, mass: float, speed: float, p_m: float) -> np.ndarray:
    """What the likelihood compares, the mean over spacings."""
    setting = DropSetting(Projectile("hemisphere", radius, mass), speed, Material(p_m=p_m), after_stop=0.16)
    runs = [simulate(setting.replace(spacing=radius / FELT_CELLS * factor)) for factor in FELT_SPACINGS]
    return np.asarray(np.mean([extract_speeds(run) for run in runs], axis=0))


def find_force(features: np.ndarray) -> np.ndarray:
    return bin_force(lambda time: interpolate_speed(features, time), math.exp(features[1]))


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

        def keep(name: str, force: np.ndarray, reference=reference[16.0], peak=peak) -> None:
            rows.setdefault(name, []).append((force - reference) / peak)

        keep("mesh, 20 cells", reference[20.0])
        for cells in CELLS:
            own = simulate(
                DropSetting(
                    Projectile("hemisphere", radius, mass), speed, Material(p_m=p_m), spacing=radius / cells
                )
            )
            plain = bin_force(lambda t, own=own: np.interp(t, own.time, own.velocity), own.stopping_time)
            keep(f"labsim, {cells} spacings", plain)
            keep(f"its features, {cells} spacings", find_force(extract_speeds(own)))
        keep("the mean of two codes", find_force(simulate_features(radius, mass, speed, p_m)))
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


def compare_by_depth() -> None:
    """The mean of two codes beside the mesh, by how deep the tip goes."""
    radius, heavier = PROJECTILE
    mass = mesh.BEAD_DENSITY * 4 / 3 * math.pi * radius**3 * heavier
    depths, off = [], []
    for p_m, speed in product(P_M, SPEEDS):
        run = mesh.run_drop(mesh.Dust(p_m=p_m), radius, speed, mesh.Numerics(cells=12.0), mass=mass)
        reference = bin_force(lambda t, run=run: np.interp(t, run.time, run.speed), run.stopping_time)
        features = simulate_features(radius, mass, speed, p_m)
        depths.append(math.exp(features[0]) / radius)
        off.append(100 * (find_force(features) - reference) / reference.max())
    print(
        "\n| depth, tip radii | drops | rms, % of the peak | mean at tenths of the stop, % |\n|---|---|---|---|"
    )
    for low, high in pairwise(BANDS):
        some = np.array(off)[(np.array(depths) > low) & (np.array(depths) <= high)]
        if some.size:
            mean = some.mean(axis=0).reshape(10, -1).mean(axis=1)
            print(
                f"| {low} to {high} | {len(some)} | {some[:, : round(COMPARED * BINS)].std():.2f} | "
                + ", ".join(f"{one:.1f}" for one in mean)
                + " |"
            )


if __name__ == "__main__":
    main()
    compare_by_depth()
