"""Which motion a track shows: rest or rebound, and the degree of its deceleration, by Akaike's criterion."""

from __future__ import annotations

import numpy as np

from ..errors import MeasurementError
from ..records import FloatArray
from .segments import Motion, fit_motion

HIGHEST_DEGREE = 7
WORTH = 2.0  # Akaike units by which a richer model must win


def guess_ends(time: FloatArray, depth: FloatArray, name: object) -> tuple[float, float]:
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


def choose_motion(
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
        return choose_motion(time[time <= start[1]], depth[time <= start[1]], error[time <= start[1]], start)
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
