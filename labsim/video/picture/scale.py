"""Metres per pixel, from a ruler in the picture or from the known diameter of the rod."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from ...errors import MeasurementError
from ...records import Measured

LEAST_TICKS = 10


def scale_from_diameter(diameter_m: float, diameter_sigma_m: float, diameter_px: Measured) -> Measured:
    """Pixel size (m) from a rod of known diameter, with both uncertainties."""
    pixel = diameter_m / diameter_px.value
    relative = np.hypot(diameter_sigma_m / diameter_m, diameter_px.sigma / diameter_px.value)
    return Measured(pixel, pixel * float(relative))


def measure_ruler(
    picture: np.ndarray, spacing_m: float, *, name: object = "ruler"
) -> tuple[Measured, list[str]]:
    """Pixel size (m) from a picture of equally spaced ticks, dark on bright or bright on dark, and warnings.

    The ticks may run along the rows or the columns. Their centres are fitted by a straight line; its residual tells
    about distortion. Raises MeasurementError where fewer than 10 ticks are found. picture: (rows, columns).
    """
    best = None
    for axis in (0, 1):
        profile = np.asarray(picture, float).mean(axis=axis)
        profile -= gaussian_filter1d(profile, max(len(profile) / 12, 4))
        window = profile * np.hanning(len(profile))
        power = np.abs(np.fft.rfft(window)) ** 2
        power[:4] = 0
        k = int(np.argmax(power))
        score = power[k] / (np.median(power[4:]) + 1e-30) * np.var(profile)
        if k > 0 and (best is None or score > best[0]):
            best = (score, profile, len(profile) / k)
    if best is None:
        raise MeasurementError(name, "ruler", "no ticks found; give a picture of a ruler")
    _, profile, period = best
    sign = 1.0 if abs(profile.max()) > abs(profile.min()) else -1.0
    smooth = gaussian_filter1d(sign * profile, 0.6)
    high = 0.4 * np.percentile(smooth, 99)
    peaks = [
        i
        for i in range(2, len(smooth) - 2)
        if smooth[i] > high
        and smooth[i] == smooth[max(0, int(i - 0.4 * period)) : int(i + 0.4 * period) + 1].max()
    ]
    reach = max(2, int(0.3 * period))
    centres = []
    for i in peaks:
        if i - reach < 0 or i + reach >= len(profile):
            continue
        here = np.arange(i - reach, i + reach + 1)
        weight = np.clip(sign * profile[here] - 0.1 * high, 0, None)
        for _ in range(4):
            middle = float(np.sum(weight * here) / np.sum(weight))
            near = np.clip(1.0 - (np.abs(here - middle) - reach + 1.0), 0.0, 1.0)
            weight = np.clip(sign * profile[here], 0, None) * near
        centres.append(middle)
    if len(centres) < LEAST_TICKS:
        raise MeasurementError(name, "ruler", f"only {len(centres)} ticks found; show at least {LEAST_TICKS}")
    c = np.array(centres)
    number = np.round((c - c[0]) / np.median(np.diff(c)))
    slope, offset = np.polyfit(number, c, 1)
    residual = c - slope * number - offset
    keep = np.abs(residual) < 4 * max(1.4826 * float(np.median(np.abs(residual))), 0.02)
    slope, offset = np.polyfit(number[keep], c[keep], 1)
    residual = (c - slope * number - offset)[keep]
    spread = float(np.std(residual, ddof=2))
    sigma = spread / np.sqrt(np.sum((number[keep] - number[keep].mean()) ** 2))
    if spread > 0.1 * slope or np.mean(np.diff(number) == 1) < 0.7:
        raise MeasurementError(
            name, "ruler", "no row of evenly spaced ticks found; show the ruler alone and level"
        )
    warnings = []
    if spread > 0.3:
        warnings.append(f"ticks lie {spread:.2f} px off a straight scale: distorted or tilted ruler")
    pixel = spacing_m / slope
    return Measured(float(pixel), float(pixel * sigma / slope)), warnings
