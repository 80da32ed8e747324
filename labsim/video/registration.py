"""Sub-pixel registration of an end of the projectile against a fixed template.

The template is the opacity m (0 background, 1 projectile) of the region around one end, as cubic B-spline
coefficients. A picture is modelled as I = a B (1 - m(p - shift)) + b m(p - shift): B the background, a its brightness, b the
projectile's level. Shift (dy, dx), a and b are solved together by Gauss-Newton steps (Lucas & Kanade 1981), weighted
by the noise of each pixel, with Huber weights against spray. A plane is added for light that drifts
across (glare). The error bar is the element of the inverse of the whole Fisher matrix, so what x, a, b and the plane take
away from y is in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import spline_filter

from ..records import FloatArray
from .scene import Noise

MARGIN = 3  # template pixels around the region that is compared, for shifts
HUBER = 3.0  # standard deviations
ENOUGH = 1e-4  # px, the step at which the iteration ends


@dataclass(frozen=True)
class Fit:
    """Result of one registration: position of the template's origin (px), error bars, and how well it fitted."""

    y: float
    x: float
    sigma: float
    brightness: float
    level: float
    chi_square: float  # per pixel, of the robust residual
    lost: float  # share of the information that the Huber weights took away


class Template:
    """Opacity around one end; ``opacity[i, j]`` belongs to row i + top, column j + left from the origin."""

    def __init__(self, opacity: FloatArray, top: int, left: int) -> None:
        self.opacity, self.top, self.left = opacity, top, left
        self.coefficients = spline_filter(opacity, order=3, mode="mirror")
        self.shape = (opacity.shape[0] - 2 * MARGIN, opacity.shape[1] - 2 * MARGIN)

    def shifted(self, dy: float, dx: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """m, ∂m/∂dy and ∂m/∂dx on the inner region for the template moved by (dy, dx), each |shift| < 1."""
        wy, gy = _spline_weights(float(dy))
        wx, gx = _spline_weights(float(dx))
        c, (h, w) = self.coefficients, self.shape
        first = MARGIN - 2  # five taps from two before to two after the pixel
        along = sum(wy[k] * c[first + k : first + k + h] for k in range(5))
        slope = sum(gy[k] * c[first + k : first + k + h] for k in range(5))
        m = sum(wx[k] * along[:, first + k : first + k + w] for k in range(5))
        my = sum(wx[k] * slope[:, first + k : first + k + w] for k in range(5))
        mx = sum(gx[k] * along[:, first + k : first + k + w] for k in range(5))
        return m, my, mx


@njit(cache=True)
def _spline_weights(shift: float) -> tuple[FloatArray, FloatArray]:
    """Cubic B-spline at the five nodes around a pixel of a picture moved by ``shift``, and its derivative by shift."""
    value, slope = np.empty(5), np.empty(5)
    for k in range(5):
        u = 2.0 - k - shift
        a = abs(u)
        sign = 1.0 if u > 0 else -1.0
        if a < 1:
            value[k], slope[k] = 2.0 / 3.0 - a**2 + 0.5 * a**3, -sign * (1.5 * a**2 - 2 * a)
        elif a < 2:
            value[k], slope[k] = (2 - a) ** 3 / 6.0, sign * 0.5 * (2 - a) ** 2
        else:
            value[k], slope[k] = 0.0, 0.0
    return value, slope


def register(
    picture: np.ndarray,
    background: FloatArray,
    usable: np.ndarray,
    template: Template,
    noise: Noise,
    y: float,
    x: float,
    level: float,
    brightness: float,
    *,
    robust: bool = True,
    steps: int = 12,
) -> Fit | None:
    """Find the template in a picture, starting from (y, x). None where too little of it can be seen.

    picture, background, usable: (rows, columns) alike; ``usable`` False masks pixels (dust, dead, saturated).
    """
    h, w = template.shape
    theta = np.array([0.0, 0.0, brightness, level, 0.0, 0.0])
    oy, ox = round(y), round(x)
    dy, dx = y - oy, x - ox
    region = None
    fisher = np.eye(6)
    chi_square = lost = np.nan
    for _ in range(steps):
        if abs(dy) > 0.6 or abs(dx) > 0.6:
            oy, ox = oy + round(dy), ox + round(dx)
            dy, dx = dy - round(dy), dx - round(dx)
            region = None
        if region is None:
            region = _cut(
                picture, background, usable, oy + template.top + MARGIN, ox + template.left + MARGIN, h, w
            )
            if region is None:
                return None
            image, ground, mask, rows, columns = region
        fisher, right, sums = _accumulate(
            template.coefficients,
            *_spline_weights(float(dy)),
            *_spline_weights(float(dx)),
            rows.start,
            columns.start,
            h,
            w,
            image,
            ground,
            mask,
            theta,
            noise.read_variance,
            noise.gain,
            HUBER if robust else 1e9,
        )
        scale = np.sqrt(np.diag(fisher)) + 1e-12
        try:
            step = np.linalg.solve(fisher / np.outer(scale, scale) + 1e-9 * np.eye(6), right / scale) / scale
        except np.linalg.LinAlgError:
            return None
        jump = max(abs(step[0]), abs(step[1]))
        if jump > 2.0:
            step[:2] *= 2.0 / jump
        dy, dx = dy + step[0], dx + step[1]
        theta[2:] += step[2:]
        chi_square = sums[0] / max(sums[3] - 6, 1)
        lost = 1.0 - sums[1] / max(sums[2], 1e-30)
        if jump < ENOUGH:
            break
    else:
        if jump > 0.02:
            return None
    if not np.isfinite(dy) or abs(oy + dy - y) > 12 or abs(ox + dx - x) > 12:
        return None
    inverse = np.linalg.pinv(fisher / np.outer(scale, scale)) / np.outer(scale, scale)
    return Fit(
        float(oy + dy),
        float(ox + dx),
        float(np.sqrt(max(inverse[0, 0], 0.0))),
        theta[2],
        theta[3],
        chi_square,
        lost,
    )


@njit(cache=True)
def _accumulate(  # type: ignore[no-untyped-def]
    c, wy, gy, wx, gx, row0, column0, h, w, image, ground, mask, theta, read_variance, gain, huber
):  # pragma: no cover - compiled
    """Normal equations of one Gauss-Newton step: Fisher matrix (6, 6), right side (6,), and (χ², information kept,
    information at hand, pixels). One pass over the pixels; the template's spline is evaluated on the way."""
    fisher, right, sums, slope = np.zeros((6, 6)), np.zeros(6), np.zeros(4), np.zeros(6)
    along, steep = np.empty(image.shape[1] + 4), np.empty(image.shape[1] + 4)
    for i in range(image.shape[0]):
        down = 2.0 * (row0 + i) / (h - 1) - 1.0
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
            across = 2.0 * (column0 + j) / (w - 1) - 1.0
            model = theta[2] * ground[i, j] * (1.0 - m) + theta[3] * m
            residual = image[i, j] - model - theta[4] * down - theta[5] * across
            weight = 1.0 / max(read_variance + gain * max(model, 0.0), 1.0 / 12.0)
            full = weight
            size = abs(residual) * np.sqrt(weight)
            if size > huber:
                weight *= huber / size
            lever = theta[3] - theta[2] * ground[i, j]
            slope[0], slope[1], slope[2] = lever * my, lever * mx, ground[i, j] * (1.0 - m)
            slope[3], slope[4], slope[5] = m, down, across
            for p in range(6):
                right[p] += weight * slope[p] * residual
                for q in range(p, 6):
                    fisher[p, q] += weight * slope[p] * slope[q]
            sums[0] += weight * residual**2
            sums[1] += weight * slope[0] ** 2
            sums[2] += full * slope[0] ** 2
            sums[3] += 1.0
    for p in range(6):
        for q in range(p):
            fisher[p, q] = fisher[q, p]
    return fisher, right, sums


def _cut(picture, background, usable, top, left, h, w):  # type: ignore[no-untyped-def]
    """The part of the region inside the picture, with the slices of the template that belong to it."""
    rows = slice(max(0, -top), min(h, picture.shape[0] - top))
    columns = slice(max(0, -left), min(w, picture.shape[1] - left))
    if rows.stop - rows.start < 6 or columns.stop - columns.start < 6:
        return None
    here = (slice(top + rows.start, top + rows.stop), slice(left + columns.start, left + columns.stop))
    mask = usable[here].astype(np.float64)
    if mask.sum() < 40:
        return None
    return (
        picture[here].astype(np.float64),
        np.ascontiguousarray(background[here], np.float64),
        mask,
        rows,
        columns,
    )


def sample_opacity(
    picture: np.ndarray,
    background: FloatArray,
    usable: np.ndarray,
    shape: tuple[int, int],
    top: int,
    left: int,
    y: float,
    x: float,
    level: float,
    brightness: float,
    noise: Noise,
) -> tuple[FloatArray, FloatArray] | None:
    """Opacity and its weight on the template's whole grid around (y, x), by cubic interpolation; weight 0 outside."""
    h, w = shape
    oy, ox = round(y), round(x)
    sy, sx = y - oy, x - ox
    pad = 6
    rows = np.arange(oy + top - pad, oy + top + h + pad)
    columns = np.arange(ox + left - pad, ox + left + w + pad)
    inside = ((rows >= 0) & (rows < picture.shape[0]))[:, None] & (
        (columns >= 0) & (columns < picture.shape[1])
    )[None, :]
    r, c = np.clip(rows, 0, picture.shape[0] - 1), np.clip(columns, 0, picture.shape[1] - 1)
    image = picture[np.ix_(r, c)].astype(np.float64)
    ground = brightness * background[np.ix_(r, c)]
    lever = ground - level
    good = inside & usable[np.ix_(r, c)] & (np.abs(lever) > 0)
    opacity = np.where(good, (ground - image) / np.where(np.abs(lever) > 1e-6, lever, 1.0), 0.0)
    wide = Template(opacity, 0, 0)
    moved = wide.shifted(-sy, -sx)[0]  # content moved back so that the origin lies on a pixel
    spoiled = Template((~good).astype(float), 0, 0).shifted(-sy, -sx)[0]
    weight = np.where(
        np.abs(spoiled) < 0.02, (lever**2 / noise.variance(image))[MARGIN:-MARGIN, MARGIN:-MARGIN], 0.0
    )
    cut = pad - MARGIN
    return moved[cut:-cut, cut:-cut], weight[cut:-cut, cut:-cut]
