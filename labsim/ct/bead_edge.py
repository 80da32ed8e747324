"""The edge of the bead, blurred and clipped as it was recorded: the point spread that it shows, the centre that it tells."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.special import erfc

from ..records import FloatArray
from .slices.stack import SliceStack

REACH = 3.5  # voxels about the bead's edge in which its width is fitted
WIDE, WIDE_PASSES = 1.3, 4  # voxels of blur from which its outside has to be looked for further away


def find_widest(lateral: float, axial: float) -> float:
    """The wider of two blurs; where an edge gives none (NaN), the other."""
    return float(np.nanmax([lateral, axial, 0.0]))


def cut_box(
    stack: SliceStack, centre: tuple[float, float, float], half: int
) -> tuple[FloatArray, FloatArray]:
    """Cube about the centre as (x, y, k) float32 and the index of its corner; cut at the stack's edges."""
    ny, nx = stack.shape
    low = [max(0, round(c) - half) for c in centre]
    high = [min(n, round(c) + half + 1) for c, n in zip(centre, (nx, ny, stack.count), strict=True)]
    box = np.stack([stack.slice(k)[low[1] : high[1], low[0] : high[0]] for k in range(low[2], high[2])])
    return box.astype(np.float32).transpose(2, 1, 0), np.array(low, float)


def fit_clipped_edge(
    box: FloatArray, start: FloatArray, radius: float, level: float, top: float,
    directions: FloatArray, outside: FloatArray, tree: cKDTree,
) -> FloatArray:  # fmt: skip
    """Centre of a saturated bead of known radius: least squares of the clipped, blurred step over the edge's voxels."""
    index = (
        np.stack(np.meshgrid(*(np.arange(n) for n in box.shape), indexing="ij"), -1)
        .reshape(-1, 3)
        .astype(float)
    )
    offset = index - start
    distance = np.linalg.norm(offset, axis=1)
    near = np.abs(distance - radius) < 3.5
    direction = offset[near] / distance[near, None]
    if len(directions) and directions[:, 2].min() > 0:
        lower = direction[:, 2] > 0.1
        near[np.flatnonzero(near)[~lower]] = False
        direction = direction[lower]
    background = outside[tree.query(direction)[1]]
    points, grey = index[near], box.reshape(-1)[near]

    def misfit(q: FloatArray) -> FloatArray:
        d = np.linalg.norm(points - q[:3], axis=1)
        share = 0.5 * erfc((d - radius) / (np.sqrt(2) * q[3]))
        return np.minimum(background + (q[4] * level - background) * share, top) - grey

    first = np.append(start, [0.7, 1.0])
    span = np.array([1.5, 1.5, 1.5])
    bounds = (np.append(start - span, [0.1, 0.4]), np.append(start + span, [4.0, 2.0]))
    return least_squares(misfit, first, bounds=bounds, loss="soft_l1", f_scale=0.05 * top).x[:3]


def fit_blur(
    box: FloatArray, centre: FloatArray, radius: float, level: float, top: float,
    directions: FloatArray, outside: FloatArray, tree: cKDTree, region: str,
    reach: float = REACH, slack: tuple[float, float] = (1.0, 0.4),
) -> float:  # fmt: skip
    """Width of the edge: a step of ``level`` over each direction's own outside, spread by a Gaussian, clipped at top.

    reach : voxels about the edge that are fitted; slack : of the radius in voxels, and of the step, relative."""
    offset = np.stack(np.meshgrid(*(np.arange(n) for n in box.shape), indexing="ij"), -1) - centre
    distance = np.linalg.norm(offset, axis=-1)
    near = np.abs(distance - radius) < reach
    cosine = np.abs(offset[..., 2]) / np.maximum(distance, 1e-9)
    near &= (cosine < 0.5) if region == "lateral" else (cosine > 0.93)
    if region == "axial":
        near &= offset[..., 2] > 0  # the upper half of a rod, or of a bead in its crater, is another edge
    d, grey = distance[near], box[near]
    if len(d) < 50:
        return float("nan")
    background = outside[tree.query(offset[near] / d[:, None])[1]]

    def misfit(q: FloatArray) -> FloatArray:
        share = 0.5 * erfc((d - q[1]) / (np.sqrt(2) * q[0]))
        return np.minimum(background + (q[2] * level - background) * share, top) - grey

    fit = least_squares(
        misfit,
        [0.7, radius, 1.0],
        bounds=([0.05, radius - slack[0], 1 - 0.75 * slack[1]], [8, radius + slack[0], 1 + slack[1]]),
        loss="soft_l1",
        f_scale=15,
    )
    return float(fit.x[0])


def fit_wide_blur(
    stack: SliceStack, centre: FloatArray, stated: float, level: float, top: float, directions: FloatArray,
    tree: cKDTree, blur: tuple[float, float],
) -> tuple[float, float]:  # fmt: skip
    """The same where the edge reaches to where its outside was looked for: further out, about the stated radius."""
    for _ in range(WIDE_PASSES):
        before = find_widest(*blur)
        reach = 3.0 * before
        box, origin = cut_box(stack, tuple(centre), int(np.ceil(stated + reach + 3)))
        middle = centre - origin
        along = stated + reach + np.arange(0.0, 2.0, 0.5)
        points = middle + along[None, :, None] * directions[:, None, :]
        grey = ndimage.map_coordinates(box, points.reshape(-1, 3).T, order=1, mode="nearest")
        outside = grey.reshape(len(directions), -1).mean(1)
        lateral, axial = (
            fit_blur(box, middle, stated, level, top, directions, outside, tree, region, reach, (0.2, 0.05))
            for region in ("lateral", "axial")
        )
        blur = (lateral, axial)
        if abs(find_widest(*blur) - before) < 0.05 * before:
            break
    return blur
