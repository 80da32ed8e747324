"""A curve without a model beside the fitted one: local cubics, never across contact or stop.

Savitzky & Golay (1964) on the true, uneven times: at each frame a cubic through the frames within a window, cut at
contact and stop, where the acceleration jumps. Error bars follow from the linear weights of the rows.
"""

from __future__ import annotations

import numpy as np

from ...records import Camera, DecelerationCurve, FloatArray, Track

WINDOW = 11  # frames
ORDER = 3


def fit_local_polynomial(track: Track, camera: Camera, curve: DecelerationCurve) -> dict[str, FloatArray]:
    """Depth, speed and acceleration with sigmas from local cubics, at the frames that ``curve`` was fitted to.

    Returns arrays of shape (n,): time_s from contact, depth_m, velocity_m_s, acceleration_m_s2 and their _sigma.
    """
    used = curve.used if curve.used is not None else track.valid
    t = track.time[used] - curve.contact_time.value
    z = (track.tip_row[used] - camera.surface_row) * camera.pixel_size
    s = track.sigma[used] * camera.pixel_size
    scale_sigma = camera.pixel_size_sigma / camera.pixel_size
    stop = curve.stopping_time.value
    part = np.where(t < 0, 0, np.where(np.isfinite(stop) & (t > stop), 2, 1))
    rows = np.full((6, len(t)), np.nan)
    for i in range(len(t)):
        same = np.flatnonzero(part == part[i])
        near = same[np.argsort(np.abs(t[same] - t[i]), kind="stable")[:WINDOW]]
        if len(near) < ORDER + 2:
            continue
        d = t[near] - t[i]
        scale = np.max(np.abs(d))
        weights = np.linalg.pinv(np.vander(d / scale, ORDER + 1, increasing=True))[:3]
        for k, factor in enumerate((1.0, 1.0 / scale, 2.0 / scale**2)):
            rows[2 * k, i] = factor * (weights[k] @ z[near])
            own = factor * np.sqrt(np.sum((weights[k] * s[near]) ** 2))
            rows[2 * k + 1, i] = np.hypot(own, scale_sigma * rows[2 * k, i])
    names = (
        "depth_m",
        "depth_sigma_m",
        "velocity_m_s",
        "velocity_sigma_m_s",
        "acceleration_m_s2",
        "acceleration_sigma_m_s2",
    )
    return {"time_s": t, **dict(zip(names, rows, strict=True))}
