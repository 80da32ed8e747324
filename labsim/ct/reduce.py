"""From a scan to its axisymmetric map of the filling factor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import MeasurementError
from ..records import FillingMap, FloatArray, Measured, Scan, Summarised
from .average import CellErrors, SectorAverage, estimate_errors, fit_tilt
from .bead import Bead, find_bead
from .bead_edge import WIDE, find_widest
from .slices.artefacts import Cupping, fit_cupping, measure_rings, remove_cupping, remove_rings
from .slices.grey import GreyCheck, check_grey, check_levels, to_filling_factor, warn_of_grey
from .slices.neighbours import DUST_STEPS, check_neighbours, find_doubled
from .slices.stack import SliceStack, open_stack
from .surface import Surface, find_surface
from .systematic import find_directions, find_halo

CELL = 2  # voxels along an edge of a cell
GUARD = 3.0  # voxels about the bead that belong to its point spread, not to the dust
GUARD_BLURS = 3.5  # the same in standard deviations of a wide point spread; about the surface too
TILT_SEEN = (4.0, np.deg2rad(0.4))  # a lean is followed where it is this many sigma and at least this large
STRONG_CUP = 0.15  # share of the dust's level
STRONG_CUP_WORDS = (
    ", so much that the level about the bead is only as sure as its shape; correct it in the reconstruction"
)
AXIS_APART = 1.0  # voxels between a stated axis and the bead's middle, beyond which it is said
RINGS_SEEN = 0.3  # share of the slices that must show rings before any are taken out


@dataclass(frozen=True, repr=False)
class ReducedScan(Summarised):
    """Everything ``reduce_scan`` found.

    map.sigma is random error and what the picture shows beyond it (``systematic``); the calibration's scale error is common to
    all cells. correlation_r/z : between neighbouring cells of the undisturbed dust. blur : m, standard deviation of the point
    spread (bead edge, across the axis).
    """

    scan: Scan
    map: FillingMap
    errors: CellErrors
    bead: Bead
    surface: Surface
    grey: GreyCheck
    undisturbed: Measured
    voxel_noise: float
    blur: float
    tilt: tuple[float, float]  # rad, along x and y
    tilt_sigma: float  # rad
    tilt_followed: bool
    cupping: Cupping
    ring_rms: float
    masked: np.ndarray  # (nz, nr) True where a cell touches the bead's guard
    facts: dict = field(default_factory=dict)

    def say(self) -> str:
        """Its name, and what its map is."""
        return f"{self.scan.name}, {self.map.say()}"

    def summary(self) -> str:
        """The map, the undisturbed dust, and what is known about the picture."""
        still = f"undisturbed filling factor {self.undisturbed.value:.4g} ± {self.undisturbed.sigma:.1g}"
        return f"{self.scan.name}, {self.map.summary()}\n{still}, voxel noise {self.voxel_noise:.2g}"

    @property
    def usable(self) -> np.ndarray:
        """(nz, nr) True where a cell of dust or air was averaged and the bead's guard does not touch it."""
        found = self.map
        return np.isfinite(found.filling_factor) & np.isfinite(found.sigma) & ~self.masked

    @property
    def point_spread(self) -> float:
        """m; one voxel where the bead's edge shows none."""
        return self.blur if np.isfinite(self.blur) else self.scan.voxel

    @property
    def edge(self) -> float:
        """m below the undisturbed surface, from which on less than a thousandth of a cell is air: the point spread mixes them."""
        return GUARD_BLURS * max(self.point_spread, self.scan.voxel)

    @property
    def bead_centre_z(self) -> float:
        """m, of the tip sphere's centre; 0 at the undisturbed surface, negative below."""
        return -self.map.tip_depth + self.map.bead_radius


