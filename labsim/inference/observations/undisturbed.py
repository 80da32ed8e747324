"""What CT scans say without any simulation: the filling factor of the dust that the bead did not reach, against depth, and how
sharp its edge is seen.

The nominal model states both: φ0 at all depths, and a point spread of one voxel. Effects of the sample (crust, gradient,
another φ0) and of the CT (grey scale, blur) change what is expected here through the same functions that change their runs.
Errors: each row's own, what cupping and the bead's elastic strain leave (SMOOTH), the stated uncertainty of φ0 and of the grey
calibration (GREY), both common to all scans; for the point spread POINT_SPREAD_SIGMA, partly common.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float

from ...ct.reduce import ReducedScan
from ...records import FloatArray, Scan
from ...sph.particles import initial_filling_factor
from ..fits.blocks import Block
from . import Direct
from .linearised_drop import ErrorBudget, Perturbation

REACH = 3.0  # tip radii about the bead and its path within which dust may have moved
SMOOTH, SMOOTH_LENGTH = 3e-4, 3e-4  # of the filling factor; m
GREY = 0.005  # relative, of the grey calibration, where nothing is stated
POINT_SPREAD_VOXELS = 1.0  # standard deviation that is assumed where nothing is stated
POINT_SPREAD_SIGMA = (0.12, 0.12)  # of its logarithm: each scan's own, common to all
FREE_LENGTH = 5e-4  # m, over which an unnamed layer changes


@dataclass(frozen=True)
class UndisturbedDust:
    """One scan away from its bead. depth (m, positive downwards), filling_factor, sigma : (n,); point_spread : m, measured."""

    scan: Scan
    depth: Float[np.ndarray, " n"]
    filling_factor: Float[np.ndarray, " n"]
    sigma: Float[np.ndarray, " n"]
    point_spread: float

    @property
    def name(self) -> str:
        return self.scan.name


def observe_undisturbed(reduced: ReducedScan) -> UndisturbedDust | None:
    """Rows of a reduced map averaged over the dust that was not reached; None where fewer than four rows are left."""
    found, radius = reduced.map, reduced.scan.projectile.tip_radius
    r, z = np.meshgrid(found.r, found.z)
    centre = reduced.bead_centre_z
    apart = np.where(z > centre, r, np.hypot(r, z - centre))
    spread = reduced.point_spread
    good = reduced.usable & (apart > REACH * radius) & (z < -reduced.edge) & (found.sigma > 0)
    depth, level, sigma = [], [], []
    inflate = math.sqrt(
        (1 + max(reduced.errors.correlation_r, 0.0)) / (1 - min(reduced.errors.correlation_r, 0.9))
    )
    for k in np.nonzero(good.sum(axis=1) >= 2)[0]:
        weight = 1 / found.sigma[k, good[k]] ** 2
        depth.append(-found.z[k])
        level.append(float(np.sum(weight * found.filling_factor[k, good[k]]) / weight.sum()))
        sigma.append(inflate / math.sqrt(weight.sum()))
    if len(depth) < 4:
        return None
    return UndisturbedDust(reduced.scan, np.array(depth), np.array(level), np.array(sigma), spread)


@dataclass(frozen=True)
class Layering(Direct):
    """The undisturbed dust of all scans; of a point's settings the initial state counts. sigma : stated, of the sample's φ0."""

    dust: tuple[UndisturbedDust, ...]
    sigma: float
    kind: str = "undisturbed dust"
    name: str = "undisturbed dust"

    def expect(self, log_p_m: float, point: Perturbation) -> FloatArray:
        parts = []
        for each in self.dust:
            instrument = point.instruments[each.name]
            filling_factor = initial_filling_factor(point.setting(each.name), each.depth)
            spread = POINT_SPREAD_VOXELS * each.scan.voxel + instrument.ct_blur
            parts.append(np.append(instrument.stated_filling_factor(filling_factor), math.log(spread)))
        return np.concatenate(parts)

    def compare(self, expected: FloatArray, tangents: Mapping[str, FloatArray], budget: ErrorBudget) -> Block:
        dust = self.dust
        data = np.concatenate([np.append(each.filling_factor, math.log(each.point_spread)) for each in dust])
        row = np.concatenate([np.append(np.ones(each.depth.size), 0.0) for each in dust])
        own = np.concatenate([np.full(each.depth.size + 1, k) for k, each in enumerate(dust)])
        depth = np.concatenate([np.append(each.depth, 0.0) for each in dust])
        sigma = np.concatenate([np.append(each.sigma, POINT_SPREAD_SIGMA[0]) for each in dust])
        spread = 1.0 - row
        same = np.equal.outer(own, own) * np.outer(row, row)
        apart = np.subtract.outer(depth, depth)
        covariance = np.diag(sigma**2) + SMOOTH**2 * same * np.exp(-0.5 * (apart / SMOOTH_LENGTH) ** 2)
        level = row * math.hypot(self.sigma, GREY * float(np.mean(data[row > 0])))
        covariance += np.outer(level, level) + POINT_SPREAD_SIGMA[1] ** 2 * np.outer(spread, spread)
        return Block(
            data - expected, covariance, tangents, partial(_let_layers_change, row * expected, apart)
        )


def _let_layers_change(filling_factor: FloatArray, apart: FloatArray) -> FloatArray:
    """(n, n) covariance of an unnamed layering: the same in all samples, it grows with nothing but depth."""
    return np.outer(filling_factor, filling_factor) * np.exp(-0.5 * (apart / FREE_LENGTH) ** 2)
