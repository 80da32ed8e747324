"""Cupping and rings, which are centred on the scanner's axis, and are taken out before averaging about the bead's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from ...records import FloatArray
from ..bead import Bead
from ..surface import Surface
from .stack import SliceStack


@dataclass(frozen=True)
class Cupping:
    """Dust's grey against the distance rho from the scanner's axis, a + b rho^2, below and away from the bead.

    amount : grey levels between the middle and the rim, sigma its uncertainty; left_over : rms of the radial profile
    after the fit; image : (ny, nx) what the cup adds, zero on average over the slice, where the dust's mean is ``level``.
    """

    amount: float = 0.0
    sigma: float = float("nan")
    left_over: float = 0.0
    followed: bool = False
    image: FloatArray | float = 0.0
    level: float = float("nan")


def fit_cupping(stack: SliceStack, axis: tuple[float, float], bead: Bead, surface: Surface) -> Cupping:
    """Fit a parabola (and a fourth power where it helps) to the deep slices; followed from 4 sigma and 0.3 % of dust."""
    ny, nx = stack.shape
    start = _find_deep(stack, bead, surface)
    if stack.count - start < 4:
        return Cupping()
    deep = np.zeros((ny, nx))
    rows = range(start, stack.count, max(1, (stack.count - start) // 40))
    for k in rows:
        deep += stack.slice(k)
    deep /= len(rows)
    y, x = np.mgrid[:ny, :nx]
    rho = np.hypot(x - (nx - 1) / 2, y - (ny - 1) / 2) / (min(nx, ny) / 2)
    inside = rho < 1
    # ring by ring, so that the scatter of the rings themselves, not only voxel noise, says how sure a cup is
    bins = (rho[inside] * min(nx, ny) / 4).astype(int)
    count = np.bincount(bins)
    profile = np.bincount(bins, deep[inside]) / np.maximum(count, 1)
    at = np.bincount(bins, rho[inside]) / np.maximum(count, 1)
    weight = np.sqrt(count)
    best = None
    for terms in (2, 3):
        a = np.column_stack([np.ones_like(at), at**2, at**4])[:, :terms]
        solution = np.linalg.lstsq(a * weight[:, None], profile * weight, rcond=None)[0]
        residual = profile - a @ solution
        chi2 = float((count * residual**2).sum()) / (len(at) - terms)
        end = np.array([0.0, 1.0, 1.0])[:terms]
        covariance = np.linalg.inv((a * count[:, None]).T @ a) * chi2
        if best is None or chi2 < 0.7 * best[2]:
            best = (solution, float(np.sqrt(end @ covariance @ end)), chi2, float(np.std(residual)))
    assert best is not None
    solution, sigma, _, left_over = best
    amount = float(solution[1:].sum())
    full = np.zeros_like(rho)
    for coefficient, power in zip(solution[1:], (2, 4), strict=False):
        full += coefficient * np.minimum(rho, 1.2) ** power
    full -= full[inside].mean()
    followed = abs(amount) > 4 * sigma and abs(amount) > 0.003 * (surface.dust - surface.air)
    level = float(deep[inside].mean())
    return Cupping(amount, sigma, left_over, followed, full.astype(np.float32) if followed else 0.0, level)


def remove_cupping(grey: FloatArray, cupping: Cupping, surface: Surface) -> FloatArray:
    """One slice with dust as bright in the middle as at the rim: beam hardening lowers a level by a share of itself."""
    return surface.air + (grey - surface.air) / (1 + cupping.image / (cupping.level - surface.air))


def measure_rings(
    stack: SliceStack, bead: Bead, surface: Surface, cupping: Cupping
) -> tuple[FloatArray | None, float]:
    """Rings that all slices share, from the undisturbed dust below the bead: (ny, nx) grey levels to take off, and the
    standard error of the dust's level that is left, since the rings themselves have an unknown mean.

    There every radius should read alike, so that rings of any width show. None where they are within the noise.
    """
    start = _find_deep(stack, bead, surface)
    if stack.count - start < 4:
        return None, 0.0
    rows = range(start, stack.count)
    deep: FloatArray = np.asarray(np.mean([stack.slice(k) for k in rows], axis=0, dtype=np.float64))
    if cupping.followed:
        deep = remove_cupping(deep, cupping, surface)
    index, reach = _ring_index(*deep.shape)
    inside = index < reach
    count = np.bincount(index[inside], minlength=reach)
    profile = np.bincount(index[inside], deep[inside], reach) / np.maximum(count, 1)
    ring = profile - np.median(profile)
    expected = surface.dust_scatter / np.sqrt(np.maximum(count, 1) * len(rows))
    if np.mean((ring / expected) ** 2) < 3.0:
        return None, 0.0
    spread = 1.48 * float(
        np.median(np.abs(ring))
    )  # of most radii: a few strong rings leave the median where it was
    level_sigma = 1.25 * spread / np.sqrt(reach)
    return np.where(inside, ring[np.minimum(index, reach - 1)], 0.0).astype(np.float32), level_sigma


def _find_deep(stack: SliceStack, bead: Bead, surface: Surface) -> int:
    """First slice of the dust that the bead did not reach."""
    return max(int(bead.centre[2] + 3.2 * bead.stated_radius), int(surface.row + 8))


def remove_rings(grey: FloatArray, hidden: np.ndarray | None, noise: float) -> tuple[FloatArray, float]:
    """One slice without its rings, and how strong they were (grey levels rms, 0 where nothing was removed).

    A ring is what the mean over the azimuth about the scanner's axis has beyond a running median over the radius; rings
    are removed where they stand above the noise that such a mean has (3 sigma and more than chance over all radii).
    grey : (ny, nx); hidden : (ny, nx) bool or None, voxels that say nothing.
    """
    ny, nx = grey.shape
    index, reach = _ring_index(ny, nx)
    use = index < reach
    if hidden is not None:
        use &= ~hidden
    which, values = index[use], grey[use]
    count = np.bincount(which, minlength=reach)
    with np.errstate(invalid="ignore", divide="ignore"):
        profile = np.bincount(which, values, reach) / count
    good = count > 6
    if good.sum() < 20:
        return grey, 0.0
    filled = np.interp(np.arange(reach), np.flatnonzero(good), profile[good])
    ring = np.where(good, filled - median_filter(filled, 9, mode="nearest"), 0.0)
    expected = noise * 1.2 / np.sqrt(np.maximum(count, 1))
    if np.sum(ring[good] ** 2) < 3.0 * np.sum(expected[good] ** 2):
        return grey, 0.0
    kept = np.where(np.abs(ring) > 2.0 * expected, ring, 0.0)
    corrected = grey.copy()
    everywhere = index < reach
    corrected[everywhere] -= kept[index[everywhere]].astype(grey.dtype)
    return corrected, float(np.sqrt(np.mean(kept[good] ** 2)))


_RINGS: dict[tuple[int, int], tuple[np.ndarray, int]] = {}


def _ring_index(ny: int, nx: int) -> tuple[np.ndarray, int]:
    if (ny, nx) not in _RINGS:
        y, x = np.mgrid[:ny, :nx]
        rho = np.hypot(x - (nx - 1) / 2, y - (ny - 1) / 2)
        _RINGS.clear()
        _RINGS[ny, nx] = (np.rint(rho).astype(int), int(min(nx, ny) / 2))
    return _RINGS[ny, nx]
