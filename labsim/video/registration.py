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
        wy, gy = _spline_weights(dy)
        wx, gx = _spline_weights(dx)
        c, (h, w) = self.coefficients, self.shape
        first = MARGIN - 2  # five taps from two before to two after the pixel
        along = sum(wy[k] * c[first + k : first + k + h] for k in range(5))
        slope = sum(gy[k] * c[first + k : first + k + h] for k in range(5))
        m = sum(wx[k] * along[:, first + k : first + k + w] for k in range(5))
        my = sum(wx[k] * slope[:, first + k : first + k + w] for k in range(5))
        mx = sum(gx[k] * along[:, first + k : first + k + w] for k in range(5))
        return m, my, mx


def _spline_weights(shift: float) -> tuple[FloatArray, FloatArray]:
    """Cubic B-spline at the five nodes around a pixel of a picture moved by ``shift``, and its derivative by shift."""
    u = -shift - np.arange(-2, 3)
    a = np.abs(u)
    value = np.where(a < 1, 2.0 / 3.0 - a**2 + 0.5 * a**3, np.where(a < 2, (2 - a) ** 3 / 6.0, 0.0))
    slope = np.sign(u) * np.where(a < 1, -2 * a + 1.5 * a**2, np.where(a < 2, -0.5 * (2 - a) ** 2, 0.0))
    return value, -slope


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
    across = np.linspace(-1.0, 1.0, w)[None, :]
    down = np.linspace(-1.0, 1.0, h)[:, None]
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
        m, my, mx = (part[rows, columns] for part in template.shifted(dy, dx))
        a, b = theta[2], theta[3]
        plane = theta[4] * down[rows] + theta[5] * across[:, columns]
        model = a * ground * (1 - m) + b * m
        residual = (image - model - plane) * mask
        weight = mask / noise.variance(model)
        full = weight
        if robust:
            # the model's own sampling error at steep edges must not look like spray
            size = np.abs(residual) * np.sqrt(weight)
            huber = np.where(size > HUBER, HUBER / np.maximum(size, 1e-9), 1.0)
            weight = weight * huber
        lever = b - a * ground
        by_y = lever * my
        slopes = np.stack(
            [
                by_y,
                lever * mx,
                ground * (1 - m),
                m,
                np.broadcast_to(down[rows], m.shape),
                np.broadcast_to(across[:, columns], m.shape),
            ]
        ).reshape(6, -1)
        weighted = slopes * weight.ravel()
        fisher = weighted @ slopes.T
        right = weighted @ residual.ravel()
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
        pixels = mask.sum()
        chi_square = float(np.sum(weight * residual**2) / max(pixels - 6, 1))
        sensitive = full * by_y**2
        lost = 1.0 - float(np.sum(weight * by_y**2) / max(np.sum(sensitive), 1e-30))
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
    return picture[here].astype(np.float64), background[here], mask, rows, columns


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
