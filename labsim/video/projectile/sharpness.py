"""How sharp the top edge is in every frame: a focus that drifts, or a smear that ends when the projectile stops."""

from __future__ import annotations

import numpy as np

from ...records import FloatArray

LEAST_CHANGE = 0.2  # of the blur; sound recordings stay within 0.05, MJPEG within 0.1
CERTAIN = 8.0  # standard errors
LEAST_FRAMES = 16


def describe_sharpness(blur: FloatArray, row: FloatArray) -> str | None:
    """A warning where the edge's blur (px, standard deviation) changes with time or with the speed, else None.

    blur, row : (n,) of every frame, NaN where unknown. A uniform smear of length s adds s²/12 to the variance of the blur.
    """
    known = np.flatnonzero(np.isfinite(blur) & np.isfinite(np.gradient(row)))
    if len(known) < LEAST_FRAMES:
        return None
    speed = np.gradient(row)[known]
    fits = [_fit_line(x, blur[known] ** 2) for x in (speed**2, known.astype(float))]
    cause = int(np.argmin([fit[3] for fit in fits]))
    slope, first, last, _, certain = fits[cause]
    low, high = sorted(np.sqrt(np.maximum([first, last], 1e-6)))
    if certain < CERTAIN or high < (1.0 + LEAST_CHANGE) * low:
        return None
    if cause == 0 and slope > 0:
        share = float(np.sqrt(12.0 * slope))
        return (
            f"the projectile is smeared by up to {share * np.abs(speed).max():.1f} px by its own motion (exposure about "
            f"{share:.1f} of a frame): rows of its tip may err by some tenths of a pixel; expose shorter"
        )
    return (
        f"the blur of the edges changes from {np.sqrt(max(first, 0.0)):.1f} to {np.sqrt(max(last, 0.0)):.1f} px during the "
        "record: the focus drifts, or the projectile leaves the plane of focus, and the rows of its round end drift with it"
    )


def _fit_line(x: FloatArray, y: FloatArray) -> tuple[float, float, float, float, float]:
    """Slope of a robust straight line, its values at the first and the last x, median size of what is left, |slope|/error."""
    keep = np.ones(len(x), bool)
    for _ in range(4):
        slope, offset = np.polyfit(x[keep], y[keep], 1) if np.ptp(x[keep]) > 0 else (0.0, float(np.mean(y)))
        left = y - slope * x - offset
        size = float(np.median(np.abs(left)))
        keep = np.abs(left) < 6.0 * size + 1e-9
    error = 1.4826 * size / (np.std(x[keep]) * np.sqrt(keep.sum()) + 1e-30)
    return (
        float(slope),
        float(slope * x[0] + offset),
        float(slope * x[-1] + offset),
        size,
        abs(slope) / (error + 1e-30),
    )