def reduce_scan(
    scan: Scan,
    *,
    cell: int = CELL,
    guard: float = GUARD,
    sample_filling_factor: float | None = None,
    correct: bool = True,
    progress: Callable[[float, float, str], None] | None = None,
) -> ReducedScan:
    """Reduce one scan: bead and axis, free surface, artefacts, azimuthal mean with an error for each cell.

    cell : voxels along an edge of a cell. guard : voxels about the bead that are left out, at least. sample_filling_factor
    : of the campaign's sample, for the cross-check of the grey calibration only. correct : remove cupping and rings where
    they are significant. Raises MeasurementError, one line that names file and key.
    """
    report = progress or (lambda done, total, text: None)
    stack = open_stack(scan.slices)
    stack.flipped = scan.first_slice == "bottom"
    warnings = list(stack.warnings)
    check_levels(stack, scan)
    if stack.voxel is not None and abs(stack.voxel / scan.voxel - 1) > 0.01:
        raise MeasurementError(
            scan.slices, "scan.voxel_um",
            f"is {scan.voxel * 1e6:g} but the files state {stack.voxel * 1e6:g}; correct scan.toml",
        )  # fmt: skip
    find_doubled(stack)
    report(0, 4, "bead")
    bead = find_bead(stack, scan)
    warnings += bead.warnings
    blur = find_widest(bead.blur_lateral, bead.blur_axial)
    if blur > WIDE and guard < GUARD_BLURS * blur:
        guard = GUARD_BLURS * blur
        warnings.append(
            f"the bead's edge is blurred over {blur:.1f} voxels; {guard:.0f} voxels about the bead are left out"
        )
    report(1, 4, "surface")
    x, y, k_bead = _place_axis(stack, scan, bead, warnings)
    surface = find_surface(stack, (x, y), k_bead, bead.stated_radius)
    breaks: list[str] = []
    if scan.projectile.tip == "sphere":
        breaks = check_neighbours(stack, bead, surface, 2**scan.bits - 1)
    report(2, 4, "azimuthal mean")
    surface_row = surface.along_normal(k_bead)
    ny, nx = stack.shape
    reach = min(x, y, nx - 1 - x, ny - 1 - y) + 0.5
    cupping, ring_rms = Cupping(), 0.0
    hidden = _bead_mask(stack, scan, bead, guard)
    if correct:
        cupping = fit_cupping(stack, (x, y), bead, surface)
        if cupping.followed:
            share = cupping.amount / (surface.dust - surface.air)
            warnings.append(
                f"cupping removed: {share:.1%} of the dust's level"
                + (STRONG_CUP_WORDS if abs(share) > STRONG_CUP else "")
            )
    shared: np.ndarray | None = None  # rings that all slices have
    ring_sigma = 0.0

    def average(tilt: tuple[float, float], rings_too: bool = True) -> tuple[SectorAverage, float]:
        sums = SectorAverage((ny, nx), stack.count, (x, y, k_bead), cell, reach, tilt, surface.slope)
        rings = []
        for k, image in enumerate(stack):
            mask = hidden(k, tilt)
            grey = image.astype(np.float32)
            if correct:
                if cupping.followed and k > surface.row:
                    grey = remove_cupping(grey, cupping, surface)
                if shared is not None and k > surface.row + 2:
                    grey = grey - shared
                if rings_too and k > surface.row + 2:
                    grey, rms = remove_rings(grey, mask, surface.dust_scatter)
                    rings.append(rms)
            sums.add(k, to_filling_factor(grey, scan), mask)
        if rings and np.mean(np.array(rings) > 0) < RINGS_SEEN:  # the bead's own edge, not the detector
            return average(tilt, rings_too=False)
        return sums, float(np.mean(rings)) if rings else 0.0

    sums, ring_rms = average((0.0, 0.0))
    if ring_rms > 0:
        shared, ring_sigma = measure_rings(stack, bead, surface, cupping)
        if shared is not None:
            sums, left = average((0.0, 0.0))
            ring_rms = float(np.hypot(left, shared.std()))
        warnings.append(f"rings removed: {ring_rms:.2f} grey levels rms")
    rows = (np.arange(sums.nz) + 0.5) * cell - 0.5
    undisturbed_cells = find_undisturbed(sums, rows, bead, surface_row + 6 + 3 * surface.width)
    errors = estimate_errors(sums.sums(), undisturbed_cells)
    tilt, tilt_sigma = fit_tilt(sums.sums(), errors, k_bead, rows, 3.0 * bead.stated_radius)
    size = float(np.hypot(*tilt))
    followed = size > TILT_SEEN[0] * tilt_sigma and size > np.tan(TILT_SEEN[1])
    if followed:
        for _ in range(2):
            sums, ring_rms = average(tilt)
            more, _ = fit_tilt(
                sums.sums(),
                estimate_errors(sums.sums(), undisturbed_cells),
                k_bead,
                rows,
                3.0 * bead.stated_radius,
            )
            tilt = (tilt[0] + more[0], tilt[1] + more[1])
        sums, ring_rms = average(tilt)
        errors = estimate_errors(sums.sums(), undisturbed_cells)
        warnings.append(f"the axis leans by {np.rad2deg(np.hypot(*tilt)):.1f} degrees; the mean follows it")
    report(3, 4, "map")
    voxel = scan.voxel
    r = (np.arange(sums.nr) + 0.5) * cell * voxel
    z = (surface_row - rows) * voxel
    parts = sums.sums()
    count = parts.count.sum(2)
    phi, sigma = parts.mean(), errors.sigma.copy()
    tip_depth = (k_bead + bead.stated_radius - surface_row) * voxel
    rod = scan.projectile.tip != "sphere"
    masked = mask_near_bead(
        r,
        z,
        cell * voxel,
        -tip_depth + scan.projectile.tip_radius,
        scan.projectile.tip_radius,
        guard * voxel,
        rod=rod,
    )
    phi[masked], sigma[masked] = np.nan, np.nan
    height = bead.centre[2] - rows
    near = (np.hypot(r / voxel, height[:, None]) < 2.5 * bead.stated_radius) & ~masked
    systematic = [
        find_directions(parts, errors, near, 0.5 * bead.stated_radius / cell),
        find_halo(
            phi, sigma, r / voxel, height, bead.stated_radius, guard, 3.0 * bead.stated_radius,
            rows > surface_row + 2 + 2 * surface.width,
        ),
    ]  # fmt: skip
    if systematic[0].warnings:  # streaks end with the bead's last slice, and the dust steps there
        breaks = [text for text in breaks if not text.startswith(DUST_STEPS)]
    warnings += breaks
    for each in systematic:
        sigma = np.hypot(sigma, each.size)
        warnings += each.warnings
    if errors.scatter > 0:
        warnings.append(
            f"undisturbed cells scatter by {errors.scatter:.4f} more than noise explains (rings, layers in the picture?): "
            "their error bars are widened to it"
        )
    # rings leave the level of all dust uncertain
    common = ring_sigma / (scan.calibration.grey_per_density * scan.calibration.density_solid)
    sigma[rows > surface_row] = np.hypot(sigma[rows > surface_row], common)
    level, level_sigma = average_undisturbed(phi, sigma, undisturbed_cells & ~masked)
    grey = check_grey(stack, scan, surface, hidden, level, sample_filling_factor)
    warnings += warn_of_grey(grey, surface, bead, scan, level)
    if not 0 < level < 1:
        raise MeasurementError(
            scan.slices, "calibration.grey_per_density",
            f"gives a filling factor of {level:.3f} for the undisturbed dust; it must lie between 0 and 1",
        )  # fmt: skip
    if surface.leans:
        warnings.append(
            f"the dust's surface leans by {np.rad2deg(np.arctan(surface.tilt)):.1f} degrees against the slices; heights are "
            "counted along its normal"
        )
    filling = FillingMap(
        r,
        z,
        phi,
        sigma,
        np.where(masked, 0, count),
        tip_depth,
        scan.projectile.tip_radius,
        (x, y),
        tuple(warnings),
    )
    report(4, 4, "map")
    return ReducedScan(
        scan=scan, map=filling, errors=replace(errors, sigma=sigma), bead=bead, surface=surface, grey=grey,
        undisturbed=Measured(level, float(np.hypot(level_sigma, common))),
        voxel_noise=errors.voxel_noise, blur=bead.blur_lateral * voxel,
        tilt=(float(np.arctan(tilt[0])), float(np.arctan(tilt[1]))), tilt_sigma=float(tilt_sigma),
        tilt_followed=bool(followed), cupping=cupping, ring_rms=ring_rms, masked=masked,
        facts={**stack.facts, "slices": stack.count, "shape": list(stack.shape), "cell": cell, "guard": guard},
    )  # fmt: skip


