"""The bead in three dimensions: its centre, its radius, and the point spread that its edge shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from ..errors import MeasurementError
from ..records import FloatArray, Measured, Scan
from .bead_edge import REACH, WIDE, cut_box, find_widest, fit_blur, fit_clipped_edge, fit_wide_blur
from .bead_size import measure_size, say_what_fits, warn_of_density, warn_of_size
from .slices.neighbours import find_bright_jumps
from .slices.stack import SliceStack

RAYS = 600
COARSE_REACH = 2.0  # voxels by which the coarse volume of a saturated bead may be larger in radius
LEAST_ABOVE = 1.2  # times the top of the range: grey level of a saturated bead whose mass says less
COMPACTED = 2.0  # times the undisturbed dust's level: what may be compacted dust
COARSE = 160  # voxels along the longest side of the coarse mask that is labelled


@dataclass(frozen=True)
class Bead:
    """Where the bead is, in voxels: ``centre`` is (x, y, k), pixel centres at whole numbers, k counted from the top.

    blur_lateral, blur_axial : voxels, standard deviation of the edge across the axis and along it (NaN where the edge
    gives none). ``saturated`` where its own grey level lies past the top of the range.
    """

    centre: tuple[float, float, float]
    radius: float
    stated_radius: float
    rms: float
    blur_lateral: float
    blur_axial: float
    saturated: bool
    warnings: tuple[str, ...] = ()


def find_bead(stack: SliceStack, scan: Scan) -> Bead:
    """Find the bead and fit a sphere to half-maximum points on rays from its middle.

    The half level of a ray lies between the dust or air just outside and the bead's own level, so that a bead half in
    air and half in dust is not drawn towards the dust. Raises MeasurementError: no bead, two beads, a bead cut by the
    edge of the stack, a bead whose size contradicts the stated radius and voxel.
    """
    stated = scan.projectile.tip_radius / scan.voxel
    top = 2**scan.bits - 1
    level = _bead_level(scan)
    threshold = min(0.5 * (scan.calibration.grey_air + level), 0.8 * top)
    dust = float(np.median(stack.slice(stack.count - 1)))
    if threshold - scan.calibration.grey_air < COMPACTED * (dust - scan.calibration.grey_air):
        # mass and radius make a bead hardly denser than the dust: what is brightest is the bead
        brightest = max(float(stack.slice(k).max()) for k in range(0, stack.count, max(1, stack.count // 40)))
        threshold = 0.5 * (dust + brightest)
    centre, coarse = _find_coarsely(stack, scan, threshold, stated)
    half = int(np.ceil(stated + 7))
    box, origin = cut_box(stack, centre, half)
    middle = np.array(centre) - origin
    saturated = bool(np.median(_sample(box, middle, 0.5 * stated)) >= 0.98 * top)
    if saturated:  # it lies above the range, whatever its mass says
        level = max(level, LEAST_ABOVE * top)
    else:
        level = float(np.median(_sample(box, middle, 0.5 * stated)))
    directions = _spread_directions(RAYS)
    if scan.projectile.tip == "sphere":
        _check_radius(scan, coarse, stated, COARSE_REACH if saturated else 0.0)
    else:
        directions = directions[directions[:, 2] > 0.1]  # the rod hides the upper half
    fit: FloatArray = middle
    outside: FloatArray = np.zeros(len(directions))
    rms = 0.0
    radius = stated
    for _ in range(3):
        points, outside, used = _edge_points(box, fit, directions, radius, level, top)
        if used.sum() < 60:
            raise MeasurementError(
                scan.slices,
                "projectile.radius_mm",
                f"the bead has no round edge of {stated:.2f} voxels' radius; its volume is that of {coarse:.2f}: "
                + say_what_fits(scan, coarse),
            )
        fit, radius, rms = _fit_sphere(points[used])
    _check_radius(scan, radius, stated, REACH if saturated else 0.0)
    tree = cKDTree(directions)
    size = measure_size(box, fit, radius, level, top, directions, outside, tree)
    warnings = warn_of_density(scan, top if saturated else level, saturated)
    if size is not None:
        warnings += warn_of_size(scan, *size, level / top if saturated else None)
    elif not saturated:  # where the half level is clipped the radius reads large
        warnings += warn_of_size(scan, Measured(radius, 0.0), None, None)
    if (
        saturated
    ):  # the half level may be cut off; the whole edge, clipped as it was recorded, still tells the centre
        fit = fit_clipped_edge(box, fit, stated, level, top, directions, outside, tree)
    lateral, axial = (
        fit_blur(box, fit, radius, level, top, directions, outside, tree, region)
        for region in ("lateral", "axial")
    )
    if find_widest(lateral, axial) > WIDE:
        lateral, axial = fit_wide_blur(
            stack, fit + origin, stated, level, top, directions, tree, (lateral, axial)
        )
    x, y, k = (fit + origin).tolist()
    return Bead((x, y, k), radius, stated, rms, lateral, axial, saturated, tuple(warnings))


def _check_radius(scan: Scan, radius: float, stated: float, slack: float) -> None:
    """slack : voxels by which the radius reads large where the half level is clipped, up to two blurs."""
    if abs(radius - stated) > 0.15 * stated + slack:
        raise MeasurementError(
            scan.slices,
            "projectile.radius_mm",
            f"the bead's radius is {radius:.2f} voxels, radius_mm / voxel_um gives {stated:.2f}; {say_what_fits(scan, radius)}",
        )


def _bead_level(scan: Scan) -> float:
    """Grey level that the bead's density would have; a bead of another material is only roughly there."""
    radius = scan.projectile.tip_radius
    volume = 4 / 3 * np.pi * radius**3
    density = scan.projectile.mass / volume if scan.projectile.tip == "sphere" else 2500.0
    return scan.calibration.grey_air + scan.calibration.grey_per_density * density


