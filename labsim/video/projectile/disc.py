"""A disc drawn out by its own motion, fitted to one frame.

I = g (1 - m) + b m: m the opacity of the smeared disc, b the level of the bead, g the background with a plane of stray
light. The centre is the position at mid exposure, however long the smear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import erf

from ...records import FloatArray
from ..picture.noise import Noise

REACH = 7.0  # px of background that are looked at around the disc
STEPS = 30


@dataclass(frozen=True)
class Disc:
    """A smeared disc fitted to one frame (px): centre, its error bar, length of the smear, radius, blur, grey level,
    root mean square of what is left (grey levels), and the degrees of its outline that could be seen."""

    y: float
    x: float
    sigma: float
    smear: float
    radius: float
    blur: float
    level: float
    misfit: float
    arc: float


def fit_disc(
    picture: np.ndarray,
    background: FloatArray,
    usable: np.ndarray,
    light: tuple[Noise, float, float],
    start: tuple[float, float],
    radius: float,
    smear: float,
    slope: float,
) -> Disc | None:
    """Least squares of a smeared disc in one frame, with damped Gauss-Newton steps and Huber weights.

    light : noise, the bead's level and the frame's brightness;
    start : centre (row, column); slope : columns per row of the direction of motion. None where it does not converge.
    """
    half_y, half_x = radius + 0.5 * smear + REACH, radius + REACH
    y0, y1 = max(0, int(start[0] - half_y)), min(picture.shape[0], int(start[0] + half_y) + 2)
    x0, x1 = max(0, int(start[1] - half_x)), min(picture.shape[1], int(start[1] + half_x) + 2)
    if y1 - y0 < 8 or x1 - x0 < 8:
        return None
    part = (slice(y0, y1), slice(x0, x1))
    seen = usable[part]
    if seen.sum() < 60:
        return None
    yy, xx = (a[seen].astype(float) for a in np.mgrid[y0:y1, x0:x1])
    image = picture[part][seen].astype(float)
    camera, level, bright = light
    ground = bright * background[part][seen]
    down, across = (yy - start[0]) / half_y, (xx - start[1]) / half_x
    along = np.array([1.0, slope]) / np.hypot(1.0, slope)
    noise = float(np.sqrt(np.mean(camera.variance(image))))
    # centre row and column, smear, radius, blur, level of the bead, and the plane of stray light
    q = np.array([*start, max(smear, 0.5), radius, 1.2, level * bright, 0.0, 0.0, 0.0])
    damping, previous, spread = 1e-3, np.inf, noise

    def model(q: FloatArray) -> tuple[FloatArray, FloatArray]:
        m, slopes = draw_disc(yy, xx, q[:5], along)
        lit = ground + q[6] + q[7] * down + q[8] * across
        lever = (q[5] - lit)[:, None]
        clear = 1.0 - m
        jacobian = np.column_stack([lever * slopes, m, clear, clear * down, clear * across])
        return image - lit * clear - q[5] * m, jacobian

    residual, jacobian = model(q)
    for step_number in range(STEPS):
        spread = max(noise, 1.4826 * float(np.median(np.abs(residual))))
        weight = np.minimum(1.0, 2.5 * spread / np.maximum(np.abs(residual), 1e-9))
        normal = jacobian.T @ (weight[:, None] * jacobian)
        right = jacobian.T @ (weight * residual)
        previous = float(np.sum(weight * residual**2))
        scale = np.sqrt(np.diag(normal)) + 1e-9
        for _ in range(6):
            damped = normal / np.outer(scale, scale) + damping * np.eye(9)
            step = np.linalg.solve(damped, right / scale) / scale
            trial = q + step
            trial[2] = np.clip(trial[2], 0.05, 6 * radius)
            trial[3] = np.clip(trial[3], 0.5 * radius, 2 * radius)
            trial[4] = np.clip(trial[4], 0.3, 0.5 * radius)
            outcome = model(trial)
            if np.sum(weight * outcome[0] ** 2) <= previous:
                break
            damping *= 8.0
        else:
            break
        moved = float(np.abs(trial[:2] - q[:2]).max())
        q, (residual, jacobian) = trial, outcome
        damping = max(damping / 8.0, 1e-6)
        if moved < 1e-3 and step_number > 3:
            break
    if not np.all(np.isfinite(q)) or abs(q[0] - start[0]) > half_y or abs(q[1] - start[1]) > half_x:
        return None
    variance = max(noise**2, float(np.sum(weight * residual**2) / max(len(residual) - 9, 1)))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    sigma = float(np.sqrt(max(inverse[0, 0], 0.0) * variance))
    arc = _see_arc(usable, q, along)
    q[3] += q[4] ** 2 / (2 * q[3])  # to first order a blurred disc looks p²/(2R) smaller than it is
    return Disc(q[0], q[1], sigma, q[2], q[3], q[4], q[5], float(np.sqrt(variance)), arc)


@cache
def _gauss(count: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(count)


def draw_disc(
    yy: FloatArray, xx: FloatArray, shape: FloatArray, along: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Opacity (n,) of a blurred disc drawn out along ``along`` at pixels (yy, xx), and its slopes (n, 5).

    shape : centre row and column, smear, radius, blur (px). The mean over the smear is a Gauss-Legendre sum.
    """
    y, x, smear, radius, blur = shape
    nodes, weights = _gauss(int(np.clip(np.ceil(smear / (1.5 * blur)) + 2, 2, 24)))
    m, slopes = np.zeros(len(yy)), np.zeros((len(yy), 5))
    for node, weight in zip(0.5 * nodes, 0.5 * weights, strict=True):
        dy, dx = yy - y - node * smear * along[0], xx - x - node * smear * along[1]
        away = np.maximum(np.hypot(dy, dx), 1e-6)
        z = (radius - away) / blur
        m += weight * 0.5 * (1 + erf(z / np.sqrt(2)))
        density = weight * np.exp(-0.5 * z**2) / (np.sqrt(2 * np.pi) * blur)
        slopes[:, 0] += density * dy / away
        slopes[:, 1] += density * dx / away
        slopes[:, 2] += density * node * (dy * along[0] + dx * along[1]) / away
        slopes[:, 3] += density
        slopes[:, 4] -= density * z
    return m, slopes


def _see_arc(usable: np.ndarray, q: FloatArray, along: FloatArray) -> float:
    """Degrees of the outline that lie on usable pixels inside the picture."""
    angle = np.arange(0.0, 2 * np.pi, np.pi / 90)
    end = np.where(np.cos(angle) > 0, 0.5, -0.5) * q[2]
    rows = np.round(q[0] + q[3] * np.cos(angle) + end * along[0]).astype(int)
    columns = np.round(q[1] + q[3] * np.sin(angle) + end * along[1]).astype(int)
    inside = (rows >= 0) & (rows < usable.shape[0]) & (columns >= 0) & (columns < usable.shape[1])
    inside[inside] = usable[rows[inside], columns[inside]]
    return 360.0 * float(np.mean(inside))