def _place_axis(stack: SliceStack, scan: Scan, bead: Bead, warnings: list[str]) -> tuple[float, float, float]:
    """Column and row of the axis of the mean, and the slice of the bead's centre. The bead's voxels are left out where they are
    found, wherever the axis is stated."""
    x, y, k = bead.centre
    if scan.axis is None:
        return x, y, k
    ny, nx = stack.shape
    if not (0 < scan.axis[0] < nx - 1 and 0 < scan.axis[1] < ny - 1):
        raise MeasurementError(
            scan.slices, "scan.axis_px",
            f"[{scan.axis[0]:g}, {scan.axis[1]:g}] is not inside the slices, which have {nx} columns and {ny} rows",
        )  # fmt: skip
    away = float(np.hypot(scan.axis[0] - x, scan.axis[1] - y))
    if away > AXIS_APART:
        warnings.append(
            f"the axis is stated {away:.1f} voxels from the middle of the bead, which lies at ({x:.2f}, {y:.2f})"
        )
    return *scan.axis, k


def mask_near_bead(
    r: FloatArray,
    z: FloatArray,
    cell: float,
    bead_centre_z: float,
    bead_radius: float,
    guard: float,
    *,
    rod: bool = False,
) -> np.ndarray:
    """Cells (nz, nr) that come closer to the measured bead than the guard: True where nothing is to be compared.

    r, z : (nr,), (nz,) m, cell centres; cell : m, edge of a cell; bead_centre_z : m, 0 at the surface, negative below.
    A rod hides everything above its tip's centre within its radius and the guard. Depends on the bead alone.
    """
    dr = np.maximum(r - cell / 2, 0)[None, :]
    dz = np.maximum(np.abs(z - bead_centre_z) - cell / 2, 0)[:, None]
    near = np.hypot(dr, dz) < bead_radius + guard
    if rod:
        near |= (z[:, None] > bead_centre_z) & (dr < bead_radius + guard)
    return near


