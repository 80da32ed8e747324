"""From a track to the motion below the surface: contact, impact speed, depth, stopping time, v(t) and a(t)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import MeasurementError
from ..records import Camera, DecelerationCurve, FloatArray, Measured, Track
from .checks import fit_gravity, measure_alikeness
from .choosing import choose_motion, guess_ends
from .outliers import drop_isolated
from .segments import STANDARD_GRAVITY, Motion, fit_motion

AFTER_STOP = 0.5  # share of the stopping time that is fitted beyond the stop


def fit_deceleration(track: Track, camera: Camera, *, name: object = "track") -> DecelerationCurve:
    """Fit free flight, deceleration, rest or rebound to a track and return the motion with its uncertainties.

    The degree of the deceleration's polynomial and the choice between rest and rebound are made by the data (Akaike's
    criterion). Outliers (more than 5 robust standard deviations) are left out and counted in the warnings. All sigmas
    hold the noise of the rows (raised where the fit scatters more than the error bars say, and where neighbouring frames
    err alike) and the uncertainty of the
    surface row, and of the pixel size where ``camera`` gives one; not of the frame rate. ``name`` stands in messages.

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
    keep = drop_isolated(time, row, sigma)
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
    start = guess_ends(time[keep], depth[keep], name)
    if not np.any(time[keep] < start[0] - 2 * np.median(np.diff(time))):
        warnings.append(
            "fewer than three frames before contact: impact speed and contact time lean on the deceleration"
        )
    # what follows the first stop for long (a second landing, creep) is not part of the model
    window = time <= start[1] + max(AFTER_STOP * (start[1] - start[0]), 6.5 * float(np.median(np.diff(time))))
    motion = None
    for _ in range(4):
        use = keep & window
        motion = choose_motion(time[use], depth[use], error[use], start)
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
        many = "s" if outliers > 1 else ""
        warnings.append(
            f"{outliers} outlier{many} left out (frame{many} {frames}{' …' if outliers > 8 else ''})"
        )
    scale = motion.chi_square / max(motion.freedom, 1)
    if scale > 1.0 + 3.0 * np.sqrt(2.0 / max(motion.freedom, 1)):
        warnings.append(
            f"rows scatter {np.sqrt(scale):.2f} times their error bars about the fit; errors were raised"
        )
    left = ((depth - motion.evaluate(time)[0]) / error)[use]
    alike = measure_alikeness(left, left.size - motion.freedom)
    if alike > 1.0:
        warnings.append(
            f"neighbouring frames err alike: uncertainties of all figures were raised {np.sqrt(alike):.1f} times"
        )
    motion = replace(motion, covariance=motion.covariance * max(1.0, scale) * alike)
    if not motion.ends or not np.isfinite(motion.find_stop()):
        warnings.append("the record ends before the projectile stops: depth and stopping time are unknown")
    return _describe(motion, track, camera, trusted, use, start, error, depth, warnings)


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

    scale = camera.pixel_size_sigma / camera.pixel_size

    def measure(
        quantity: Callable[[FloatArray], float], by_surface: float = 0.0, by_scale: float = 0.0
    ) -> Measured:
        """Value with the uncertainties of noise, surface and scale.

        ``by_surface`` stands in where the lowered surface gives no fit; ``by_scale`` is the power of the pixel size.
        """
        value, sigma = motion.propagate(quantity)
        change = by_surface
        if lowered is not None and np.isfinite(quantity(lowered.parameters)):
            change = quantity(lowered.parameters) - float(value)
        by_pixel = by_scale * scale * float(value)
        return Measured(float(value), float(np.sqrt(sigma**2 + change**2 + by_pixel**2)))

    contact = measure(lambda p: p[0], shift / motion.parameters[2])
    speed = measure(lambda p: p[2], by_scale=1.0)
    nan = Measured(float("nan"), float("nan"))
    stopped = np.isfinite(motion.find_stop())
    penetration = measure(lambda p: motion.find_depth(p), shift, 1.0) if stopped else nan
    stopping = measure(lambda p: motion.find_stop(0.0, p), shift / motion.parameters[2]) if stopped else nan
    early = measure(lambda p: motion.find_stop(0.02, p), shift / motion.parameters[2]) if stopped else nan
    rebound = None
    if motion.rebound and motion.ends and stopped:
        rebound = measure(lambda p: -motion.evaluate(np.array([p[1]]), p)[1][0], by_scale=1.0)
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
        sigmas.append(np.sqrt(sigma**2 + (other - value) ** 2 + (scale * value) ** 2))
    gravity = fit_gravity(time[use], depth[use], error[use], t0, scale)
    if gravity is not None and abs(gravity.value - STANDARD_GRAVITY) > 3 * gravity.sigma:
        warnings.append(
            f"free flight falls with {gravity.value:.2f} ± {gravity.sigma:.2f} m/s² instead of {STANDARD_GRAVITY}: "
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
