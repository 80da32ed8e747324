"""The row of the dust's surface as the rows alone tell it: where free fall ends and the dust begins to push.

A round tip meets the dust with a point, so the force starts from zero and grows with the area of contact,
A(z) = 2Rz - z² up to z = R (over R²). Free fall before, then

    z'' = g - A(z) (a + b v + c v²)        with b = 0, or free

(Poncelet's law with the tip's area; see docs/tracking-curve.md). For a given row of the surface, depth z(t) and speed v(t) of the
motion already found, the law is linear in a, b, c, the first row and the first speed; so the row is the only thing searched
for, and the motion is renewed from the law until it stands still. A force that sets in at once (A = 1) competes, for tips
that are blunt. Laws are weighed by Akaike's criterion; what they disagree enters the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from ...errors import MeasurementError
from ...records import STANDARD_GRAVITY, Camera, DecelerationCurve, FloatArray, Measured, Track
from .curve import fit_deceleration

LAWS = (  # whether the force grows with the tip's area, powers of the speed in it
    (True, (0, 2)),
    (True, (0, 1)),
    (True, (0, 1, 2)),
    (False, (0,)),
    (False, (0, 1)),
)
BLUNT = 0.1  # odds of a force that sets in at once, before the rows are looked at
LAW_BIAS = 0.02  # of the tip radius: rms of the row found less the true one on the independent curves in data/reference
FINE = 1200  # steps in which the law is integrated
SEARCHED, AGAIN = 60, 20  # rows tried before the best is refined; about the best, once the motion is renewed
RENEWALS = 4
ROUNDS = 3


@dataclass(frozen=True)
class _Rows:
    """Frames up to the stop: time (s), row and sigma (px), each (n,); radius (px); gravity (px/s²)."""

    time: FloatArray
    row: FloatArray
    sigma: FloatArray
    radius: float
    gravity: float


def find_surface_row(
    track: Track, camera: Camera, tip_radius: float, curve: DecelerationCurve | None = None
) -> Measured | None:
    """Row (px) at which the tip touches the dust, from the rows and without ``camera.surface_row``; None if they do not tell.

    track : frames of free fall and deceleration; camera : scale and frame rate; the stated surface row only starts the search.
    tip_radius : m, of a hemisphere or sphere; curve : of this track and camera, where it is fitted already. sigma (px) holds
    the noise of the rows, the choice of the law, and the error of the laws themselves (LAW_BIAS). None where no motion can be
    fitted, or fewer than 4 frames lie on either side.
    """
    found = None
    for _ in range(ROUNDS):  # outliers and stop depend a little on the row that the fit starts from
        rows = _take_rows(track, camera, tip_radius, curve)
        found = _weigh_laws(rows) if rows is not None else None
        if found is None or abs(found.value - camera.surface_row) < found.sigma:
            break
        camera, curve = replace(camera, surface_row=found.value), None
    return found


def _weigh_laws(rows: _Rows) -> Measured | None:
    """Mean of the laws by their weights; its variance is theirs and what they disagree."""
    values, variances, criteria = [], [], []
    for by_area, powers in LAWS:
        found = _search(rows, by_area, powers)
        if found is None:
            continue
        row, sigma, chi_square = found
        n, p = len(rows.time), len(powers) + 3
        if n <= p + 2:
            continue
        values.append(row)
        variances.append(sigma**2 * max(1.0, chi_square / (n - p)))
        criterion = n * np.log(chi_square / n) + 2 * p + 2 * p * (p + 1) / (n - p - 1)
        criteria.append(criterion if by_area else criterion - 2 * np.log(BLUNT))
    if not values:
        return None
    weight = np.exp(-0.5 * (np.array(criteria) - min(criteria)))
    weight /= weight.sum()
    mean = float(weight @ np.array(values))
    variance = float(weight @ (np.array(variances) + (np.array(values) - mean) ** 2))
    return Measured(mean, float(np.hypot(np.sqrt(variance), LAW_BIAS * rows.radius)))


def _take_rows(
    track: Track, camera: Camera, tip_radius: float, curve: DecelerationCurve | None
) -> _Rows | None:
    try:
        curve = fit_deceleration(track, camera) if curve is None else curve
    except MeasurementError:
        return None
    assert curve.used is not None and curve.clock is not None
    stop = curve.contact_time.value + curve.stopping_time.value
    use = curve.used & ~(curve.clock > stop)  # every used frame where the record ends before the stop
    if np.sum(use) < 12:
        return None
    pixel = camera.pixel_size
    return _Rows(
        curve.clock[use], track.tip_row[use], track.sigma[use], tip_radius / pixel, STANDARD_GRAVITY / pixel
    )


def _search(rows: _Rows, by_area: bool, powers: tuple[int, ...]) -> tuple[float, float, float] | None:
    """(row, its sigma in px from the noise, χ²) of the best fit of one law."""
    fine = np.linspace(rows.time[0], rows.time[-1], FINE)
    degree = min(9, len(rows.time) // 4)
    smooth = np.polynomial.Legendre.fit(rows.time, rows.row, degree, w=1 / rows.sigma)
    motion = smooth(fine), smooth.deriv()(fine)
    low, high = float(rows.row[3]), float(rows.row[-1]) - 1e-3 * float(np.ptp(rows.row))
    for turn in range(RENEWALS):
        profile = lambda row, motion=motion: _fit_law(rows, by_area, powers, fine, motion, row)[0]  # noqa: E731
        grid = np.linspace(low, high, AGAIN if turn else SEARCHED)
        heights = np.array([profile(row) for row in grid])
        best = int(np.argmin(heights))
        if best in (0, grid.size - 1) and turn:
            return None
        beside = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
        surface = float(minimize_scalar(profile, bounds=beside, method="bounded").x)
        chi_square, motion = _fit_law(rows, by_area, powers, fine, motion, surface)
        reach = 0.15 * (high - low) if turn else 0.3 * (high - low)
        low, high = max(float(rows.row[3]), surface - reach), min(float(rows.row[-4]), surface + reach)
        if not low < surface < high:
            return None
    if np.sum(rows.row > surface) < 4:
        return None
    step = 0.1
    for _ in range(4):  # the step at which χ² has grown by one
        bend = profile(surface + step) - 2 * chi_square + profile(surface - step)
        step = float(np.clip(np.sqrt(2.0 * step**2 / max(bend, 1e-9)), 1e-4, 0.2 * np.ptp(rows.row)))
    return surface, step, chi_square


def _fit_law(
    rows: _Rows,
    by_area: bool,
    powers: tuple[int, ...],
    fine: FloatArray,
    motion: tuple[FloatArray, FloatArray],
    surface: float,
) -> tuple[float, tuple[FloatArray, FloatArray]]:
    """χ² of the law with the surface at row ``surface``, and the rows and speeds (px, px/s) that it gives at ``fine``."""
    place, speed = motion
    depth = np.clip(place - surface, 0.0, None)
    area = np.where(depth < rows.radius, (2 * depth / rows.radius - (depth / rows.radius) ** 2), 1.0)
    pace = np.clip(speed, 0.0, None) / np.max(speed)
    dt = fine[1] - fine[0]
    force = area if by_area else np.clip(depth / (np.max(speed) * dt), 0.0, 1.0)  # at once: within one step
    since = fine - fine[0]
    speeds = [np.zeros_like(fine), np.ones_like(fine)]
    places = [np.ones_like(fine), since]
    for power in powers:
        speeds.append(-_integrate(force * pace**power, dt))
        places.append(_integrate(speeds[-1], dt))
    free = 0.5 * rows.gravity * since**2
    matrix = np.array([np.interp(rows.time, fine, column) for column in places]).T / rows.sigma[:, None]
    target = (rows.row - np.interp(rows.time, fine, free)) / rows.sigma
    size = np.linalg.norm(matrix, axis=0) + 1e-300
    solution = np.linalg.lstsq(matrix / size, target, rcond=1e-12)[0]
    chi_square = float(np.sum((matrix / size @ solution - target) ** 2))
    solution = solution / size
    return chi_square, (
        free + solution @ np.array(places),
        rows.gravity * since + solution @ np.array(speeds),
    )


def _integrate(values: FloatArray, dt: float) -> FloatArray:
    """Running integral from the first value, trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * dt * (values[1:] + values[:-1]))])
