"""Render horizontal CT slices of the dust and the bead in it, from points that carry volume and filling factor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import tifffile
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import gaussian_filter

SOLID = 2000.0  # kg/m^3
VOXEL = 40e-6  # m
SLICES = 108
SIZE = 104  # px
SURFACE_SLICE = 22
GREY_AIR = 12.0
GREY_PER_DENSITY = 0.16
NOISE = 3.0  # grey levels
FULL = 0.85  # share of the room that points fill inside the dust, at least
BLUR = 0.8  # voxels, point spread of a sound scan within a slice
GLASS = 2540.0  # kg/m^3


def deposit(r, z, volume, h, shape, z0):
    """Sum of volumes on nodes by quadratic B-splines; what falls left of the axis is folded back."""
    total = np.zeros((shape[0] + 1, shape[1]))
    x, y = r / h, (z - z0) / h
    i, j = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    fx, fy = x - i, y - j
    wx = (0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1.0) ** 2, 0.5 * (fx - 0.5) ** 2)
    wy = (0.5 * (1.5 - fy) ** 2, 0.75 - (fy - 1.0) ** 2, 0.5 * (fy - 0.5) ** 2)
    for a in range(3):
        for b in range(3):
            inside = (i + a < shape[0]) & (j + b >= 0) & (j + b < shape[1])
            np.add.at(total, (i[inside] + a + 1, j[inside] + b), (volume * wx[a] * wy[b])[inside])
    total[2] += total[0]
    return total[1:]


def map_density(
    points: np.ndarray, fill: Callable[[np.ndarray], np.ndarray], tip: float, radius: float, h: float
):
    """Density of the dust (kg/m^3) on an r-z grid: φ of the points there times the share of the room they fill.

    points : (k, 4) r, z, volume, φ; fill : φ before the drop at a depth; tip : depth of the bead's lowest point. SI.
    """
    top = radius * 1.5
    bottom = points[:, 1].min()
    z0 = np.floor(bottom / h) * h
    shape = (int(points[:, 0].max() / h) - 2, int((top - z0) / h))
    volume = deposit(points[:, 0], points[:, 1], points[:, 2], h, shape, z0)
    dust_volume = deposit(points[:, 0], points[:, 1], points[:, 2] * points[:, 3], h, shape, z0)
    fine = h / 6
    r, z = np.meshgrid(
        (np.arange(int(shape[0] * 6)) + 0.5) * fine,
        z0 + (np.arange(shape[1] * 6) + 0.5) * fine,
        indexing="ij",
    )
    everywhere = deposit(r.ravel(), z.ravel(), 2 * np.pi * r.ravel() * fine**2, h, shape, z0)
    in_bead = np.hypot(r, z + tip - radius) < radius
    bead = deposit(r[in_bead], z[in_bead], 2 * np.pi * r[in_bead] * fine**2, h, shape, z0)
    room = np.maximum(everywhere - bead, 0.05 * everywhere)
    with np.errstate(invalid="ignore"):
        phi = np.where(volume > 0.0, dust_volume / volume, 0.0)
    # points that flowed leave gaps and overlaps of some percent; only the free surface is emptier than that
    density = phi * SOLID * np.minimum(volume / (FULL * room), 1.0)
    # the last cells at the domain's edges are incomplete
    nodes_z = z0 + np.arange(shape[1]) * h
    undisturbed = np.where(nodes_z < 0.0, fill(np.maximum(-nodes_z, 0.0)) * SOLID, 0.0)
    density[:, :3] = undisturbed[:3]
    return RegularGridInterpolator(
        (np.arange(shape[0]) * h, nodes_z), density, bounds_error=False, fill_value=np.nan
    )


def write_scan(
    folder: Path,
    points: np.ndarray,
    fill: Callable[[np.ndarray], np.ndarray],
    tip: float,
    radius: float,
    mass: float,
    speed: float,
    h: float,
    rng: np.random.Generator,
    scale: float = 1.0,
    blur: float | None = None,
) -> dict:
    """Write scan.toml and the slices. points, fill, tip, h : as in ``map_density``, tip where the bead rests; blur in m, the
    standard deviation of a Gaussian."""
    (folder / "slices").mkdir(parents=True)
    axis = SIZE / 2 + rng.uniform(-5.0, 5.0, 2)  # x, y
    y, x, k = np.meshgrid(np.arange(SIZE), np.arange(SIZE), np.arange(SLICES), indexing="ij")
    r = np.hypot(x - axis[0], y - axis[1]) * VOXEL
    z = (SURFACE_SLICE - k) * VOXEL
    density = map_density(points, fill, tip, radius, h)(np.stack([r, z], axis=-1))
    beyond = np.where(z > 0.0, 0.0, np.where(z == 0.0, 0.5, 1.0) * fill(np.maximum(-z, 0.0)) * SOLID)
    density = np.where(np.isnan(density), beyond, density)
    across = np.sqrt(np.maximum(radius**2 - (z + tip - radius) ** 2, 0.0))
    covered = np.where(across > 0.0, np.clip(0.5 - (r - across) / VOXEL, 0.0, 1.0), 0.0)
    density = covered * GLASS + (1.0 - covered) * density
    # a sound scan is sharp from slice to slice, as the labelled ones are; a bad one is blurred all round
    spread = (BLUR, BLUR, 0.0) if blur is None else (blur / VOXEL,) * 3
    density = gaussian_filter(density, spread, mode="nearest")
    grey = GREY_AIR + GREY_PER_DENSITY * scale * density + rng.normal(0.0, NOISE, density.shape)
    grey = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    for level in range(SLICES):
        tifffile.imwrite(folder / "slices" / f"slice_{level:04d}.tif", grey[:, :, level])
    stated = speed * (1.0 + 0.05 * rng.normal())
    (folder / "scan.toml").write_text(
        f"""[projectile]
shape = "sphere"
radius_mm = {radius * 1e3:.3f}
mass_mg = {mass * 1e6:.4f}

[drop]
speed_m_s = {stated:.3f}
speed_sigma_m_s = {0.05 * stated:.3f}

[scan]
slices = "slices"
voxel_um = {VOXEL * 1e6:.1f}
first_slice = "top"
bits = 8

[calibration]
grey_air = {GREY_AIR}
grey_per_density = {GREY_PER_DENSITY:.4f}   # grey levels per kg/m3; levels above 255 saturate
density_solid_kg_m3 = {SOLID}
"""
    )
    return {"axis_px": list(map(float, axis)), "tip_z_mm": -tip * 1e3, "true_v0": speed}