def _bead_mask(stack: SliceStack, scan: Scan, bead: Bead, guard: float) -> Callable:
    """Function (slice, tilt) -> (ny, nx) bool of voxels in the bead or its guard, None where there are none."""
    x0, y0, k0 = bead.centre
    radius = max(bead.stated_radius, bead.radius) + guard
    x = np.arange(stack.shape[1])[None, :]
    y = np.arange(stack.shape[0])[:, None]
    rod = scan.projectile.tip != "sphere"

    def hidden(k: int, tilt: tuple[float, float]) -> np.ndarray | None:
        above = rod and k < k0
        height = 0.0 if above else k - k0
        if abs(height) >= radius:
            return None
        dx, dy = ((k - k0) * t for t in tilt) if above else (0.0, 0.0)
        return (x - x0 - dx) ** 2 + (y - y0 - dy) ** 2 + height**2 < radius**2

    return hidden


def find_undisturbed(sums: SectorAverage, rows: FloatArray, bead: Bead, top: float) -> np.ndarray:
    """Dust below row ``top``, far below the bead; where the stack ends there, dust far beside it."""
    r = (np.arange(sums.nr) + 0.5) * sums.cell
    distance = np.hypot(r[None, :], (rows - bead.centre[2])[:, None])
    deep = (rows[:, None] > top) & (distance > 3.5 * bead.stated_radius)
    below = deep & (rows[:, None] > bead.centre[2] + 3.5 * bead.stated_radius)
    cells = below if below.sum() > 60 else deep
    if cells.sum() < 30:
        raise MeasurementError(
            "scan",
            "scan.slices",
            "no undisturbed dust is in view (3.5 bead radii away); export more slices below the bead",
        )
    return cells


def average_undisturbed(phi: FloatArray, sigma: FloatArray, cells: np.ndarray) -> tuple[float, float]:
    """Mean filling factor of these cells and its standard error, widened where they scatter more than they say."""
    good = cells & np.isfinite(phi) & (sigma > 0)
    weight = 1 / sigma[good] ** 2
    mean = float(np.average(phi[good], weights=weight))
    scatter = float(np.average((phi[good] - mean) ** 2, weights=weight) / np.mean(1 / weight))
    return mean, float(np.sqrt(max(1.0, scatter) / weight.sum()))
