"""What the picture itself says about errors that are alike in many voxels: artefacts with a direction, a halo about the bead.

The jackknife over sectors sees noise. A missing wedge or a streak leaves opposite sectors alike and others not; its share in
the azimuthal mean is about as large as the spread of the pairs (for an empty wedge of angle w the mean over all directions
loses w / pi, the spread is sin(w) / (sqrt(2) pi) times sqrt(2): 1.0 to 1.3 times as much). A halo darkens the dust on the
bead's flank, which a drop compacts and never loosens, below the dust far away in the same layer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from ..records import FloatArray
from .average import SECTORS, CellErrors, SectorSums

SURE = 6.0  # standard deviations of the whole statistic; a scan without artefacts has 0 +- 1
SMOOTH = 1.5  # cells of height over which an artefact's size is taken as alike
SHELL, SHELLS = 2.0, 8  # voxels, number: shells about the bead in which a halo is looked for
HALO_SURE, HALO_LEAST = 4.0, 0.01  # standard deviations; share of the undisturbed level


@dataclass(frozen=True)
class Systematic:
    """size : (nz, nr) standard error to be added in quadrature, 0 where nothing is seen; warnings : what it is."""

    size: FloatArray
    warnings: tuple[str, ...] = ()


def find_directions(sums: SectorSums, errors: CellErrors, near: np.ndarray, reach: float) -> Systematic:
    """Artefacts that opposite sectors share and others do not.

    near : (nz, nr) bool, cells about the bead that are judged; reach : cells along r over which the spread is taken as alike,
    since the mean of what is missing peaks on the axis, where the spread is nil.
    """
    half = SECTORS // 2
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums.total / sums.count
    pair = 0.5 * (mean[..., :half] + mean[..., half:])
    odd = 0.5 * (mean[..., :half] - mean[..., half:])
    use = (sums.count.min(2) >= 4) & np.isfinite(errors.model) & np.isfinite(pair).all(2)
    noise = half * errors.model**2  # of a pair of sectors
    with np.errstate(invalid="ignore", divide="ignore"):
        even = np.where(use, pair.var(2, ddof=1) - noise, 0.0)
        lopsided = np.where(use, (odd**2).mean(2) - noise, 0.0)
        pull = even / noise
    judged = use & near
    if judged.sum() < 20:
        return Systematic(np.zeros(use.shape))
    freedom = half - 1
    score = pull[judged].sum() / np.sqrt(2 / freedom * judged.sum())
    if score < SURE or even[judged].sum() < lopsided[judged].sum():
        return Systematic(np.zeros(use.shape))
    weight = gaussian_filter(use.astype(float), (SMOOTH, reach))
    smooth = gaussian_filter(even, (SMOOTH, reach)) / np.maximum(weight, 1e-9)
    size = np.sqrt(np.maximum(smooth, 0.0))
    typical = float(np.sqrt(max(even[judged].mean(), 0.0)))
    return Systematic(
        size,
        (
            f"opposite sectors agree and others do not, by {typical:.4f} in filling factor about the bead: streaks, or "
            "projections of an angle are missing; as much is added to the error bars",
        ),
    )


def find_halo(
    phi: FloatArray, sigma: FloatArray, r: FloatArray, height: FloatArray, bead: float, guard: float, far: float,
    dust: np.ndarray,
) -> Systematic:  # fmt: skip
    """Dust beside and above the bead's middle that reads darker the nearer it is, against the same layer far away.

    r, height : (nr,), (nz,) voxels from the axis, and above the bead's centre; bead, guard : voxels, radius and what is left out;
    far : voxels from the axis beyond which a layer is undisturbed; dust : (nz,) rows well below the surface.
    """
    none = Systematic(np.zeros(phi.shape))
    known = np.isfinite(phi) & np.isfinite(sigma) & (sigma > 0) & dust[:, None]
    beyond = known & (r > far)[None, :]
    weight = np.where(known, 1 / np.where(known, sigma, 1.0) ** 2, 0.0)
    values = np.where(known, phi, 0.0)
    if not beyond.any():
        return none
    with np.errstate(invalid="ignore", divide="ignore"):
        layer = (weight * beyond * values).sum(1) / (weight * beyond).sum(1)
    distance = np.hypot(r[None, :], height[:, None]) - bead
    flank = known & np.isfinite(layer)[:, None] & (height > 0)[:, None] & (r < far)[None, :]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = phi / layer[:, None] - 1
        precision = np.where(flank, (layer[:, None] / sigma) ** 2, 0.0)
    at, dark, error = [], [], []
    for number in range(SHELLS):
        shell = flank & (distance >= guard + number * SHELL) & (distance < guard + (number + 1) * SHELL)
        if shell.sum() >= 2:
            at.append(guard + (number + 0.5) * SHELL)
            dark.append(float(np.average(share[shell], weights=precision[shell])))
            error.append(float(precision[shell].sum() ** -0.5))
    if len(at) < 3 or not (dark[0] < -HALO_SURE * error[0] and dark[0] < -HALO_LEAST):
        return none
    # a halo fades outwards; what does not is another layer
    outer = float(np.mean(dark[-2:]))
    if dark[0] - outer > -0.5 * abs(dark[0]):
        return none
    # the flank shows the halo less the compaction that the drop made there: the two are taken to be alike in size
    depth = 2 * np.interp(distance, at, np.minimum(dark, 0.0), right=0.0)
    size = np.where(np.isfinite(phi) & (distance < at[-1]), -depth * np.abs(np.nan_to_num(phi)), 0.0)
    return Systematic(
        size,
        (
            f"dust on the bead's flank reads {-dark[0]:.1%} darker than its layer far away: a dark halo about the bead (beam "
            f"hardening), or loosened dust; twice as much is added to the error bars up to {at[-1]:.0f} voxels about it",
        ),
    )
