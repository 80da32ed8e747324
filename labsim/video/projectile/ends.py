"""The two ends of the projectile: a template of each from its own frames, and what its shape says.

The template of an end is the mean opacity of frames in which that end stands free, aligned, averaged and aligned
again. It is fixed for the whole video: a template that follows the picture drifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import erf

from ...records import FloatArray
from ..picture.clipping import extend_edge
from ..picture.scene import Scene
from .registration import register
from .template import MARGIN, Template, sample_opacity

PASSES = 4


@dataclass(frozen=True)
class View:
    """One frame as needed to build a template: picture, brightness, and where the end roughly is."""

    picture: np.ndarray
    brightness: float
    y: float
    x: float


def build_template(
    views: list[View], scene: Scene, usable: np.ndarray, top: int, left: int, shape: tuple[int, int]
) -> Template | None:
    """Average opacity of shape ``shape`` around the end, its [0, 0] at (top, left) from the origin; None if none fits."""
    spots: list[tuple[float, float, float, float] | None] = [
        (v.y, v.x, scene.projectile_level * v.brightness, v.brightness) for v in views
    ]
    template: Template | None = None
    for turn in range(PASSES):
        total, weight = np.zeros(shape), np.zeros(shape)
        for view, spot in zip(views, spots, strict=True):
            if spot is None:
                continue
            sampled = sample_opacity(
                view.picture,
                scene.background,
                usable,
                shape,
                (top, left),
                spot,
                scene.noise,
                ceiling=scene.limit,
                known=template,
            )
            if sampled is None:
                continue
            total += sampled[0] * sampled[1]
            weight += sampled[1]
        if not np.any(weight > 0):
            return None
        opacity = np.where(weight > 0, total / np.maximum(weight, 1e-30), 0.0)
        if np.any(weight == 0):
            opacity = _fill_nearest(opacity, weight > 0)
        if turn == 0 and np.isfinite(scene.limit):
            opacity = extend_edge(opacity, scene.plateau)
        template = Template(opacity, top, left, weight > 0)
        if turn == PASSES - 1:
            break
        renewed: list[tuple[float, float, float, float] | None] = []
        for view, spot in zip(views, spots, strict=True):
            start = spot if spot is not None else (view.y, view.x, scene.projectile_level, view.brightness)
            fit = register(
                view.picture,
                scene.background,
                usable,
                template,
                scene.noise,
                start[0],
                start[1],
                start[2],
                start[3],
                ceiling=scene.limit,
            )
            renewed.append(None if fit is None else (fit.y, fit.x, fit.level, fit.brightness))
        spots = renewed
        known = [(s, v) for s, v in zip(spots, views, strict=True) if s is not None]
        if len(known) < 2:
            return template if turn else None
        # the mean must not wander while the template is made
        shift_y = float(np.mean([s[0] - v.y for s, v in known]))
        shift_x = float(np.mean([s[1] - v.x for s, v in known]))
        spots = [None if s is None else (s[0] - shift_y, s[1] - shift_x, s[2], s[3]) for s in spots]
    return template


def _fill_nearest(values: FloatArray, known: np.ndarray) -> FloatArray:
    from scipy.ndimage import distance_transform_edt

    index = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return values[tuple(index)]


def find_tip_point(
    template: Template, lower: bool = True, known_above: float = -np.inf
) -> tuple[float, float, float, float, float] | None:
    """Circle through the round end of a template: centre row and column from the origin, radius, blur, misfit (rms).

    The opacity across a blurred edge is an error function of the distance from the circle; an edge that curves with
    radius R looks p²/(2R) too small when it is blurred by p, which is put right. Pixels within 60° of the end count.
    Under a saturated background only what is darker was recorded (opacity ``known_above``) and counts. None where the end
    is not round.
    """
    m = template.opacity if lower else template.opacity[::-1]
    known = template.known if lower else template.known[::-1]
    h, w = m.shape
    rows = np.arange(h, dtype=float)
    columns = np.arange(w, dtype=float)
    wide = (m > 0.5).sum(axis=1)
    if wide.max() < 6:
        return None
    last = int(np.flatnonzero(wide > 0)[-1])
    radius = 0.5 * float(wide[max(0, last - int(wide.max())) : last + 1].max())
    middle = float((m[last - 2 : last + 1] * columns).sum() / m[last - 2 : last + 1].sum())
    yy, xx = np.meshgrid(rows, columns, indexing="ij")

    def residual(q: FloatArray) -> FloatArray:
        cy, cx, r, p, base, full = q
        distance = np.hypot(yy[near] - cy, xx[near] - cx)
        return base + (full - base) * 0.5 * (1 - erf((distance - r) / (np.sqrt(2) * p))) - m[near]

    q = np.array([last + 0.5 - radius, middle, radius, 1.2, 0.0, 1.0])
    for _ in range(3):
        distance = np.hypot(yy - q[0], xx - q[1])
        angle = np.abs(np.arctan2(xx - q[1], yy - q[0]))
        near = (angle < np.pi / 3) & (np.abs(distance - q[2]) < 7.0)
        near &= known & (m > known_above)
        if near.sum() < 40:
            return None
        found = least_squares(
            residual,
            q,
            bounds=(
                [-np.inf, -np.inf, 2.0, 0.2, -0.5, 0.5],
                [np.inf, np.inf, 10 * w, 8.0, 0.5, 1.5],
            ),
            x_scale=[1, 1, 1, 0.3, 0.1, 0.1],
            loss="soft_l1",  # a reflection that crosses the edge must not pull the circle
            f_scale=0.05,
        )
        q = found.x
    misfit = 1.4826 * float(np.median(np.abs(residual(q))))
    if misfit > 0.12:
        return None
    cy = q[0] if lower else h - 1 - q[0]
    return cy + template.top, q[1] + template.left, q[2] + q[3] ** 2 / (2 * q[2]), q[3], misfit


def find_edge(template: Template) -> tuple[float, float, float, float, float] | None:
    """Straight top edge: row at the middle column and slope (from the origin), blur p, and the columns that it spans.

    None where the top is not flat (a bead).
    """
    m = template.opacity
    solid = m > 0.5
    columns = np.flatnonzero(solid[-MARGIN - 3])
    if columns.size < 8:
        return None
    left, right = columns[0], columns[-1]
    inner = np.arange(left + max(3, (right - left) // 8), right - max(3, (right - left) // 8) + 1)
    if inner.size < 5:
        return None
    if not solid[:, inner].any(axis=0).all():
        return None
    edges = np.argmax(solid[:, inner], axis=0)
    if np.ptp(edges) > 3 + 0.12 * inner.size:
        return None
    rows = np.arange(m.shape[0], dtype=float)
    yy, xx = np.meshgrid(rows, inner.astype(float), indexing="ij")
    middle = float(inner.mean())
    near = np.abs(yy - np.median(edges)) < 8 + 0.06 * inner.size

    def residual(q: FloatArray) -> FloatArray:
        s = yy[near] - q[0] - q[1] * (xx[near] - middle)
        return 0.5 * (1 + erf(s / (np.sqrt(2) * abs(q[2])))) * q[3] + q[4] - m[:, inner][near]

    found = least_squares(residual, [float(np.median(edges)) - 0.5, 0.0, 1.2, 1.0, 0.0])
    if np.sqrt(np.mean(found.fun**2)) > 0.12:
        return None
    q = found.x
    return (
        q[0] + template.top,
        float(q[1]),
        float(abs(q[2])),
        float(inner[0] + template.left),
        float(inner[-1] + template.left),
    )


def measure_shaft(template: Template) -> tuple[float, float, float] | None:
    """Tilt of the shaft against the columns (rad, positive to the right going down), its diameter and sigma (px).

    From the half-way crossings of both side edges, row by row; None where the sides are not in the template.
    """
    m = template.opacity[MARGIN:-MARGIN]
    solid = (m > 0.5).sum(axis=1)
    rows = (
        np.flatnonzero(solid > 0.8 * np.median(solid[solid > 0])) if np.any(solid > 0) else np.empty(0, int)
    )
    rows = rows[(rows > rows.min() + 3)] if rows.size else rows
    if rows.size < 12:
        return None
    middle, width = [], []
    for r in rows:
        line = m[r]
        inside = np.flatnonzero(line > 0.5)
        if inside.size == 0:
            continue
        i, j = inside[0], inside[-1]
        if i == 0 or j == len(line) - 1:
            return None
        lo = i - (line[i] - 0.5) / (line[i] - line[i - 1])
        hi = j + (line[j] - 0.5) / (line[j] - line[j + 1])
        middle.append(0.5 * (lo + hi))
        width.append(hi - lo)
    if len(middle) < len(rows):
        return None
    tilt = float(np.arctan(np.polyfit(rows, middle, 1)[0]))
    sigma = max(float(np.std(width)) / np.sqrt(len(width)), 0.02)
    return tilt, float(np.mean(width)) * np.cos(tilt), sigma


def fit_edge(
    picture: np.ndarray,
    background: FloatArray,
    usable: np.ndarray,
    edge: tuple[float, float, float, float, float],
    noise_variance: tuple[float, float],
    y: float,
    x: float,
    level: float,
    brightness: float,
    ceiling: float = np.inf,
) -> tuple[float, float, float] | None:
    """Second, independent estimate: erf edge fitted to the top's middle columns. Returns the origin's row, its sigma, and the
    blur of this edge to first order about that of the template (px).

    Pixels at the ``ceiling`` do not count.
    """
    offset, slope, blur, first, last = edge
    c0, c1 = int(np.ceil(x + first)), int(np.floor(x + last))
    centre = y + offset
    r0, r1 = int(np.floor(centre - 7)), int(np.ceil(centre + 8))
    if r0 < 0 or r1 > picture.shape[0] or c0 < 0 or c1 >= picture.shape[1] or c1 - c0 < 4:
        return None
    part = (slice(r0, r1), slice(c0, c1 + 1))
    if not usable[part].any():
        return None
    image, ground = picture[part].astype(float), background[part]
    mask = (usable[part] & (image < ceiling - 0.5)).astype(float)
    yy = np.arange(r0, r1)[:, None] - slope * (np.arange(c0, c1 + 1)[None, :] - (x + 0.5 * (first + last)))
    q = np.array([centre, brightness, level])
    weight = mask / np.where(
        image > 0.5 * (brightness * ground + level), noise_variance[0], noise_variance[1]
    )
    for _ in range(8):
        s = (yy - q[0]) / blur
        m = 0.5 * (1 + erf(s / np.sqrt(2)))
        model = q[1] * ground * (1 - m) + q[2] * m
        density = np.exp(-0.5 * s**2) / np.sqrt(2 * np.pi) / blur
        parts = np.stack([-(q[2] - q[1] * ground) * density, ground * (1 - m), m]).reshape(3, -1)
        weighted = parts * weight.ravel()
        normal, right = weighted @ parts.T, weighted @ (image - model).ravel()
        try:
            step = np.linalg.solve(normal, right)
        except np.linalg.LinAlgError:
            return None
        step[0] = np.clip(step[0], -1.5, 1.5)
        q += step
        if abs(step[0]) < 1e-4:
            sigma = np.sqrt(max(np.linalg.inv(normal)[0, 0], 0.0))
            wider = (parts[0] * s.ravel()) * weight.ravel()
            change = float(wider @ (image - model).ravel()) / max(
                float(wider @ (parts[0] * s.ravel())), 1e-30
            )
            return float(q[0] - offset), float(sigma), blur + change
    return None
