"""How much dust is compacted beyond a filling factor, from the averaged map and never from noisy voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..records import CompressedVolume, FillingMap, FloatArray

THRESHOLDS = np.round(np.arange(0.10, 0.4501, 0.005), 3)
DRAWS = 60
FINER = 4  # sub-cells along an edge of a cell


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
    s = np.where(inside, np.nan_to_num(sigma), 0.0)
    refined, parts = _refine(scan_map, inside)

    def count(values: FloatArray) -> FloatArray:
        fine = refined(values)
        order = np.argsort(fine)
        above = np.append(np.cumsum(parts[order][::-1])[::-1], 0.0)
        return above[np.searchsorted(fine[order], thresholds, side="right")]

    rng = np.random.default_rng(seed)
    once = count(phi)
    drawn = np.array([count(phi + s * rng.standard_normal(s.shape)) for _ in range(DRAWS)])
    volume = np.maximum(2 * once - drawn.mean(0), 0.0)
    # where noise makes most of the count (beside the undisturbed level) the extrapolation has no ground to stand on
    volume = np.where(drawn.mean(0) > 2 * once, once, volume)
    filled = inside & ~np.isfinite(scan_map.filling_factor)
    guard = np.array([volumes[filled & (phi > t)].sum() for t in thresholds])
    spread = np.sqrt(drawn.var(0) + (0.15 * guard) ** 2)
    sphere = 4 / 3 * np.pi * scan_map.bead_radius**3
    return CompressedVolume(np.asarray(thresholds, float), np.minimum.accumulate(volume), spread, sphere)


def _refine(scan_map: FillingMap, inside: np.ndarray):
    """Function (map -> values of sub-cells) and the volume of every sub-cell, m^3: FINER^2 a cell, bilinear between centres.

    A contour cuts cells; counting whole ones would make the curve jump. Sub-cells in the bead are left out.
    """
    nz, nr = inside.shape
    part = (np.arange(FINER) + 0.5) / FINER - 0.5
    rows = (np.arange(nz)[:, None] + part).ravel()
    columns = (np.arange(nr)[:, None] + part).ravel()
    dr, dz = _edge(scan_map.r)[0], _edge(-scan_map.z)[0]
    r, z = scan_map.r[0] + columns * dr, scan_map.z[0] - rows * dz
    use = np.repeat(np.repeat(inside, FINER, 0), FINER, 1) & (z < 0)[:, None]
    centre = -scan_map.tip_depth + scan_map.bead_radius
    use &= np.hypot(r[None, :], (z - centre)[:, None]) > scan_map.bead_radius
    volume = np.broadcast_to(2 * np.pi * r * dr * dz / FINER**2, use.shape)[use]
    nearest = distance_transform_edt(~inside, return_distances=False, return_indices=True)
    i, j = np.clip(np.floor(rows).astype(int), 0, nz - 2), np.clip(np.floor(columns).astype(int), 0, nr - 2)
    y, x = np.clip(rows - i, 0, 1)[:, None], np.clip(columns - j, 0, 1)[None, :]

    def refined(values: FloatArray) -> FloatArray:
        v = values[tuple(nearest)]
        low = v[i][:, j] * (1 - x) + v[i][:, j + 1] * x
        high = v[i + 1][:, j] * (1 - x) + v[i + 1][:, j + 1] * x
        return (low * (1 - y) + high * y)[use]

    return refined, volume


def fill_guard(scan_map: FillingMap) -> tuple[FloatArray, FloatArray]:
    """Map and sigma with the dust in the bead's guard taken from the first four cells outside along the ray from the bead.

    Cells of the bead itself, and of the hole above it, stay NaN. Shapes (nz, nr).
    """
    phi, sigma = scan_map.filling_factor.copy(), scan_map.sigma.copy()
    centre = -scan_map.tip_depth + scan_map.bead_radius
    r, z = np.meshgrid(scan_map.r, scan_map.z - centre)
    distance = np.hypot(r, z)
    dr, dz = _edge(scan_map.r)[0], _edge(-scan_map.z)[0]
    known = scan_map.filling_factor
    for i, j in np.argwhere(
        ~np.isfinite(phi) & (distance > scan_map.bead_radius) & (scan_map.z < 0)[:, None]
    ):
        reached, values, errors = [], [], []
        for step in np.arange(1, 16) * 0.5 * dr:
            share = 1 + step / distance[i, j]
            jj = round(float((share * r[i, j] - scan_map.r[0]) / dr))
            ii = round(float(i + (1 - share) * z[i, j] / dz))
            if not (0 <= ii < known.shape[0] and 0 <= jj < known.shape[1]):
                break
            where = float(distance[ii, jj])
            if np.isfinite(known[ii, jj]) and where not in reached:
                reached.append(where)
                values.append(known[ii, jj])
                errors.append(scan_map.sigma[ii, jj])
            if len(reached) == 4:
                break
        if not values:
            continue
        phi[i, j], sigma[i, j] = values[0], errors[0]
        if (
            len(values) == 4
        ):  # dust grows denser towards the bead: follow the slope, which the first four cells give
            lever = np.array(reached) - reached[0]
            line, covariance = np.polyfit(lever, values, 1), np.mean(errors) ** 2 / (lever.var() * 4)
            back = distance[i, j] - reached[0]
            phi[i, j] = float(np.clip(line[1] + line[0] * back, 0, max(values) + 0.1))
            sigma[i, j] = float(np.sqrt(errors[0] ** 2 + covariance * back**2))
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
    unseen = below & ~np.isfinite(scan_map.filling_factor)
    random = np.nansum((np.where(below, sigma, 0.0) * volumes / undisturbed) ** 2)
    # the extrapolated dust may be off by a third of its excess, all of it in the same direction
    spread = float(np.sqrt(random + (np.abs(excess[unseen]).sum() / 3) ** 2))
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
