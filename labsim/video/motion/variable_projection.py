"""Fitting a segmented motion: only contact, end of the deceleration and, of a rebound, the time to unload are searched for.

For given ends the model is linear in everything else (variable projection: Golub & Pereyra 1973, with the derivative of
Kaufman 1975). Frames long before the contact enter as the three numbers that say the same about every parabola through them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...records import STANDARD_GRAVITY, FloatArray
from .segments import (
    Ending,
    Motion,
    design_motion,
    differentiate_ends,
    join_parameters,
    order_columns,
)

GRAVITY_PRIOR_SIGMA = 3.0  # m/s^2; only steadies v0 where few frames lie before the contact


class _FreeFall:
    """Frames long before the contact, (n,) each, as three numbers that say the same about every parabola through them."""

    def __init__(self, time: FloatArray, depth: FloatArray, sigma: FloatArray) -> None:
        self.middle = float(np.mean(time))
        s = time - self.middle
        rows = np.column_stack([np.ones_like(s), s, 0.5 * s**2, depth]) / sigma[:, None]
        scale = np.linalg.norm(rows, axis=0) + 1e-300
        corner = np.linalg.qr(rows / scale, mode="r") * scale
        self.rows, self.target = corner[:3, :3], corner[:3, 3]
        self.left = float(corner[3, 3] ** 2)  # χ² of the best parabola

    def design(self, t0: float, columns: int) -> FloatArray:
        """Their part of the matrix, (3, columns): only v0 and g are in it."""
        back = t0 - self.middle
        part = np.zeros((3, columns))
        part[:, 0] = self.rows @ [-back, 1.0, 0.0]
        part[:, 1] = self.rows @ [0.5 * back**2, -back, 1.0]
        return part

    def differentiate(self, p: FloatArray) -> FloatArray:
        """Derivative of their model by t0, (3,)."""
        return np.asarray(self.rows @ [-p[2] + p[3] * (p[0] - self.middle), -p[3], 0.0])


def fit_motion(
    time: FloatArray,
    depth: FloatArray,
    sigma: FloatArray,
    degree: int,
    ending: Ending,
    start: Sequence[float],
) -> Motion | None:
    """Fit one model; ``start`` = (t0, te[, λ]) to begin from. Returns None where it cannot be fitted.

    time (s), depth and sigma (m): shape (n,). With an "open" end te is held at the last frame and the speed there is free.
    """
    opened = ending == "open"
    columns = 2 + degree + 1 + {"rest": -1, "ease": -2, "rebound": 0, "bounce": 1, "open": 0}[ending]
    if len(time) < columns + 4 or (ending == "ease" and degree < 1):
        return None
    spacing = float(np.median(np.diff(time)))
    duration = time[-1] - time[0]
    reach = 3.0 * spacing + 0.15 * (start[1] - start[0])
    low = np.array([start[0] - reach, start[0] + 2.0 * spacing, 0.02 * spacing])
    high = np.array(
        [
            start[0] + reach,
            time[-1] + (0.0 if ending in ("rebound", "bounce") else 0.5 * duration),
            max(start[1] - start[0], 3.0 * spacing),
        ]
    )
    early = time < low[0]
    free = _FreeFall(time[early], depth[early], sigma[early]) if np.sum(early) > 4 else None
    if free is not None:
        time, depth, sigma = time[~early], depth[~early], sigma[~early]
    steady = 1.0 / GRAVITY_PRIOR_SIGMA
    target = np.concatenate(
        [[STANDARD_GRAVITY * steady], depth / sigma, free.target if free is not None else []]
    )

    def build(q: FloatArray) -> FloatArray:
        prior = np.zeros((1, columns))
        prior[0, 1] = steady
        z = design_motion(time, q, degree, ending, 1)[0]
        return np.vstack([prior, (z / sigma).T, *([free.design(q[0], columns)] if free is not None else [])])

    def solve(q: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray]:
        matrix = build(q)
        scale = np.linalg.norm(matrix, axis=0)
        scale[scale == 0.0] = 1.0  # too few frames in the dust: not seen
        left, size, right = np.linalg.svd(matrix / scale, full_matrices=False)
        inverse = np.where(size > 1e-11 * size[0], 1.0 / np.maximum(size, 1e-300), 0.0)
        linear = right.T @ (inverse * (left.T @ target)) / scale
        misfit = matrix @ linear - target
        return float(misfit @ misfit), misfit, linear, matrix, left

    def slope(q: FloatArray, linear: FloatArray) -> FloatArray:
        p = join_parameters(q, linear)
        by_ends = differentiate_ends(time, p, degree, ending)
        parts = [np.zeros((1, len(q))), by_ends / sigma[:, None]]
        if free is not None:
            parts.append(np.column_stack([free.differentiate(p), np.zeros((3, len(q) - 1))]))
        return np.vstack(parts)[:, :free_ends]

    q = np.array([start[0], time[-1] if opened else start[1]])
    if ending == "rebound":
        q = np.append(q, start[2] if len(start) > 2 else spacing)
    free_ends = 1 if opened else len(q)
    low, high = low[: len(q)], high[: len(q)]
    q[:free_ends] = np.clip(q, low, high)[:free_ends]
    try:
        cost, misfit, linear, matrix, left = solve(q)
        for _ in range(40):
            jacobian = slope(q, linear)
            jacobian = jacobian - left @ (left.T @ jacobian)
            step = np.linalg.lstsq(jacobian * spacing, -misfit, rcond=1e-9)[0] * spacing
            largest = np.max(np.abs(step))
            step *= min(1.0, 0.3 * max(q[1] - q[0], spacing) / max(largest, 1e-300))
            for _ in range(8):
                trial = q.copy()
                trial[:free_ends] = np.clip(q[:free_ends] + step, low[:free_ends], high[:free_ends])
                if trial[1] > trial[0] + spacing:
                    better = solve(trial)
                    if better[0] < cost:
                        break
                step *= 0.4
            else:
                break
            gain, moved = cost - better[0], np.max(np.abs(trial - q))
            q, (cost, misfit, linear, matrix, left) = trial, better
            if gain < max(1e-3, 1e-6 * cost) or moved < 1e-7 * spacing:
                break
        ends = slope(q, linear)
        jacobian = np.column_stack([ends, matrix]) if opened else order_columns(ends, matrix)
    except (ValueError, np.linalg.LinAlgError):
        return None
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-100)
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale)) / scale / scale[:, None]
    if opened:
        covariance = np.insert(np.insert(covariance, 1, 0.0, axis=0), 1, 0.0, axis=1)
    count = len(time) + int(np.sum(early))
    chi_square = cost - misfit[0] ** 2 + (free.left if free is not None else 0.0)
    parameters = join_parameters(q, linear)
    return Motion(degree, ending, parameters, covariance, chi_square, count - len(parameters))
