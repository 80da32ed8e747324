"""What one end of the projectile looks like: its opacity, m = 0 background and m = 1 projectile, as a cubic spline."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.ndimage import spline_filter

from ...records import FloatArray
from ..picture.noise import Noise

MARGIN = 3  # template pixels around the region that is compared, for shifts
PAD = 6  # px around a sampled region, so that the spline's ends do not matter


class Template:
    """Opacity around one end; ``opacity[i, j]`` belongs to row i + top, column j + left from the origin. Where ``known`` is
    False no picture showed it and its neighbours stand in."""

    def __init__(self, opacity: FloatArray, top: int, left: int, known: np.ndarray | None = None) -> None:
        self.opacity, self.top, self.left = opacity, top, left
        self.known = np.ones(opacity.shape, bool) if known is None else known
        self.coefficients = spline_filter(opacity, order=3, mode="mirror")
        self.shape = (opacity.shape[0] - 2 * MARGIN, opacity.shape[1] - 2 * MARGIN)

    def moved(self, dy: float, dx: float) -> FloatArray:
        """m on the inner region for the template moved by (dy, dx), each |shift| < 1."""
        wy, wx = spline_weights(float(dy))[0], spline_weights(float(dx))[0]
        c, (h, w) = self.coefficients, self.shape
        first = MARGIN - 2  # five taps from two before to two after the pixel
        along = sum(wy[k] * c[first + k : first + k + h] for k in range(5))
        return sum(wx[k] * along[:, first + k : first + k + w] for k in range(5))

    def shifted(self, dy: float, dx: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """m, ∂m/∂dy and ∂m/∂dx on the inner region for the template moved by (dy, dx), each |shift| < 1."""
        wy, gy = spline_weights(float(dy))
        wx, gx = spline_weights(float(dx))
        c, (h, w) = self.coefficients, self.shape
        first = MARGIN - 2  # five taps from two before to two after the pixel
        along = sum(wy[k] * c[first + k : first + k + h] for k in range(5))
        slope = sum(gy[k] * c[first + k : first + k + h] for k in range(5))
        m = sum(wx[k] * along[:, first + k : first + k + w] for k in range(5))
        my = sum(wx[k] * slope[:, first + k : first + k + w] for k in range(5))
        mx = sum(gx[k] * along[:, first + k : first + k + w] for k in range(5))
        return m, my, mx


@njit(cache=True)
def spline_weights(shift: float) -> tuple[FloatArray, FloatArray]:
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


def sample_opacity(
    picture: np.ndarray,
    background: FloatArray,
    usable: np.ndarray,
    shape: tuple[int, int],
    corner: tuple[int, int],
    spot: tuple[float, float, float, float],
    noise: Noise,
    *,
    ceiling: float = np.inf,
    known: Template | None = None,
) -> tuple[FloatArray, FloatArray] | None:
    """Opacity and its weight on the template's whole grid around (y, x), by cubic interpolation; weight 0 outside.

    shape : rows and columns of the grid; corner : of its first pixel from (y, x); spot : y, x, grey level of the projectile,
    brightness of the picture over the background's.
    Where the picture stands at the ``ceiling``, what ``known`` says of the light above it takes its place: a spline
    through a clipped edge would ring, each sub-pixel phase in its own way.
    """
    h, w = shape
    top, left = corner
    y, x, level, brightness = spot
    oy, ox = round(y), round(x)
    sy, sx = y - oy, x - ox
    rows = np.arange(oy + top - PAD, oy + top + h + PAD)
    columns = np.arange(ox + left - PAD, ox + left + w + PAD)
    inside = ((rows >= 0) & (rows < picture.shape[0]))[:, None] & (
        (columns >= 0) & (columns < picture.shape[1])
    )[None, :]
    r, c = np.clip(rows, 0, picture.shape[0] - 1), np.clip(columns, 0, picture.shape[1] - 1)
    image = picture[np.ix_(r, c)].astype(np.float64)
    ground = brightness * background[np.ix_(r, c)]
    lever = ground - level
    good = inside & usable[np.ix_(r, c)] & (np.abs(lever) > 0)
    opacity = np.where(good, (ground - image) / np.where(np.abs(lever) > 1e-6, lever, 1.0), 0.0)
    if known is not None and np.isfinite(ceiling):
        reach = PAD + MARGIN
        there = Template(np.pad(known.opacity, reach, mode="edge"), 0, 0).moved(sy, sx)
        opacity = np.where(image >= ceiling - 0.5, there, opacity)
    # content moved back so that the origin lies on a pixel
    moved = Template(opacity, 0, 0).moved(-sy, -sx)
    weight = (lever**2 / noise.variance(image))[MARGIN:-MARGIN, MARGIN:-MARGIN]
    if not good.all():
        spoiled = Template((~good).astype(float), 0, 0).moved(-sy, -sx)
        weight = np.where(np.abs(spoiled) < 0.02, weight, 0.0)
    cut = PAD - MARGIN
    return moved[cut:-cut, cut:-cut], weight[cut:-cut, cut:-cut]
