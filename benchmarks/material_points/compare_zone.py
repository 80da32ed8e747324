"""Set the dust under a bead at its stop, as this solver leaves it, beside labsim's SPH at several spacings.

    python -m benchmarks.material_points.compare_zone [--cells 8,12,16]

Prints, per case and solver: depth, what the dust holds more than before in volumes of dust that fill the bead, and φ - φ0 in
thousandths within half a radius of the axis, by distance below the tip, and beside the bead.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.material_points.drop import Body, Dust, Numerics, run_drop
from labsim.records import FloatArray, Material, Projectile
from labsim.sph import DropSetting, simulate

RADIUS, MASS = 0.5e-3, 1.32994e-6  # m, kg
FILLING = 0.15
CASES = {  # speed m/s, p_m Pa, shear factor, Δ
    "nominal, 0.65 m/s": (0.65, 1300.0, 1.0, 0.58),
    "soft, p_m 700 Pa, 0.75 m/s": (0.75, 700.0, 1.0, 0.58),
    "little shear strength, 0.78 m/s": (0.776, 1250.0, 0.6, 0.58),
    "steep, Δ 0.85, 0.78 m/s": (0.776, 1300.0, 1.0, 0.85),
}
# (lowest, highest above the tip; nearest, furthest from the axis), in radii
ZONES = {
    "0 to ½ below": (-0.5, 0.0, 0.0, 0.5),
    "½ to 1": (-1.0, -0.5, 0.0, 0.5),
    "1 to 1½": (-1.5, -1.0, 0.0, 0.5),
    "1½ to 2½": (-2.5, -1.5, 0.0, 0.5),
    "beside, 1 to 1½": (0.0, 1.0, 1.0, 1.5),
    "beside, 1½ to 2": (0.0, 1.0, 1.5, 2.0),
}


def describe(r: FloatArray, z: FloatArray, volume: FloatArray, phi: FloatArray, depth: float) -> str:
    """One row's figures from the points' places (m, z upwards from the surface), volumes and filling factors."""
    more = volume * (phi - FILLING)
    across, above = r / RADIUS, (z + depth) / RADIUS
    texts = [f"{depth * 1e3:.3f}", f"{more.sum() / (FILLING * 4 / 3 * np.pi * RADIUS**3):.2f}"]
    for low, high, near, far in ZONES.values():
        inside = (above > low) & (above < high) & (across >= near) & (across < far)
        texts.append(f"{1e3 * more[inside].sum() / volume[inside].sum():.1f}")
    return " | ".join(texts)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", default="8,12,16")
    cells = [float(text) for text in parser.parse_args().cells.split(",")]
    print("| case | solver, a/dx | D mm | excess | " + " | ".join(ZONES) + " |")
    for case, (speed, p_m, shear, delta) in CASES.items():
        dust = Dust(p_m=p_m, shear_factor=shear, delta=delta)
        material = Material(p_m=p_m, shear_factor=shear, delta=delta)
        for number in cells:
            found = run_drop(
                dust,
                Body(radius=RADIUS, mass=MASS, sphere=True),
                speed,
                Numerics(cells=number, width=6.0),
                stop_factor=1.0,
                reach=1.4e-3,
            )
            points = found.points.T
            print(f"| {case} | points, {number:g} | {describe(*points, found.stopping_depth)} |", flush=True)
        for number in cells:
            bead = Projectile("sphere", RADIUS, MASS)
            run = simulate(
                DropSetting(bead, speed, material, spacing=RADIUS / number, after_stop=0.0)
            )  # fmt: skip
            at = run.particles
            row = describe(at.r, at.z, at.volume, at.filling_factor, run.penetration_depth)
            print(f"| {case} | SPH, {number:g} | {row} |", flush=True)


if __name__ == "__main__":
    main()
