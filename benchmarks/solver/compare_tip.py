"""The dust at the tip by three methods: labsim's SPH, material points, a Lagrangian mesh.

    python -m benchmarks.solver.compare_tip                                      # the table
    python -m benchmarks.solver.compare_tip -o docs/pictures/tip.png             # and φ(r, z) at the tip side by side
    python -m benchmarks.solver.compare_tip --speed 0.20 --cells 12

The end of a rod, 0.5 mm in radius and of a glass bead's mass, at 0.65 m/s into nominal dust (p_m 1300 Pa, K0 45 kPa),
eight spacings in a radius, unless said otherwise. Every method has the same law and is asked the same questions
(benchmarks/lagrangian_mesh/tip.py). Prints Markdown.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import cKDTree

from benchmarks.lagrangian_mesh import mesh
from benchmarks.lagrangian_mesh.tip import measure_tip, print_table
from benchmarks.material_points import drop as material_points
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

COLOURS = (0.15, 0.30)  # φ at the ends of the scale
PIXEL = 0.05  # of a spacing


@dataclass(frozen=True)
class Given:
    radius: float
    speed: float
    p_m: float
    bulk_modulus: float
    cells: float

    @property
    def spacing(self) -> float:
        return self.radius / self.cells


@dataclass(frozen=True)
class Found:
    """Depth (m), stopping time, CPU seconds; the dust at the stop, arrays (n,), and the corners of its cells if it has any."""

    depth: float
    stopping_time: float
    seconds: float
    r: np.ndarray
    z: np.ndarray
    volume: np.ndarray
    phi: np.ndarray
    corners: np.ndarray | None = None  # (n, 4, 2)


def run_sph(given: Given) -> Found:
    mass = mesh.BEAD_DENSITY * 4 / 3 * math.pi * given.radius**3
    material = Material(p_m=given.p_m, bulk_modulus=given.bulk_modulus)
    setting = DropSetting(
        Projectile("hemisphere", given.radius, mass), given.speed, material, spacing=given.spacing
    )
    began = time.process_time()
    run = simulate(setting)
    dust = run.particles
    return Found(
        run.penetration_depth, run.stopping_time, time.process_time() - began,
        dust.r, dust.z, dust.volume, dust.filling_factor,
    )  # fmt: skip


def run_material_points(given: Given) -> Found:
    mass = mesh.BEAD_DENSITY * 4 / 3 * math.pi * given.radius**3
    began = time.process_time()
    run = material_points.run_drop(
        material_points.Dust(p_m=given.p_m, bulk_modulus=given.bulk_modulus),
        material_points.Body(radius=given.radius, mass=mass),
        given.speed,
        material_points.Numerics(cells=given.cells),
        stop_factor=1.0,
    )
    seconds = time.process_time() - began
    return Found(run.stopping_depth, run.stopping_time, seconds, *run.points.T)


def run_mesh(given: Given) -> Found:
    began = time.process_time()
    run = mesh.run_drop(
        mesh.Dust(p_m=given.p_m, bulk_modulus=given.bulk_modulus),
        given.radius,
        given.speed,
        mesh.Numerics(cells=given.cells),
    )
    seconds = time.process_time() - began
    nodes = np.stack([run.nodes_r, run.nodes_z], axis=-1)
    corners = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=2)
    return Found(
        run.stopping_depth, run.stopping_time, seconds,
        run.r.ravel(), run.z.ravel(), run.volume.ravel(), run.phi.ravel(), corners.reshape(-1, 4, 2),
    )  # fmt: skip


METHODS = {"SPH": run_sph, "material points": run_material_points, "Lagrangian mesh": run_mesh}


def draw(found: dict[str, Found], given: Given) -> Figure:
    """φ(r, z) around the tip: a point of the picture has the φ of the nearest particle, or of the cell it lies in."""
    figure, axes = plt.subplots(1, len(found), figsize=(11, 5.2), sharey=True, layout="constrained")
    low, high = COLOURS
    for ax, (name, run) in zip(axes, found.items(), strict=True):
        ax.set_facecolor("0.95")
        edges = np.array([0.0, 1.8, -run.depth / given.radius - 1.2, 0.3]) * given.radius
        if run.corners is None:
            step = PIXEL * given.spacing
            r, z = np.meshgrid(np.arange(edges[0], edges[1], step), np.arange(edges[2], edges[3], step))
            away, nearest = cKDTree(np.column_stack([run.r, run.z])).query(
                np.column_stack([r.ravel(), z.ravel()])
            )
            phi = np.where(away < 0.75 * given.spacing, run.phi[nearest], np.nan).reshape(r.shape)
            image = ax.imshow(
                phi,
                cmap="viridis",
                vmin=low,
                vmax=high,
                origin="lower",
                extent=1e3 * edges,
                interpolation="nearest",
            )
        else:
            cells = PolyCollection(
                1e3 * run.corners, array=run.phi, cmap="viridis", clim=(low, high), edgecolors="face", lw=0.2
            )
            image = ax.add_collection(cells)
        tip = 1e3 * (given.radius - run.depth)
        angle = np.linspace(-0.5 * np.pi, 0.0, 90)
        outline = 1e3 * given.radius * np.column_stack([np.cos(angle), np.sin(angle)]) + [0.0, tip]
        top = [[outline[-1, 0], 1e3 * edges[3]], [0.0, 1e3 * edges[3]]]
        ax.add_patch(Polygon(np.vstack([outline, top]), fc="white", ec="black", lw=0.8))
        ax.set(xlim=1e3 * edges[:2], ylim=1e3 * edges[2:], xlabel="r, mm", aspect="equal")
        ax.set_title(f"{name}: φ ≤ {run.phi.max():.2f}")
    axes[0].set_ylabel("z, mm")
    figure.colorbar(image, ax=axes, label="filling factor φ", extend="max", shrink=0.8)
    figure.suptitle(
        f"tip radius {1e3 * given.radius:g} mm, {given.speed:g} m/s, p_m {given.p_m:g} Pa, "
        f"K0 {1e-3 * given.bulk_modulus:g} kPa, {given.cells:g} spacings in a radius, at the stop"
    )
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tip-radius-mm", type=float, default=0.5)
    parser.add_argument(
        "--speed", type=float, default=0.65, help="m/s; the mesh serves to 1.5 tip radii of depth"
    )
    parser.add_argument("--p-m", type=float, default=1300.0, help="Pa")
    parser.add_argument("--bulk-modulus-kpa", type=float, default=45.0)
    parser.add_argument("--cells", type=float, default=8.0, help="spacings in a tip radius")
    parser.add_argument("-o", "--output", type=Path, help="picture")
    options = parser.parse_args()
    given = Given(
        options.tip_radius_mm * 1e-3,
        options.speed,
        options.p_m,
        options.bulk_modulus_kpa * 1e3,
        options.cells,
    )
    found, columns = {}, {}
    for name, run in METHODS.items():
        run(Given(given.radius, 0.1, given.p_m, given.bulk_modulus, 4.0))  # compiles
        found[name] = run(given)
        at = found[name]
        figures = measure_tip(at.r, at.z, at.volume, at.phi, at.depth, given.radius, given.spacing)
        columns[name] = {
            "D mm": f"{1e3 * at.depth:.4f}",
            "T_s ms": f"{1e3 * at.stopping_time:.3f}",
            **{key: f"{value:.3f}" for key, value in figures.items()},
            "CPU s": f"{at.seconds:.2f}",
        }
    print_table(columns)
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        draw(found, given).savefig(options.output, dpi=110)


if __name__ == "__main__":
    main()
