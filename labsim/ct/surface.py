"""The undisturbed surface of the dust, from slices far from the axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray
from .slices.stack import SliceStack

LEANS = np.deg2rad(1.5)  # lean of the surface that is followed; smaller ones change no cell by its sigma
PASSES = 3  # in which the lean is refined
WIDTHS = 2.5  # of the step, below which dust is seen in full


@dataclass(frozen=True)
class Surface:
    """Free surface far from the bead. ``row`` is its slice number (whole numbers are slice centres), at the bead's axis.

    slope : slices per pixel along x and y, of a surface that leans (LEANS), else zero; heights are then counted along its
    normal. tilt : rad, of a plane through four quadrants; width : voxels, standard deviation of the step across it;
    air, dust : grey levels above and below; air_scatter, dust_scatter : grey, voxel to voxel.
    """

    row: float
    row_sigma: float
    tilt: float
    width: float
    air: float
    dust: float
    air_scatter: float
    dust_scatter: float
    slope: tuple[float, float] = (0.0, 0.0)

    @property
    def leans(self) -> bool:
        return self.slope != (0.0, 0.0)

    def along_normal(self, bead_row: float) -> float:
        """The surface's row where rows are counted from the bead's along the surface's normal, one voxel each."""
        return bead_row - (bead_row - self.row) / float(np.sqrt(1 + self.slope[0] ** 2 + self.slope[1] ** 2))


def find_surface(
    stack: SliceStack, axis: tuple[float, float], bead_row: float, bead_radius: float
) -> Surface:
    """Half level between air and dust in the corners and the rim of the slices, outside 3.3 bead radii from the axis.

    Raises MeasurementError: a stack upside down, or one that shows no surface.
    """
    ny, nx = stack.shape
    y, x = np.mgrid[:ny, :nx]
    distance = np.hypot(x - axis[0], y - axis[1])
    reach = min(axis[0], axis[1], nx - 1 - axis[0], ny - 1 - axis[1])
    far = distance > min(3.3 * bead_radius, 0.85 * reach)
    quadrants = [
        far & ((x > axis[0]) == right) & ((y > axis[1]) == lower) for right in (0, 1) for lower in (0, 1)
    ]
    if min(q.sum() for q in quadrants) < 30:
        raise MeasurementError(
            stack.source,
            "scan.slices",
            "no dust far from the bead is in view on one side; export wider slices",
        )
    profile = np.array([[image[q].mean() for q in quadrants] for image in stack])
    found = _fit_step(profile, stack, far, x, y, axis)
    slope = (0.0, 0.0)
    if found.tilt > LEANS:
        for _ in range(PASSES):
            slope = (slope[0] + found.slope[0], slope[1] + found.slope[1])
            plane = slope[0] * (x - axis[0]) + slope[1] * (y - axis[1])
            found = _fit_step(_relative_profile(stack, quadrants, plane), stack, far, x, y, axis)
        return replace(found, slope=slope, tilt=float(np.hypot(*slope)))
    return replace(found, slope=slope)


def _relative_profile(stack: SliceStack, quadrants: list[np.ndarray], plane: FloatArray) -> FloatArray:
    """Mean grey over each quadrant against the height over a leaning plane, (slices, 4); the ends as far as they are seen."""
    size = (stack.count, len(quadrants))
    total, number = np.zeros(size), np.zeros(size)
    for k, image in enumerate(stack):
        row = np.rint(k - plane).astype(int)
        for q, quadrant in enumerate(quadrants):
            at = row[quadrant]
            inside = (at >= 0) & (at < stack.count)
            total[:, q] += np.bincount(at[inside], image[quadrant][inside], stack.count)
            number[:, q] += np.bincount(at[inside], minlength=stack.count)
    return total / np.maximum(number, 1)


def _fit_step(
    profile: FloatArray,
    stack: SliceStack,
    far: np.ndarray,
    x: FloatArray,
    y: FloatArray,
    axis: tuple[float, float],
) -> Surface:
    """The step from air to dust in the profiles of four quadrants; ``slope`` is what they still differ by."""
    mean = profile.mean(1)
    edge = max(2, stack.count // 30)
    above, below = float(mean[:edge].mean()), float(mean[-edge:].mean())
    scatter = float(np.std(np.diff(stack.slice(stack.count - 1)[far].astype(float))) / np.sqrt(2)) + 1e-9
    if above > below + 0.5 * scatter:
        raise MeasurementError(
            stack.source,
            "scan.first_slice",
            'dust lies above and air below: the stack is upside down; put the other one of "top" and "bottom"',
        )
    level = 0.5 * (above + below)
    crossings = np.flatnonzero((mean[:-1] < level) & (mean[1:] >= level))
    if below - above < 0.5 * scatter or len(crossings) == 0:
        raise MeasurementError(
            stack.source,
            "scan.slices",
            "no surface between air and dust; export the slices above the dust as well",
        )
    rows = np.array([_cross(profile[:, q], level, int(crossings[0])) for q in range(4)])
    first = int(crossings[0])
    air_rows, dust_rows = mean[: max(1, first - 3)], mean[first + 5 :]
    air, dust = float(np.mean(air_rows)), float(np.median(dust_rows))
    step = np.clip(np.diff(mean[max(0, first - 6) : first + 8]) / (dust - air), 0, None)
    position = np.arange(len(step))
    centre = (step * position).sum() / step.sum()
    width = float(np.sqrt((step * (position - centre) ** 2).sum() / step.sum()))
    # half of the step that is there: a crust's own level, not the bulk's, lies below the surface, and below what a blur mixes
    full = min(first + max(3, math.ceil(WIDTHS * width)), len(mean) - 1)
    row = _cross(mean, 0.5 * (air + float(mean[full : full + 4].mean())), first)
    gx = 0.5 * (rows[2] + rows[3] - rows[0] - rows[1])
    gy = 0.5 * (rows[1] + rows[3] - rows[0] - rows[2])
    arm = 2 * np.mean(np.abs(x - axis[0])[far])
    air_scatter = float(stack.slice(0)[far].std())
    dust_scatter = float(stack.slice(stack.count - 1)[far].std())
    row_sigma = float(max(rows.std(ddof=1) / 2, 0.01))
    return Surface(
        row, row_sigma, float(np.hypot(gx, gy) / arm), width, air, dust, air_scatter, dust_scatter,
        (float(gx / arm), float(gy / arm)),
    )  # fmt: skip


def _cross(profile: FloatArray, level: float, near: int) -> float:
    crossings = np.flatnonzero((profile[:-1] < level) & (profile[1:] >= level))
    if len(crossings) == 0:
        return float("nan")
    k = int(crossings[np.argmin(np.abs(crossings - near))])
    return k + float((level - profile[k]) / (profile[k + 1] - profile[k]))