def _find_coarsely(
    stack: SliceStack, scan: Scan, threshold: float, stated: float
) -> tuple[tuple[float, float, float], float]:
    """Middle of the bright body, and the radius of a sphere of its volume, voxels."""
    ny, nx = stack.shape
    # a block holds at least a few voxels but stays well below the bead's radius
    step = max(1, min(int(np.ceil(max(ny, nx, stack.count) / COARSE)), int(stated / 3)))
    rows, columns = ny // step * step, nx // step * step
    mask = np.zeros((-(-stack.count // step), rows // step, columns // step), np.float32)
    area = np.zeros(stack.count)
    for k, image in enumerate(stack):
        area[k] = (image > threshold).sum()
        above = (image[:rows, :columns] > threshold).reshape(rows // step, step, columns // step, step)
        mask[k // step] += above.sum((1, 3))
    labels, number = ndimage.label(mask > 0.5 * step**3)
    expected = 4 / 3 * np.pi * (stated / step) ** 3
    sizes = np.bincount(labels.ravel())[1:] if number else np.zeros(0)
    beads = np.flatnonzero(sizes > 0.25 * expected) + 1
    if len(beads) == 0:
        raise MeasurementError(
            scan.slices,
            "projectile.radius_mm",
            f"no bead: nothing as bright as grey {threshold:.0f} is {scan.projectile.tip_radius * 1e3:g} mm in radius; "
            "check radius_mm, voxel_um and the calibration",
        )
    if len(beads) > 1:
        jumps = [f"{stack.name(k)} and {stack.name(k + 1)}" for k in find_bright_jumps(area)]
        raise MeasurementError(
            scan.slices,
            "projectile",
            f"{len(beads)} bright bodies of the bead's size; "
            + (
                f"they break off between {', '.join(jumps[:4])}: slices are out of order or of another scan"
                if jumps
                else "cut the slices so that one bead is in view"
            ),
        )
    found = np.argwhere(labels == beads[0])
    low, high = found.min(0) * step, (found.max(0) + 1) * step
    beyond = high >= np.array([stack.count - step + 1, rows - step + 1, columns - step + 1])
    rod = scan.projectile.tip != "sphere"
    if (low[1:] < 1).any() or beyond.any() or (low[0] < 1 and not rod):
        raise MeasurementError(
            scan.slices,
            "scan.slices",
            "the bead is cut by the edge of the stack; export slices that hold all of it",
        )
    k, y, x = (found.mean(0) + 0.5) * step - 0.5
    if rod:
        k = high[0] - 1 - stated
    radius = step * (3 * sizes[beads[0] - 1] / (4 * np.pi)) ** (1 / 3)
    return (float(x), float(y), float(k)), float(radius)


def _spread_directions(n: int) -> FloatArray:
    """Unit vectors (n, 3), evenly spread (golden-angle spiral)."""
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    azimuth = np.pi * (1 + 5**0.5) * i
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(azimuth), np.sqrt(1 - z**2) * np.sin(azimuth), z])


def _sample(box: FloatArray, middle: FloatArray, radius: float) -> FloatArray:
    points = middle + radius * _spread_directions(100)
    return ndimage.map_coordinates(box, points.T, order=1, mode="nearest")


def _edge_points(
    box: FloatArray, middle: FloatArray, directions: FloatArray, radius: float, level: float, top: float
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Half-maximum point of every ray, the level outside of it, and which rays have one."""
    along = np.arange(max(0.4 * radius, radius - 5), radius + 4.6, 0.1)
    points = middle + along[None, :, None] * directions[:, None, :]
    grey = ndimage.map_coordinates(box, points.reshape(-1, 3).T, order=1, mode="nearest").reshape(
        len(directions), -1
    )
    outside = grey[:, along > radius + 2.5].mean(1)
    # the same share of every ray's step, or the saturated bead would be drawn to where its surroundings are brightest
    room = (0.95 * top - outside) / np.maximum(level - outside, 1e-9)
    share = min(0.5, float(np.percentile(room, 5)))
    half = np.minimum(outside + share * (level - outside), 0.97 * top)[:, None]
    below = grey < half
    at = np.argmax(below, axis=1)
    used = below.any(1) & (at > 0)
    at = np.clip(at, 1, None)
    rows = np.arange(len(directions))
    inner, outer = grey[rows, at - 1], grey[rows, at]
    part = np.where(inner > outer, (inner - half[:, 0]) / np.maximum(inner - outer, 1e-9), 0.0)
    edge = along[at - 1] + 0.1 * np.clip(part, 0, 1)
    inside_box = ((points[rows, -1] >= 0) & (points[rows, -1] <= np.array(box.shape) - 1)).all(1)
    return middle + edge[:, None] * directions, outside, used & inside_box


def _fit_sphere(points: FloatArray) -> tuple[FloatArray, float, float]:
    keep = np.ones(len(points), bool)
    centre, radius, rms = points.mean(0), 0.0, 0.0
    for _ in range(3):
        p = points[keep]
        a = np.column_stack([2 * p, np.ones(len(p))])
        solution = np.linalg.lstsq(a, (p**2).sum(1), rcond=None)[0]
        start = np.append(solution[:3], np.sqrt(max(solution[3] + (solution[:3] ** 2).sum(), 1e-9)))
        fit = least_squares(
            lambda q, p=p: np.linalg.norm(p - q[:3], axis=1) - q[3], start, loss="soft_l1", f_scale=0.3
        )
        centre, radius = fit.x[:3], float(fit.x[3])
        residual = np.linalg.norm(points - centre, axis=1) - radius
        rms = float(np.sqrt(np.mean(residual[keep] ** 2)))
        keep = np.abs(residual) < max(4 * rms, 0.3)
    return centre, radius, rms
