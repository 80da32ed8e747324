"""What the pixels around one end say of its place: score and Fisher matrix of one Gauss-Newton step, compiled."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def weigh_pixel(value: float, model: float, variance: float, ceiling: float) -> tuple[float, float, float]:
    """Score times the standard deviation, information and expected square (both in units of 1/variance) of one pixel.

    A pixel at the ``ceiling`` says only that the light was at least that bright (a censored normal: Tobin 1958). One that
    is expected far above it says nothing, one far below it is an ordinary pixel.
    """
    deviation = math.sqrt(variance)
    limit = ceiling - 0.5
    z = (limit - model) / deviation
    if z > 8.0:
        return (value - model) / deviation, 1.0, 1.0
    if z < -8.0:
        return 0.0 if value >= limit else (value - model) / deviation, 0.0, 0.0
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    beyond = 0.5 * math.erfc(z / math.sqrt(2.0))
    below = (1.0 - beyond) - z * density  # mean square of the pixels that are not clipped, times their share
    information = below + density * density / max(beyond, 1e-300)
    if value >= limit:
        return density / max(beyond, 1e-300), information, below
    return (value - model) / deviation, information, below


@njit(cache=True)
def accumulate(
    c, down, across, corner, shape, image, ground, mask, theta, noise, huber, ceiling
):  # pragma: no cover - compiled
    """Normal equations of one Gauss-Newton step: Fisher matrix (6, 6), right side (6,), and (χ², information kept,
    information at hand, expected χ²). One pass over the pixels; the template's spline is evaluated on the way.

    c : coefficients of the spline; down, across : (values, slopes), (5,) each, of its weights; corner : row and column of the
    image's first pixel in the template; shape : rows and columns of the template; theta : (6,); noise : read variance, gain.
    """
    (wy, gy), (wx, gx) = down, across
    row0, column0 = corner
    h, w = shape
    read_variance, gain = noise
    fisher, right, sums, slope = np.zeros((6, 6)), np.zeros(6), np.zeros(4), np.zeros(6)
    along, steep = np.empty(image.shape[1] + 4), np.empty(image.shape[1] + 4)
    clipped = ceiling < 1e30
    for i in range(image.shape[0]):
        lower = 2.0 * (row0 + i) / (h - 1) - 1.0
        for j in range(image.shape[1] + 4):
            value = tilt = 0.0
            for k in range(5):
                coefficient = c[row0 + i + k + 1, column0 + j + 1]
                value += wy[k] * coefficient
                tilt += gy[k] * coefficient
            along[j], steep[j] = value, tilt
        for j in range(image.shape[1]):
            if mask[i, j] == 0.0:
                continue
            m = my = mx = 0.0
            for k in range(5):
                m += wx[k] * along[j + k]
                mx += gx[k] * along[j + k]
                my += wx[k] * steep[j + k]
            aside = 2.0 * (column0 + j) / (w - 1) - 1.0
            model = theta[2] * ground[i, j] * (1.0 - m) + theta[3] * m
            light = model + theta[4] * lower + theta[5] * aside
            variance = max(read_variance + gain * max(model, 0.0), 1.0 / 12.0)
            residual, information, expected = (image[i, j] - light) / math.sqrt(variance), 1.0, 1.0
            if clipped:
                residual, information, expected = weigh_pixel(image[i, j], light, variance, ceiling)
            trust = 1.0
            size = abs(residual)
            if size > huber:
                trust = huber / size
            weight = trust * information / variance
            score = trust * residual / math.sqrt(variance)
            lever = theta[3] - theta[2] * ground[i, j]
            slope[0], slope[1], slope[2] = lever * my, lever * mx, ground[i, j] * (1.0 - m)
            slope[3], slope[4], slope[5] = m, lower, aside
            for p in range(6):
                right[p] += score * slope[p]
                for q in range(p, 6):
                    fisher[p, q] += weight * slope[p] * slope[q]
            if not clipped or image[i, j] < ceiling - 0.5:
                sums[0] += trust * residual**2
            sums[1] += weight * slope[0] ** 2
            sums[2] += weight / trust * slope[0] ** 2
            sums[3] += expected
    for p in range(6):
        for q in range(p):
            fisher[p, q] = fisher[q, p]
    return fisher, right, sums


@njit(cache=True)
def solve_step(fisher, right):  # pragma: no cover - compiled
    """Gauss-Newton step (6,): fisher · step = right by Cholesky, each parameter in units of its own information.

    A billionth is added to the diagonal so that a parameter without a pixel stands still. NaN where it cannot be solved.
    """
    n = len(right)
    scale, step, lower = np.empty(n), np.empty(n), np.empty((n, n))
    for p in range(n):
        scale[p] = math.sqrt(fisher[p, p]) + 1e-12
    for p in range(n):
        for q in range(p + 1):
            value = fisher[p, q] / (scale[p] * scale[q])
            if p == q:
                value += 1e-9
            for k in range(q):
                value -= lower[p, k] * lower[q, k]
            if p == q:
                if not value > 0.0:
                    step[:] = np.nan
                    return step
                lower[p, p] = math.sqrt(value)
            else:
                lower[p, q] = value / lower[q, q]
    for p in range(n):
        value = right[p] / scale[p]
        for k in range(p):
            value -= lower[p, k] * step[k]
        step[p] = value / lower[p, p]
    for p in range(n - 1, -1, -1):
        value = step[p]
        for k in range(p + 1, n):
            value -= lower[k, p] * step[k]
        step[p] = value / lower[p, p]
    return step / scale
