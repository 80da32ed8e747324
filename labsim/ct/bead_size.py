"""The bead as a ruler: its radius, its height over its width and its density against what scan.toml states."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.special import erfc

from ..records import FloatArray, Measured, Scan
from .bead_edge import REACH, WIDE

BAND = (
    0.85  # cosine to the vertical up to which the edge counts: the poles tell blur along the axis, not size
)
# relative, of radius and of height over width; 24 labelled scans with saturated beads are off by at most 0.8 and 0.7 %
RADIUS_OFF, HEIGHT_OFF = 0.03, 0.025
# voxels, more where the edge is cut far below its middle: for a grey level of once the range, and for every further range
CLIPPED_RADIUS, CLIPPED_HEIGHT = (0.15, 0.12), (0.3, 0.25)
SURE = 4.0  # standard deviations of the fit
DENSITY_OFF = 1.35  # factor: attenuation per density of glasses differs by 1.2 from silica's, beam hardening takes as much
HEAVY = 12000.0  # kg/m^3, above lead


def measure_size(
    box: FloatArray, start: FloatArray, radius: float, level: float, top: float,
    directions: FloatArray, outside: FloatArray, tree: cKDTree,
) -> tuple[Measured, Measured] | None:  # fmt: skip
    """Radius across the axis in voxels, and height over width, of an ellipsoid of grey ``level``, blurred and clipped at ``top``.

    Blur along the axis is another than across. None where the edge is too wide for this (WIDE) or gives no fit.
    """
    index = np.stack(np.meshgrid(*(np.arange(n) for n in box.shape), indexing="ij"), -1).reshape(-1, 3)
    offset = index - start
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
    near = (np.abs(distance - radius) < REACH) & (np.abs(offset[:, 2]) < BAND * distance)
    if directions[:, 2].min() > 0:  # a rod hides the upper half
        near &= offset[:, 2] > 0.1 * distance
    if near.sum() < 200:
        return None
    background = outside[tree.query(offset[near] / distance[near, None])[1]]
    points, grey = index[near].astype(float), box.reshape(-1)[near]

    def misfit(q: FloatArray) -> FloatArray:
        d = (points - q[:3]) / np.array([1.0, 1.0, q[5]])
        far = np.linalg.norm(d, axis=1)
        upright = (d[:, 2] / far) ** 2
        blur = np.sqrt(q[3] ** 2 * (1 - upright) + q[6] ** 2 * upright)
        share = 0.5 * erfc((far - q[4]) / (np.sqrt(2) * blur))
        return np.minimum(background + (level - background) * share, top) - grey

    low = np.append(start - 3, [0.1, 0.6 * radius, 0.6, 0.1])
    high = np.append(start + 3, [4.0, 1.6 * radius, 1.6, 4.0])
    first = np.append(start, [0.7, radius, 1.0, 0.5])
    fit = least_squares(misfit, first, bounds=(low, high), loss="soft_l1", f_scale=0.05 * top, max_nfev=40)
    if fit.x[3] > WIDE:
        return None
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * 2 * fit.cost / max(len(grey) - 7, 1)
    sigma = np.sqrt(np.diag(covariance))
    return Measured(float(fit.x[4]), float(sigma[4])), Measured(float(fit.x[5]), float(sigma[5]))


def say_what_fits(scan: Scan, radius: float) -> str:
    """radius_mm and voxel_um that would make the bead ``radius`` voxels large."""
    return (
        f"radius_mm = {radius * scan.voxel * 1e3:.4g} or voxel_um = {scan.projectile.tip_radius / radius * 1e6:.4g} "
        "would fit"
    )


def warn_of_size(scan: Scan, radius: Measured, height: Measured | None, clipped: float | None) -> list[str]:
    """radius : voxels; height : over width; clipped : grey level of a saturated bead over the top of the range, else None."""
    stated = scan.projectile.tip_radius / scan.voxel

    def is_odd(ratio: float, sigma: float, least: float, voxels: tuple[float, float]) -> bool:
        cut = 0.0 if clipped is None else (voxels[0] + voxels[1] * max(clipped - 1, 0.0)) / stated
        return abs(ratio - 1) > max(least, cut) + SURE * sigma

    saturated = clipped is not None
    if is_odd(radius.value / stated, radius.sigma / stated, RADIUS_OFF, CLIPPED_RADIUS):
        by = (
            ", or another mass_mg: a saturated bead is measured at the grey level that its density would have"
        )
        return [
            f"the bead's radius is {radius.value:.2f} voxels but {stated:.2f} are stated: {say_what_fits(scan, radius.value)}"
            + (by if saturated else "")
        ]
    if height is not None and is_odd(height.value, height.sigma, HEIGHT_OFF, CLIPPED_HEIGHT):
        return [
            f"the bead is {height.value:.3f} times as high as it is wide: the slices lie {1 / height.value:.3f} pixels apart "
            f"({scan.voxel * 1e6 / height.value:.4g} µm), or some are lost or doubled; depths are off by as much, "
            "export cubic voxels"
        ]
    return []


def warn_of_density(scan: Scan, level: float, saturated: bool) -> list[str]:
    """The bead's mass and radius against its grey level: ``level`` as it reads, or the top of the range where it saturates."""
    if scan.projectile.tip != "sphere":
        return []
    radius, mass, calibration = scan.projectile.tip_radius, scan.projectile.mass, scan.calibration
    stated = mass / (4 / 3 * np.pi * radius**3)
    read = (level - calibration.grey_air) / calibration.grey_per_density
    if saturated and stated > HEAVY:
        return [
            f"mass_mg and radius_mm make {stated:.0f} kg/m³, more than lead: check mass_mg, and radius_mm with voxel_um, "
            "which the picture of a saturated bead cannot tell apart"
        ]
    if read <= 0 or (stated * DENSITY_OFF > read and (saturated or stated < DENSITY_OFF * read)):
        return []
    fits = (3 * mass / (4 * np.pi * read)) ** (1 / 3)
    reads = f"more than {read:.0f} kg/m³ (it saturates)" if saturated else f"{read:.0f} kg/m³"
    at = "below " if saturated else "= "
    return [
        f"the bead reads {reads}, but mass_mg and radius_mm make {stated:.0f}: radius_mm {at}{fits * 1e3:.4g} with "
        f"voxel_um {at}{fits / radius * scan.voxel * 1e6:.4g} would fit, or another mass or grey calibration"
    ]
