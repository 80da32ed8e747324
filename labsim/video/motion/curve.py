"""From a track to the motion below the surface: contact, impact speed, depth, stopping time, v(t) and a(t)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...errors import MeasurementError
from ...records import STANDARD_GRAVITY, Camera, DecelerationCurve, FloatArray, Measured, Track
from .checks import find_second_impact, fit_gravity, measure_alikeness
from .choosing import Choice, choose_motion, guess_ends
from .gaps import describe_moves, find_lost_frames, find_repeats, list_numbers, propose_moves
from .outliers import OUTLIER, follow_median
from .segments import Motion
from .variable_projection import fit_motion

AFTER_STOP = 0.5  # share of the stopping time that is fitted beyond the stop
WIDENINGS = 4  # times that the end of what is fitted is moved on where the stop lies beyond the first guess
LEAST_FRAMES = 12  # with a position
LEAST_AFTER = 12.5  # frames that are, at least: dust that springs back pushes for some frames more


def fit_deceleration(track: Track, camera: Camera, *, name: object = "track") -> DecelerationCurve:
    """Fit free flight, deceleration, rest or rebound to a track and return the motion with its uncertainties.

    Models of every degree that end in rest, in a rebound or in the open are weighed by the data (Schwarz's criterion); all
    figures are means over them, and what the models disagree is in the sigmas. A frame is an outlier where the fitted motion
    cannot explain it (5 robust standard deviations); every frame is judged anew after each fit, and ``used`` says which are
    in. Pictures that were doubled are left out, and frames that the clock hides are found by the motion: of the clocks that the
    rows suggest the one is taken with which one motion explains them best, and ``clock`` holds its times. Sigmas also hold the
    noise of the rows (raised where the fit scatters more than the error bars say, and where neighbouring frames err alike),
    the uncertainty of the surface row, and of the pixel size where ``camera`` gives one; not of the frame rate. ``name``
    stands in messages.

    Raises MeasurementError where there are too few frames or the surface is never reached. Where the record ends
    before the projectile does, depth and stopping time are NaN and a warning says so.
    """
    seen = np.flatnonzero(track.valid & np.isfinite(track.tip_row) & np.isfinite(track.time))
    if len(seen) < LEAST_FRAMES:
        few = f"only {len(seen)} trusted frame{'s' * (len(seen) != 1)}; a curve needs at least {LEAST_FRAMES}"
        raise MeasurementError(name, "tip_row_px", few)
    frame, time = track.frame[seen], track.time[seen]
    row, sigma = track.tip_row[seen], track.sigma[seen]
    repeated = find_repeats(frame, row, sigma)
    valid = track.valid.copy()
    valid[seen[repeated]] = False
    track = replace(track, valid=valid)
    clocks = [(moved, _move(track, seen, moved)) for moved in propose_moves(time, row, sigma, repeated)]
    if len(clocks) > 1:
        # a clock moved for nothing has to gain what an outlier costs
        clocks.sort(
            key=lambda clock: _judge_clock(clock[1], camera) + clock[0].any() * OUTLIER**2 / len(seen)
        )
    moved, track = clocks[0]
    said = describe_moves(frame, moved / float(np.median(np.diff(time))), repeated)
    return _fit_clock(replace(track, warnings=(*track.warnings, *said)), camera, name)


def _move(track: Track, seen: np.ndarray, moved: FloatArray) -> Track:
    """The track with the times of the frames ``seen``, and of those after each, moved by ``moved`` (s)."""
    before = np.clip(np.searchsorted(seen, np.arange(track.time.size), side="right") - 1, 0, None)
    return replace(track, time=track.time + moved[before])


def _judge_clock(track: Track, camera: Camera) -> float:
    """Mean square of what a motion leaves of the rows in units of the error bars, an outlier's counted as OUTLIER²."""
    try:
        curve = _fit_clock(track, camera, "track", search=False)
    except MeasurementError:
        return np.inf
    assert curve.residual is not None
    left = (curve.residual / track.sigma)[np.isfinite(curve.residual)]
    return float(np.mean(np.minimum(left**2, OUTLIER**2)))


def _fit_clock(track: Track, camera: Camera, name: object, *, search: bool = True) -> DecelerationCurve:
    """The same for one clock; ``search``: where rows ask for it, for frames lost while the projectile is slowed."""
    warnings = list(track.warnings)
    trusted = np.flatnonzero(track.valid & np.isfinite(track.tip_row) & np.isfinite(track.time))
    time, row, sigma = track.time[trusted], track.tip_row[trusted], track.sigma[trusted]
    depth = (row - camera.surface_row) * camera.pixel_size
    error = sigma * camera.pixel_size
    if float(np.max(follow_median(depth))) <= 3 * float(np.median(error)):
        raise MeasurementError(
            name,
            "tip_row_px",
            f"never reaches the surface (lowest row {np.max(follow_median(row)):.1f}, surface row {camera.surface_row:.1f}); "
            "check surface_row_px and that rows grow downwards",
        )
    start = guess_ends(time, depth, name)
    spacing = float(np.median(np.diff(time)))
    if not np.any(time < start[0] - 2 * spacing):
        warnings.append(
            "fewer than three frames before contact: impact speed and contact time lean on the deceleration"
        )
    # what follows the first stop for long (a second landing, creep) is not part of the model
    for _ in range(WIDENINGS):
        window = time <= start[1] + max(AFTER_STOP * (start[1] - start[0]), LEAST_AFTER * spacing)
        choice = choose_motion(time[window], depth[window], error[window], start)
        end = choice.best.motion.loose if choice is not None and choice.goes_on else start[1]
        enough = choice is not None and end + 0.2 * (end - start[0]) < time[window][-1]
        if window.all() or enough:
            break
        start = start[0], max(end, start[0] + 1.4 * (start[1] - start[0]))
    if choice is None:
        raise MeasurementError(
            name,
            "tip_row_px",
            "no motion of free flight and deceleration fits; look at the rows against the time",
        )
    clock = track.time.copy()
    gap = find_lost_frames(time[window], depth[window], error[window], start, choice) if search else None
    if gap is not None:
        place, lost, choice = gap
        clock[trusted[place] :] += lost * spacing
        time = clock[trusted]
        step = np.where(np.arange(len(trusted)) >= place, lost, 0)
        warnings += describe_moves(track.frame[trusted], step, np.zeros(len(trusted), bool))
    motion = choice.best.motion
    use = np.zeros(len(time), bool)
    use[window] = choice.best.used
    outliers = np.flatnonzero(window & ~use)
    if outliers.size:
        many = "s" if outliers.size > 1 else ""
        frames = list_numbers([int(number) for number in track.frame[trusted][outliers]])
        warnings.append(f"{outliers.size} outlier{many} left out (frame{many} {frames})")
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
    return _describe(
        choice,
        max(1.0, scale) * alike,
        replace(track, time=clock),
        camera,
        trusted,
        use,
        error,
        depth,
        warnings,
    )


def _describe(
    choice: Choice,
    growth: float,
    track: Track,
    camera: Camera,
    trusted: np.ndarray,
    use: np.ndarray,
    error: FloatArray,
    depth: FloatArray,
    warnings: list[str],
) -> DecelerationCurve:
    time = track.time[trusted]
    motion = choice.best.motion
    lowered = _refit_with_surface(motion, camera, time[use], depth[use], error[use])
    shift = camera.surface_row_sigma * camera.pixel_size
    scale = camera.pixel_size_sigma / camera.pixel_size

    def measure(
        quantity: Callable[[Motion, FloatArray], float], by_surface: float = 0.0, by_scale: float = 0.0
    ) -> Measured:
        """Value with the uncertainties of noise, choice of model, surface and scale.

        ``by_surface`` stands in where the lowered surface gives no fit; ``by_scale`` is the power of the pixel size.
        """
        value, sigma = choice.propagate(quantity, growth)
        change = by_surface
        if lowered is not None and np.isfinite(quantity(lowered, lowered.parameters)):
            change = quantity(lowered, lowered.parameters) - quantity(motion, motion.parameters)
        by_pixel = by_scale * scale * float(value)
        return Measured(float(value), float(np.sqrt(sigma**2 + change**2 + by_pixel**2)))

    later = shift / motion.parameters[2]
    contact = measure(lambda m, p: p[0], later)
    speed = measure(lambda m, p: p[2], by_scale=1.0)
    stopping = measure(lambda m, p: m.find_stop(0.0, p), later)
    early = measure(lambda m, p: m.find_stop(0.02, p), later)
    penetration = measure(lambda m, p: m.find_depth(p), shift, 1.0)
    stopped = bool(np.isfinite(stopping.value) and np.isfinite(penetration.value))
    if not stopped:
        penetration = stopping = early = Measured(float("nan"), float("nan"))
        warnings.append(
            "no stop can be fitted although the record goes on: depth and stopping time are unknown"
            if choice.goes_on
            else "the record ends before the projectile stops: depth and stopping time are unknown"
        )
    elif again := find_second_impact(
        track.frame[trusted], depth, error, time > contact.value + stopping.value, penetration.value
    ):
        warnings.append(again)
    rebound = None
    if motion.ending in ("rebound", "bounce") and stopped:
        rebound = measure(_find_rebound_speed, by_scale=1.0)
        if rebound.value < 2 * rebound.sigma:
            rebound = None

    t0 = contact.value
    end = time[use][-1]
    at = np.unique(np.concatenate([[t0], track.time[(track.time > t0) & (track.time <= end)]]))

    def follow(m: Motion, p: FloatArray) -> FloatArray:
        """Depth, speed, acceleration, (3, n), at times counted from the parameters' own contact: errors of z(t - t0)."""
        return np.array(m.evaluate(p[0] + (at - t0) + 1e-12, p))

    values, sigmas = choice.propagate(follow, growth)
    change = np.zeros_like(values)
    if lowered is not None:
        change = follow(lowered, lowered.parameters) - follow(motion, motion.parameters)
    sigmas = np.sqrt(sigmas**2 + change**2 + (scale * values) ** 2)
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
        clock=track.time,
    )


def _find_rebound_speed(motion: Motion, parameters: FloatArray) -> float:
    """Speed upwards (m/s) just after the deceleration; NaN where the model has none."""
    if motion.ending == "bounce":
        return -float(parameters[-2])
    if motion.ending == "rebound":
        return -float(motion.evaluate(parameters[1:2] + parameters[-1], parameters)[1][0])
    return float("nan")


def _refit_with_surface(
    motion: Motion, camera: Camera, time: FloatArray, depth: FloatArray, error: FloatArray
) -> Motion | None:
    """The same model with the surface one standard uncertainty lower."""
    if camera.surface_row_sigma <= 0:
        return None
    shift = camera.surface_row_sigma * camera.pixel_size
    return fit_motion(time, depth - shift, error, motion.degree, motion.ending, tuple(motion.ends))
