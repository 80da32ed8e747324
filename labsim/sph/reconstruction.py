"""Volumes of dust above a filling factor, from the particles: φ is taken as linear inside each particle's cell.

Counting whole particles makes such a volume jump with every particle that passes the threshold; a layer that is one or two
particles thick is then a matter of luck. Here each particle keeps its volume (so mass and volume are those of the run), and the
share of its square cell in which φ + ∇φ·ξ exceeds the threshold counts. ∇φ is the solver's own: renormalised, exact for linear
fields.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..records import FloatArray


def differentiate_field(
    r: FloatArray, z: FloatArray, area: FloatArray, field: FloatArray, h: float, axisymmetric: bool
) -> tuple[FloatArray, FloatArray]:
    """∂/∂r and ∂/∂z of ``field`` at the particles (n,), by the gradient of Wendland's kernel of smoothing length h (m).

    area: (n,) of the particles in the meridian plane, m². axisymmetric: images across r = 0 carry the same values.
    """
    n = r.size
    source = np.arange(n)
    if axisymmetric:
        mirrored = np.nonzero(r < 2 * h)[0]
        source = np.concatenate([source, mirrored])
        r_all, z_all = np.concatenate([r, -r[mirrored]]), z[source]
    else:
        r_all, z_all = r, z
    tree, every = cKDTree(np.stack([r, z], axis=1)), cKDTree(np.stack([r_all, z_all], axis=1))
    pairs = tree.sparse_distance_matrix(every, 2 * h, output_type="ndarray")
    i, j, distance = pairs["i"], pairs["j"], pairs["v"]
    weight = area[source[j]] * (1 - distance / (2 * h)) ** 3
    dr, dz = r_all[j] - r[i], z_all[j] - z[i]
    step = field[source[j]] - field[i]

    def total(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(i, values, n), dtype=float)

    rr, rz, zz = total(weight * dr * dr), total(weight * dr * dz), total(weight * dz * dz)
    by_r, by_z = total(weight * dr * step), total(weight * dz * step)
    # a particle without neighbours on two sides has no gradient: the smaller eigenvalue is lifted to a tenth of the larger
    half, root = 0.5 * (rr + zz), np.sqrt(0.25 * (rr - zz) ** 2 + rz**2)
    lift = np.maximum(0.1 * (half + root) - (half - root), 0.0) + 1e-300
    rr, zz = rr + lift, zz + lift
    scale = 1 / (rr * zz - rz**2)
    return scale * (zz * by_r - rz * by_z), scale * (rr * by_z - rz * by_r)


def share_above(excess: FloatArray, across_r: FloatArray, across_z: FloatArray) -> FloatArray:
    """Share of a rectangle in which a linear field is positive: ``excess`` in its middle, changing by ``across_r`` and
    ``across_z`` from the middle to the edges. From 0 to 1, with a continuous slope."""
    least = 1e-9 + 1e-6 * np.abs(excess)
    a, b = np.maximum(np.abs(across_r), least), np.maximum(np.abs(across_z), least)
    ends = ((a + b, 1.0), (a - b, -1.0), (b - a, -1.0), (-a - b, 1.0))
    share = sum(sign * np.maximum(excess + end, 0.0) ** 2 for end, sign in ends) / (8 * a * b)
    return np.where(excess > a + b, 1.0, np.where(excess < -a - b, 0.0, np.clip(share, 0.0, 1.0)))
