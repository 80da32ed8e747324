"""The azimuthal mean about the axis of penetration, cell by cell, with errors from azimuth sectors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import FloatArray

SECTORS = 8
MORE_SCATTER = 1.5  # chi2 per undisturbed cell from which sigma is widened to it; honest ones have 1.0 +- 0.1
LEAST_SCATTER = (
    5e-4  # filling factor; less is what cupping and strain of the dust leave in slices without noise
)
MODEL_WEIGHT = 40.0  # degrees of freedom that the noise model counts beside the 7 of eight sectors


@dataclass(frozen=True)
class SectorSums:
    """Sums per cell and azimuth sector, arrays (nz, nr, 8): grey or filling factor, its square, voxels; and masked ones.

    voxels of one cell lie in ``height`` slices and between r_edges (voxels).
    """

    total: FloatArray
    square: FloatArray
    count: FloatArray
    masked: FloatArray
    r_edges: FloatArray
    height: int

    def mean(self) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.total.sum(2) / self.count.sum(2)


class SectorAverage:
    """Adds slices one by one; the axis may lean (``tilt``: change of x and y, in voxels, per slice downwards).

    slope : of a leaning surface (slices per pixel along x and y); rows are then counted along its normal, from the axis'
    slice, and the lean of the axis is against the normal.
    """

    def __init__(
        self, shape: tuple[int, int], count: int, axis: tuple[float, float, float], cell: int, reach: float,
        tilt: tuple[float, float] = (0.0, 0.0), slope: tuple[float, float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        self.slope = slope
        self.axis, self.cell, self.tilt, self.shape = axis, cell, tilt, shape
        self.nr, self.nz = max(1, int(reach // cell)), count // cell
        size = (self.nz, self.nr * SECTORS)
        self.total, self.square, self.voxels, self.masked = (np.zeros(size) for _ in range(4))
        self._index: np.ndarray | None = None

    def index(self, k: int) -> np.ndarray:
        """Cell and sector of every pixel of slice k, (ny, nx); nr * 8 stands for "outside"."""
        if self._index is not None:
            return self._index
        dx, dy = ((k - self.axis[2]) * t for t in self.tilt)
        x = np.arange(self.shape[1])[None, :] - self.axis[0] - dx
        y = np.arange(self.shape[0])[:, None] - self.axis[1] - dy
        bins = np.minimum(np.hypot(x, y) / self.cell, self.nr).astype(np.int32)
        sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2 * np.pi))).astype(np.int32) % SECTORS
        index = np.where(bins < self.nr, bins * SECTORS + sector, self.nr * SECTORS)
        if self.tilt == (0.0, 0.0):
            self._index = index
        return index

    def add(self, k: int, values: FloatArray, hidden: np.ndarray | None) -> None:
        """Add slice k. hidden : (ny, nx) bool, voxels of the bead and its guard, or None."""
        if self.slope != (0.0, 0.0):
            self._add_leaning(k, values, hidden)
            return
        row = k // self.cell
        if row >= self.nz:
            return
        index = self.index(k)
        length = self.nr * SECTORS + 1
        if hidden is not None:
            self.masked[row] += np.bincount(index[hidden], minlength=length)[:-1]
            index, values = index[~hidden], values[~hidden]
        flat = index.ravel()
        v = np.asarray(values, float).ravel()
        self.total[row] += np.bincount(flat, v, length)[:-1]
        self.square[row] += np.bincount(flat, v * v, length)[:-1]
        self.voxels[row] += np.bincount(flat, minlength=length)[:-1]

    def _add_leaning(self, k: int, values: FloatArray, hidden: np.ndarray | None) -> None:
        """The same where the rows of the map cross the slices."""
        x = np.arange(self.shape[1])[None, :] - self.axis[0]
        y = np.arange(self.shape[0])[:, None] - self.axis[1]
        down = np.array([-self.slope[0], -self.slope[1], 1.0])
        down /= np.linalg.norm(down)
        height = x * down[0] + y * down[1] + (k - self.axis[2]) * down[2]
        x = x - height * (down[0] + self.tilt[0])
        y = y - height * (down[1] + self.tilt[1])
        above = (k - self.axis[2]) - height * down[2]
        bins = (np.sqrt(x**2 + y**2 + above**2) / self.cell).astype(int)
        row = np.floor((self.axis[2] + height + 0.5) / self.cell).astype(int)
        sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2 * np.pi))).astype(int) % SECTORS
        inside = (bins < self.nr) & (row >= 0) & (row < self.nz)
        index = (row * self.nr + bins) * SECTORS + sector
        seen = inside if hidden is None else inside & ~hidden
        v, at = np.asarray(values, float)[seen], index[seen]
        size = self.total.size
        self.total += np.bincount(at, v, size).reshape(self.total.shape)
        self.square += np.bincount(at, v * v, size).reshape(self.total.shape)
        self.voxels += np.bincount(at, minlength=size).reshape(self.total.shape)
        if hidden is not None:
            self.masked += np.bincount(index[inside & hidden], minlength=size).reshape(self.total.shape)

    def sums(self) -> SectorSums:
        fold = (self.nz, self.nr, SECTORS)
        total, square, voxels, masked = (
            each.reshape(fold) for each in (self.total, self.square, self.voxels, self.masked)
        )
        return SectorSums(total, square, voxels, masked, np.arange(self.nr + 1.0) * self.cell, self.cell)


@dataclass(frozen=True)
class CellErrors:
    """sigma : (nz, nr); asymmetry : (nz, nr) largest minus smallest sector; voxel_noise : one voxel, undisturbed dust;
    excess : sector-to-sector standard deviation beyond voxel noise; correlation_r, correlation_z : between neighbours;
    model : (nz, nr) what the noise model alone gives.
    """

    sigma: FloatArray
    asymmetry: FloatArray
    voxel_noise: float
    excess: float
    correlation_r: float
    correlation_z: float
    model: FloatArray
    scatter: (
        float  # standard deviation of undisturbed cells beyond their sigma, in filling factor; part of sigma
    )


def estimate_errors(sums: SectorSums, undisturbed: np.ndarray) -> CellErrors:
    """Jackknife over eight sectors, steadied by the noise that the undisturbed cells show.

    A jackknife of eight has seven degrees of freedom, too few for one cell; it is averaged with the model
    s^2 = a + b / count, fitted to the jackknife variances of the undisturbed cells, which counts as 40.
    undisturbed : (nz, nr) bool. Source of the jackknife of a ratio: Efron (1982), chapter 2.
    """
    count, total = sums.count, sums.total
    n, t = count.sum(2), total.sum(2)
    with np.errstate(invalid="ignore", divide="ignore"):
        left_out = (t[..., None] - total) / (n[..., None] - count)
        used = count > 0
        m = used.sum(2)
        centre = np.where(used, left_out, 0).sum(2) / m
        jackknife = (m - 1) / m * np.where(used, (left_out - centre[..., None]) ** 2, 0).sum(2)
        spread = sums.square.sum(2) / n - (t / n) ** 2
        sector_mean = np.where(used, total / count, np.nan)
    good = undisturbed & (m >= 6) & (n >= 24) & np.isfinite(jackknife)
    noise = float(np.sqrt(np.average(spread[good], weights=n[good])))
    scaled = jackknife[good] * n[good]
    a, b = 0.0, float(np.mean(scaled))
    if good.sum() > 20:  # weights make every cell's relative scatter equal
        design = np.column_stack([np.ones(good.sum()), 1 / n[good]]) * n[good, None]
        a, b = np.linalg.lstsq(design, scaled, rcond=None)[0]
        if a < 0 or b < 0:
            a, b = 0.0, float(np.mean(scaled))
    with np.errstate(invalid="ignore", divide="ignore"):
        model = a + b / n
        freedom = np.where(m > 2, m - 1, 0)
        sigma = np.sqrt(
            (freedom * np.nan_to_num(jackknife) + MODEL_WEIGHT * model) / (freedom + MODEL_WEIGHT)
        )
    sigma[n == 0] = np.nan
    high = np.where(used, sector_mean, -np.inf).max(2)
    low = np.where(used, sector_mean, np.inf).min(2)
    asymmetry = np.where(n > 0, high - low, np.nan)
    level = np.where(good, sums.mean(), np.nan)
    white, share = _whiten(level, sigma)
    scatter = 0.0
    if np.isfinite(white).sum() > 100 and np.nanmean(white**2) > (1 - share) * MORE_SCATTER:
        beyond = (white**2 / (1 - share) - 1) * sigma**2
        scatter = float(np.sqrt(max(np.nanmean(beyond), 0.0)))
        scatter = scatter if scatter > LEAST_SCATTER else 0.0
        sigma = np.hypot(sigma, scatter)
        white, share = _whiten(level, sigma)
    correlation_r, correlation_z = _lag(white, 1), _lag(white, 0)
    # the mean taken out of every row is made of these cells themselves
    correlation_r = correlation_r * (1 - share) + share
    return CellErrors(
        sigma, asymmetry, noise, float(np.sqrt(a)), correlation_r, correlation_z, np.sqrt(model), scatter
    )


def _whiten(level: FloatArray, sigma: FloatArray) -> tuple[FloatArray, float]:
    """Deviations from the mean of their row, in sigma, and one over the cells of a row: layers, crusts and gradients of the
    sample lie in rows and are no noise. level : (nz, nr), nan where it does not count."""
    counted = np.isfinite(level)
    weight = np.where(counted, 1 / sigma**2, 0.0)
    enough = counted.sum(1) >= 3
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(level * weight, axis=1) / weight.sum(1)
    white = np.where(enough[:, None], (level - mean[:, None]) / sigma, np.nan)
    return white, float(1 / max(counted[enough].sum(1).mean(), 1.0)) if enough.any() else 0.0


def _lag(white: FloatArray, axis: int) -> float:
    first, second = (
        np.take(white, range(*span), axis) for span in ((0, white.shape[axis] - 1), (1, white.shape[axis]))
    )
    both = np.isfinite(first) & np.isfinite(second)
    if both.sum() < 30:
        return float("nan")
    return float(np.mean(first[both] * second[both]) / np.nanmean(white**2))


def fit_tilt(
    sums: SectorSums, errors: CellErrors, bead_row: float, rows: np.ndarray, r_max: float
) -> tuple[tuple[float, float], float]:
    """How the map's axis leans, from the dipole of the sectors below the bead: (x, y) voxels per slice, and sigma.

    A map that is shifted by s shows phi'(r) s cos(azimuth); a leaning axis through the bead has s = tilt (k - k_bead).
    rows : (nz,) slice number of the cell rows; cells with r < r_max (voxels) and below the bead are used.
    """
    mean = sums.mean()
    r = 0.5 * (sums.r_edges[1:] + sums.r_edges[:-1])
    slope = np.gradient(mean, r, axis=1)
    angle = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS) - np.pi
    arm = (rows - bead_row)[:, None]
    full = (
        (sums.masked.sum(2) == 0)
        & (sums.count.min(2) > 0)
        & (arm > 0)
        & (r[None, :] < r_max)
        & np.isfinite(slope)
    )
    if full.sum() < 10:
        return (0.0, 0.0), float("inf")
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = sums.total / sums.count - mean[..., None]
    # voxels of a sector are spread over its angle: the mean cosine is smaller by sinc
    shrink = np.sin(np.pi / SECTORS) / (np.pi / SECTORS)
    weight = sums.count[full] / errors.voxel_noise**2
    tilt, information = [], 0.0
    for wave in (np.cos(angle), np.sin(angle)):
        expected = -(slope * arm)[full][:, None] * wave * shrink
        information = float((weight * expected**2).sum())
        tilt.append(
            float((weight * expected * residual[full]).sum() / information) if information > 0 else 0.0
        )
    # what the undisturbed cells scatter beyond noise moves the axis too
    more = float(np.hypot(1.0, errors.scatter / np.median(errors.model[full])))
    return (tilt[0], tilt[1]), more * information**-0.5 if information > 0 else float("inf")
