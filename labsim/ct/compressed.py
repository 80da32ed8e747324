"""How much dust is compacted beyond a filling factor, from the averaged map and never from noisy voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import CompressedVolume, FillingMap, FloatArray

THRESHOLDS = np.round(np.arange(0.10, 0.4501, 0.005), 3)
DRAWS = 200


def cell_volumes(scan_map: FillingMap) -> FloatArray:
    """m^3 of every cell, (nz, nr): rings of the map's own edges."""
    dr, dz = _edge(scan_map.r), _edge(-scan_map.z)
    return dz[:, None] * (2 * np.pi * scan_map.r * dr)[None, :]


def compress(
    scan_map: FillingMap, *, thresholds: FloatArray = THRESHOLDS, reach: float | None = None, seed: int = 1
) -> CompressedVolume:
    """Volume of dust whose azimuthal mean is denser than each threshold.

    A cell at phi, known to sigma, counts with the probability that it is denser; what this smearing adds to a sloping
    map is taken off by smearing once more and extrapolating to none. sigma comes from redrawn maps and from the half
    cells at the rim of the guard. Cells in the guard count like their nearest cell outside, since the densest dust lies there.
    thresholds : (n,); reach : m, only cells nearer to the axis (default: all). Above the surface nothing counts.
    """
    phi, sigma = fill_guard(scan_map)
    volumes = cell_volumes(scan_map)
    inside = np.isfinite(phi) & (scan_map.z < 0)[:, None]
    if reach is not None:
        inside &= (scan_map.r < reach)[None, :]
    p, s, v = phi[inside], np.nan_to_num(sigma[inside]), volumes[inside]

    def count(values: FloatArray) -> FloatArray:
        order = np.argsort(values)
        above = np.append(np.cumsum(v[order][::-1])[::-1], 0.0)
        return above[np.searchsorted(values[order], thresholds, side="right")]

    rng = np.random.default_rng(seed)
    once = count(p)
    drawn = np.array([count(p + s * rng.standard_normal(len(p))) for _ in range(DRAWS)])
    volume = np.maximum(2 * once - drawn.mean(0), 0.0)
    # where noise makes most of the count (beside the undisturbed level) the extrapolation has no ground to stand on
    volume = np.where(drawn.mean(0) > 2 * once, once, volume)
    filled = inside & ~np.isfinite(scan_map.filling_factor)
    guard = np.array([volumes[filled & (phi > t)].sum() for t in thresholds])
    spread = np.sqrt(drawn.var(0) + (0.15 * guard) ** 2)
    sphere = 4 / 3 * np.pi * scan_map.bead_radius**3
    return CompressedVolume(np.asarray(thresholds, float), np.minimum.accumulate(volume), spread, sphere)


def fill_guard(scan_map: FillingMap) -> tuple[FloatArray, FloatArray]:
    """Map and sigma with the dust in the bead's guard taken from the nearest cell outside along the ray from the bead.

    Cells of the bead itself, and of the hole above it, stay NaN. Shapes (nz, nr).
    """
    phi, sigma = scan_map.filling_factor.copy(), scan_map.sigma.copy()
    centre = -scan_map.tip_depth + scan_map.bead_radius
    r, z = np.meshgrid(scan_map.r, scan_map.z - centre)
    distance = np.hypot(r, z)
    dr, dz = _edge(scan_map.r)[0], _edge(-scan_map.z)[0]
    for i, j in np.argwhere(~np.isfinite(phi) & (distance > scan_map.bead_radius)):
        if scan_map.z[i] > 0:
            continue
        for far in np.arange(1, 12) * 0.5 * dr + distance[i, j]:
            jj = round(float((far * r[i, j] / distance[i, j] - scan_map.r[0]) / dr))
            ii = round(float(i + (z[i, j] - far * z[i, j] / distance[i, j]) / dz))
            if not (0 <= ii < len(scan_map.z) and 0 <= jj < len(scan_map.r)):
                break
            if np.isfinite(scan_map.filling_factor[ii, jj]):
                phi[i, j], sigma[i, j] = scan_map.filling_factor[ii, jj], scan_map.sigma[ii, jj]
                break
    return phi, sigma


@dataclass(frozen=True)
class MassLedger:
    """Where the dust went that the bead displaced. All m^3 of dust at the undisturbed filling factor (divide masses by
    its density): displaced : swept by bead and crater below the surface; compacted : excess of the map below it;
    heaped : dust above the undisturbed surface. A closed ledger has displaced = compacted + heaped within sigma.
    """

    displaced: float
    compacted: float
    heaped: float
    sigma: float


def balance_mass(scan_map: FillingMap, undisturbed: float) -> MassLedger:
    """Integral of (phi - phi0) over the map against the dust displaced by the bead; the crater counts as displaced."""
    phi, sigma = fill_guard(scan_map)
    volumes = cell_volumes(scan_map)
    finite = np.isfinite(phi)
    below = finite & (scan_map.z < -0.5 * _edge(-scan_map.z)[0])[:, None]
    excess = np.where(below, (phi - undisturbed) * volumes, 0.0) / undisturbed
    above = finite & (scan_map.z > 3 * _edge(-scan_map.z)[0])[:, None]
    # noise does not cancel in a sum of the positive parts alone: only cells beyond 3 sigma are told apart
    sure = np.abs(phi - undisturbed) > 3 * np.nan_to_num(sigma, nan=np.inf)
    crater = -excess[(excess < 0) & sure].sum()
    net = excess.sum()
    heaped = float(np.where(above, phi * volumes, 0.0).sum() / undisturbed)
    r, h = scan_map.bead_radius, min(scan_map.tip_depth, 2 * scan_map.bead_radius)
    cap = np.pi * h * h * (3 * r - h) / 3
    spread = float(np.sqrt(np.nansum((np.where(below, sigma, 0.0) * volumes / undisturbed) ** 2)))
    return MassLedger(cap + float(crater), float(net + crater), heaped, spread)


def count_voxels(filling_factor: FloatArray, voxel: float, threshold: float = 0.2) -> float:
    """m^3 of voxels beyond the threshold. BIASED by voxel noise, several times too much; only to compare with old work."""
    return float((np.asarray(filling_factor) > threshold).sum() * voxel**3)


def coarsen(scan_map: FillingMap, factor: int) -> FillingMap:
    """The same map in cells ``factor`` times as large in r and z, weighted by volume; a cell with a NaN part is NaN.

    Neighbouring cells of the coarser map are more nearly independent. sigma as for independent cells.
    """
    nz, nr = (n // factor * factor for n in scan_map.filling_factor.shape)
    fold = (nz // factor, factor, nr // factor, factor)
    weight = cell_volumes(scan_map)[:nz, :nr].reshape(fold)
    total = weight.sum((1, 3))
    phi = (scan_map.filling_factor[:nz, :nr].reshape(fold) * weight).sum((1, 3)) / total
    sigma = np.sqrt(((scan_map.sigma[:nz, :nr].reshape(fold) * weight) ** 2).sum((1, 3))) / total
    count = scan_map.count[:nz, :nr].reshape(fold).sum((1, 3))
    r = scan_map.r[:nr].reshape(-1, factor).mean(1)
    z = scan_map.z[:nz].reshape(-1, factor).mean(1)
    return FillingMap(
        r, z, phi, sigma, np.where(np.isfinite(phi), count, 0), scan_map.tip_depth, scan_map.bead_radius,
        scan_map.axis_px, scan_map.warnings,
    )  # fmt: skip


def _edge(centres: FloatArray) -> FloatArray:
    return np.full(len(centres), float(np.mean(np.diff(centres))))
