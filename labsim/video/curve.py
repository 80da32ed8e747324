"""From a track to the motion below the surface: contact, impact speed, depth, stopping time, v(t) and a(t)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import MeasurementError
from ..records import Camera, DecelerationCurve, FloatArray, Measured, Track
from .segments import STANDARD_GRAVITY, Motion, fit_motion

HIGHEST_DEGREE = 7
AFTER_STOP = 0.5  # share of the stopping time that is fitted beyond the stop
WORTH = 2.0  # Akaike units by which a richer model must win


def fit_deceleration(track: Track, camera: Camera, *, name: object = "track") -> DecelerationCurve:
    """Fit free flight, deceleration, rest or rebound to a track and return the motion with its uncertainties.

    The degree of the deceleration's polynomial and the choice between rest and rebound are made by the data (Akaike's
    criterion). Outliers (more than 5 robust standard deviations) are left out and counted in the warnings. All sigmas
    hold the noise of the rows (raised where the fit scatters more than the error bars say) and the uncertainty of the
    surface row; not the scale of pixel and frame rate, which multiplies everything. ``name`` stands in messages.

    Raises MeasurementError where there are too few frames or the surface is never reached. Where the record ends
    before the projectile does, depth and stopping time are NaN and a warning says so.
    """
    warnings = list(track.warnings)
    trusted = np.flatnonzero(track.valid & np.isfinite(track.tip_row) & np.isfinite(track.time))
    if len(trusted) < 12:
        raise MeasurementError(
            name, "tip_row_px", f"only {len(trusted)} trusted frames; a curve needs at least 12"
        )
    time, row, sigma = track.time[trusted], track.tip_row[trusted], track.sigma[trusted]
    keep = _drop_isolated(time, row, sigma)
    depth = (row - camera.surface_row) * camera.pixel_size
    error = sigma * camera.pixel_size
    reach = float(np.max(depth[keep]))
    if reach <= 3 * float(np.median(error)):
        raise MeasurementError(
            name,
            "tip_row_px",
            f"never reaches the surface (lowest row {np.max(row[keep]):.1f}, surface row {camera.surface_row:.1f}); "
            "check surface_row_px and that rows grow downwards",
        )
    start = _guess_ends(time[keep], depth[keep], name)
    if not np.any(time[keep] < start[0] - 2 * np.median(np.diff(time))):
        warnings.append(
            "fewer than three frames before contact: impact speed and contact time lean on the deceleration"
        )
    # what follows the first stop for long (a second landing, creep) is not part of the model
    window = time <= start[1] + max(AFTER_STOP * (start[1] - start[0]), 6.5 * float(np.median(np.diff(time))))
    motion = None
    for _ in range(4):
        use = keep & window
        motion = _choose_motion(time[use], depth[use], error[use], start)
        if motion is None:
            raise MeasurementError(
                name,
                "tip_row_px",
                "no motion of free flight and deceleration fits; look at the rows against the time",
            )
        misfit = (depth - motion.evaluate(time)[0]) / error
        spread = max(1.0, 1.4826 * float(np.median(np.abs(misfit[use]))))
        renewed = np.abs(misfit) < 5 * spread
        if np.array_equal(renewed & window, use):
            break
        keep = renewed | ~window
        if np.sum(keep & window) < 12:
            raise MeasurementError(
                name, "tip_row_px", "more than half of the frames are outliers; check the track"
            )
    assert motion is not None
    use = keep & window
    outliers = int(np.sum(~keep & window))
    if outliers:
        frames = ", ".join(str(f) for f in track.frame[trusted][~keep & window][:8])
        warnings.append(f"{outliers} outliers left out (frames {frames}{' …' if outliers > 8 else ''})")
    scale = motion.chi_square / max(motion.freedom, 1)
    if scale > 1.0 + 3.0 * np.sqrt(2.0 / max(motion.freedom, 1)):
        warnings.append(
            f"rows scatter {np.sqrt(scale):.2f} times their error bars about the fit; errors were raised"
        )
    motion = _with_noise(motion, max(1.0, scale))
    if not motion.ends or not np.isfinite(motion.find_stop()):
        warnings.append("the record ends before the projectile stops: depth and stopping time are unknown")
    return _describe(motion, track, camera, trusted, use, start, error, depth, warnings)


def _drop_isolated(time: FloatArray, row: FloatArray, sigma: FloatArray) -> np.ndarray:
    """Frames that agree with their neighbours; the worst is dropped first, one at a time, at most a fifth of them."""
    keep = np.ones(len(row), bool)
    while np.sum(keep) > 12 and np.sum(~keep) <= 0.2 * len(row):
        index = np.flatnonzero(keep)
        deviation = _deviate_robustly(time[index], row[index])
        noise = np.maximum(sigma[index], 1.4826 * np.median(np.abs(deviation)))
        score = np.abs(deviation) / noise
        worst = int(np.argmax(score))
        if score[worst] < 8.0:
            break
        keep[index[worst]] = False
    return keep


def _deviate_robustly(time: FloatArray, row: FloatArray) -> FloatArray:
    """Each row minus the median of straight lines through seven pairs of its neighbours, which one spike cannot move."""
    n = len(row)
    guesses = np.full((7, n), np.nan)
    for k, (first, second) in enumerate(((-1, 1), (-2, 2), (-2, -1), (1, 2), (-3, -2), (2, 3), (-3, 3))):
        i = np.arange(max(0, -first), min(n, n - second))
        i = i[(i + first >= 0) & (i + second < n)]
        t1, t2, r1, r2 = time[i + first], time[i + second], row[i + first], row[i + second]
        guesses[k, i] = r1 + (r2 - r1) * (time[i] - t1) / (t2 - t1)
    return row - np.nanmedian(guesses, axis=0)


def _guess_ends(time: FloatArray, depth: FloatArray, name: object) -> tuple[float, float]:
    """Rough contact (first crossing of the surface) and rough stop (first time near the greatest depth)."""
    below = np.flatnonzero(depth > 0)
    i = int(below[0])
    if i == 0:
        if depth[0] > 0.2 * np.max(depth):
            raise MeasurementError(
                name, "tip_row_px", "starts below the surface; the free flight before contact is needed"
            )
        t0 = float(time[0])
    else:
        t0 = float(np.interp(0.0, depth[i - 1 : i + 1], time[i - 1 : i + 1]))
    smooth = np.convolve(np.pad(depth, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    noise = 1.4826 * np.median(np.abs(np.diff(depth, 3))) / np.sqrt(20.0)
    deepest = int(np.argmax(smooth))
    near = np.flatnonzero((smooth >= smooth[deepest] - noise) & (time > t0))
    te = float(time[near[0]]) if near.size else t0
    return t0, max(te, t0 + 3 * float(np.median(np.diff(time))))


def _choose_motion(
    time: FloatArray, depth: FloatArray, error: FloatArray, start: tuple[float, float]
) -> Motion | None:
    """The model with the least criterion among rest, rebound and, if nothing stops, an open end; simple ones first."""
    stops = time[-1] > start[1] + 2.5 * float(np.median(np.diff(time)))
    span = start[1] - start[0]
    best: Motion | None = None
    kinds = [(False, True), (True, True)] if stops else [(True, False)]
    for rebound, ends in kinds:
        lead = None
        for degree in range(0 if not rebound else 1, HIGHEST_DEGREE + 1):
            if lead is None:
                starts = [
                    (start[0], start[0] + factor * span)
                    for factor in ((1.0, 1.15, 1.4) if rebound else (1.0, 1.15))
                ]
            else:
                starts = [(lead.parameters[0], lead.parameters[1])]
            for begin in starts:
                motion = fit_motion(time, depth, error, degree, rebound, begin, ends)
                if motion is None or (ends and not _is_sound(motion, time)):
                    continue
                if lead is None or motion.criterion < lead.criterion - (
                    WORTH if motion.degree > lead.degree else 0
                ):
                    lead = motion
            if lead is not None and degree > lead.degree + 2:
                break
        if lead is not None and (best is None or lead.criterion < best.criterion - 2 * WORTH):
            best = lead
    if best is None and stops:
        return _choose_motion(time[time <= start[1]], depth[time <= start[1]], error[time <= start[1]], start)
    return best


def _is_sound(motion: Motion, time: FloatArray) -> bool:
    """Whether a fitted motion is one of a projectile: stops inside the record, and does not turn back before its rest."""
    stop = motion.find_stop()
    t0, te, v0 = motion.parameters[:3]
    if (
        not np.isfinite(stop)
        or t0 + stop >= time[-1]
        or v0 <= 0
        or not np.all(np.isfinite(motion.covariance))
    ):
        return False
    speed = motion.evaluate(t0 + np.linspace(0.0, 0.999, 200) * stop)[1]
    if np.any(speed < -0.01 * v0) or np.any(speed > 1.1 * v0):
        return False
    error = np.sqrt(motion.covariance[1, 1])
    return te < time[-1] and error < 0.5 * (te - t0) and np.all(np.diag(motion.covariance) >= 0)


def _with_noise(motion: Motion, scale: float) -> Motion:
    return Motion(
        motion.degree,
        motion.rebound,
        motion.ends,
        motion.parameters,
        motion.covariance * scale,
        motion.chi_square,
        motion.freedom,
    )


def _describe(
    motion: Motion,
    track: Track,
    camera: Camera,
    trusted: np.ndarray,
    use: np.ndarray,
    start: tuple[float, float],
    error: FloatArray,
    depth: FloatArray,
    warnings: list[str],
) -> DecelerationCurve:
    time = track.time[trusted]
    lowered = _refit_with_surface(motion, camera, time[use], depth[use], error[use])

    shift = camera.surface_row_sigma * camera.pixel_size

    def measure(quantity: Callable[[FloatArray], float], by_surface: float = 0.0) -> Measured:
        """Value with noise and surface uncertainty; ``by_surface`` stands in where the lowered surface gives no fit."""
        value, sigma = motion.propagate(quantity)
        change = by_surface
        if lowered is not None and np.isfinite(quantity(lowered.parameters)):
            change = quantity(lowered.parameters) - float(value)
        return Measured(float(value), float(np.hypot(sigma, change)))

    contact = measure(lambda p: p[0], shift / motion.parameters[2])
    speed = measure(lambda p: p[2])
    nan = Measured(float("nan"), float("nan"))
    stopped = np.isfinite(motion.find_stop())
    penetration = measure(lambda p: motion.find_depth(p), shift) if stopped else nan
    stopping = measure(lambda p: motion.find_stop(0.0, p), shift / motion.parameters[2]) if stopped else nan
    early = measure(lambda p: motion.find_stop(0.02, p), shift / motion.parameters[2]) if stopped else nan
    rebound = None
    if motion.rebound and motion.ends and stopped:
        rebound = measure(lambda p: -motion.evaluate(np.array([p[1]]), p)[1][0])
        if rebound.value < 2 * rebound.sigma:
            rebound = None

    t0 = motion.parameters[0]
    end = time[use][-1]
    at = np.unique(np.concatenate([[t0], track.time[(track.time > t0) & (track.time <= end)]]))
    values, sigmas = [], []
    for k in range(3):
        # times counted from each parameter set's own contact, so that the errors are those of z(t - t0)
        value, sigma = motion.propagate(lambda p, k=k: motion.evaluate(p[0] + (at - t0) + 1e-12, p)[k])
        other = value
        if lowered is not None:
            other = lowered.evaluate(lowered.parameters[0] + (at - t0) + 1e-12)[k]
        values.append(value)
        sigmas.append(np.hypot(sigma, other - value))
    gravity = _fit_gravity(time[use], depth[use], error[use], t0)
    if gravity is not None and abs(gravity.value - STANDARD_GRAVITY) > 3 * gravity.sigma:
        warnings.append(
            f"free flight falls with {gravity.value:.2f} ± {gravity.sigma:.2f} m/s² instead of 9.81: "
            "check pixel scale and frame rate (g ∝ pixel · rate²)"
        )
    residual = np.full(len(track.frame), np.nan)
    residual[trusted] = (depth - motion.evaluate(time)[0]) / camera.pixel_size
    residual[trusted[time > end]] = np.nan
    used = np.zeros(len(track.frame), bool)
    used[trusted[use]] = True
    if stopped:
        ratio = penetration.value / (speed.value * stopping.value)
        if not 0.30 < ratio < 0.70:
            warnings.append(
                f"depth/(speed · stopping time) = {ratio:.2f} is outside 0.30–0.70: check surface and track"
            )
    return DecelerationCurve(
        time=at - t0,
        depth=values[0],
        depth_sigma=sigmas[0],
        velocity=values[1],
        velocity_sigma=sigmas[1],
        acceleration=values[2],
        acceleration_sigma=sigmas[2],
        contact_time=contact,
        impact_speed=speed,
        penetration_depth=penetration,
        stopping_time=stopping,
        warnings=tuple(warnings),
        stopping_time_2_percent=early,
        apparent_gravity=gravity,
        rebound_speed=rebound,
        residual=residual,
        used=used,
        degree=motion.degree,
    )


def _refit_with_surface(
    motion: Motion, camera: Camera, time: FloatArray, depth: FloatArray, error: FloatArray
) -> Motion | None:
    """The same model with the surface one standard uncertainty lower."""
    if camera.surface_row_sigma <= 0:
        return None
    shift = camera.surface_row_sigma * camera.pixel_size
    begin = (motion.parameters[0], motion.parameters[1])
    return fit_motion(time, depth - shift, error, motion.degree, motion.rebound, begin, motion.ends)


def _fit_gravity(time: FloatArray, depth: FloatArray, error: FloatArray, contact: float) -> Measured | None:
    """Acceleration of the free flight alone, a parabola through the frames before contact; None below 6 frames."""
    free = time < contact
    if np.sum(free) < 6:
        return None
    s = time[free] - contact
    matrix = np.column_stack([np.ones_like(s), s, 0.5 * s**2]) / error[free][:, None]
    target = depth[free] / error[free]
    scale = np.linalg.norm(matrix, axis=0)
    solution, _, _, _ = np.linalg.lstsq(matrix / scale, target, rcond=None)
    covariance = np.linalg.pinv((matrix / scale).T @ (matrix / scale))
    chi_square = float(np.sum((matrix / scale @ solution - target) ** 2)) / max(len(s) - 3, 1)
    sigma = np.sqrt(covariance[2, 2] * max(1.0, chi_square)) / scale[2]
    return Measured(float(solution[2] / scale[2]), float(sigma))


def check_drop_height(curve: DecelerationCurve, height: Measured) -> str | None:
    """A warning where the impact speed is not that of a free fall from ``height`` (m) in vacuum, else None."""
    expected = np.sqrt(2 * STANDARD_GRAVITY * height.value)
    sigma = np.hypot(curve.impact_speed.sigma, 0.5 * expected * height.sigma / height.value)
    if abs(curve.impact_speed.value - expected) <= 3 * sigma:
        return None
    return (
        f"impact speed {curve.impact_speed.value:.4f} m/s, but the drop height {1e3 * height.value:.2f} mm gives "
        f"{expected:.4f} ± {sigma:.4f} m/s: check pixel scale and frame rate (speed ∝ pixel · rate)"
    )
