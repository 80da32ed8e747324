"""Checks of pixel scale and frame rate that cost nothing: the free flight and the drop height."""

from __future__ import annotations

import numpy as np

from ...records import STANDARD_GRAVITY, DecelerationCurve, FloatArray, Measured
from .outliers import follow_median

MOST_LAGS = 12
MOST_ALIKE = 0.95
LATER_FALL = 0.05  # of the depth: what dust that springs back and a projectile that settles stay below (1.6 % in 28 drops)
CHANCE = 2.5  # standard deviations of a correlation between independent residuals


def fit_gravity(
    time: FloatArray, depth: FloatArray, error: FloatArray, contact: float, scale: float
) -> Measured | None:
    """Acceleration of the free flight alone, a parabola through the frames before contact; None below 6 frames.

    scale : relative uncertainty of the pixel size.
    """
    free = time < contact
    if np.sum(free) < 6:
        return None
    s = time[free] - contact
    matrix = np.column_stack([np.ones_like(s), s, 0.5 * s**2]) / error[free][:, None]
    target = depth[free] / error[free]
    norm = np.linalg.norm(matrix, axis=0)
    solution, _, _, _ = np.linalg.lstsq(matrix / norm, target, rcond=None)
    covariance = np.linalg.pinv((matrix / norm).T @ (matrix / norm))
    chi_square = float(np.sum((matrix / norm @ solution - target) ** 2)) / max(len(s) - 3, 1)
    sigma = np.sqrt(covariance[2, 2] * max(1.0, chi_square)) / norm[2]
    gravity = float(solution[2] / norm[2])
    return Measured(gravity, float(np.hypot(sigma, scale * gravity)))


def measure_alikeness(residual: FloatArray, fitted: int) -> float:
    """By how much the variance of a slow quantity grows because residuals of neighbouring frames are alike; 1 if not.

    The larger of 1 + 2 Σ ρ_k over the lags up to the first correlation that chance could make, and of (1 + ρ)/(1 - ρ) for errors
    that fade by ρ from frame to frame: the ``fitted`` parameters take their slow part out of the residuals, and with it about
    (fitted + (fitted + 2) ρ) / n from ρ_1. residual : (n,) in units of the error bars.
    """
    n = len(residual)
    if n < 20:
        return 1.0
    centred = residual - residual.mean()
    total = float(np.sum(centred**2))
    if total == 0.0:
        return 1.0
    growth, first = 1.0, 0.0
    for lag in range(1, min(MOST_LAGS, n // 4) + 1):
        correlation = float(np.sum(centred[lag:] * centred[:-lag])) / total
        if correlation < CHANCE / np.sqrt(n):
            break
        first = first or correlation
        growth += 2.0 * correlation
    if not first:
        return 1.0
    fading = min((first + fitted / n) / max(1.0 - (fitted + 2) / n, 0.5), MOST_ALIKE)
    return max(growth, (1.0 + fading) / (1.0 - fading))


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


def find_second_impact(
    frame: np.ndarray, depth: FloatArray, error: FloatArray, stopped: np.ndarray, reached: float
) -> str | None:
    """A warning where the projectile falls again after its first stop: a bounce and a landing, or two drops in one record.

    frame, depth (m), error (m), stopped : (n,); ``stopped`` frames follow the stop at depth ``reached`` (m).
    """
    number, way = frame[stopped], follow_median(depth[stopped])
    if len(way) < 5:
        return None
    falls = way - np.minimum.accumulate(way)
    end = int(np.argmax(falls))
    if falls[end] < max(LATER_FALL * reached, 10 * float(np.median(error))):
        return None
    begin = int(np.argmin(way[: end + 1]))
    return (
        f"two impacts in one track: after its first stop the projectile falls again, by {1e3 * falls[end]:.3g} mm "
        f"(frames {number[begin]} to {number[end]}); only the first impact is measured"
    )
