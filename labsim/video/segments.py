"""The segmented motion of a drop: free flight, deceleration in the dust, then rest or rebound.

Depth z below the undisturbed surface, t0 the contact, te the end of the deceleration, u = (t - t0)/(te - t0):

- t < t0: z = v0 (t - t0) + g (t - t0)²/2, with g free;
- t0 ≤ t ≤ te: acceleration Σ c_k P_k(2u - 1), Legendre polynomials up to the degree that the data ask for;
- t > te: at rest (then v(te) = 0, which fixes c_0 = -v0/(te - t0)) or, with ``rebound``, a free speed and a constant
  acceleration.

Position and speed are continuous, the acceleration may jump at t0 and te. For given t0 and te the model is linear in
everything else, so only these two are searched for (variable projection: Golub & Pereyra 1973).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import least_squares

from ..records import STANDARD_GRAVITY, FloatArray

GRAVITY_PRIOR_SIGMA = 3.0  # m/s^2; only steadies v0 where few frames lie before the contact


@dataclass(frozen=True)
class Motion:
    """One fitted motion. parameters = (t0, te, v0, g, c…, [rebound acceleration]) in SI; covariance alike."""

    degree: int
    rebound: bool
    ends: bool  # False where the record ends before the projectile stops
    parameters: FloatArray
    covariance: FloatArray
    chi_square: float
    freedom: int

    @property
    def criterion(self) -> float:
        """Akaike's criterion with the small-sample term, noise level unknown (up to a constant)."""
        p = len(self.parameters) + 1
        n = self.freedom + len(self.parameters)
        if n <= p + 1:
            return np.inf
        return n * np.log(max(self.chi_square, 1e-300) / n) + 2 * p + 2 * p * (p + 1) / (n - p - 1)

    def evaluate(self, time: FloatArray, parameters: FloatArray | None = None) -> tuple[FloatArray, ...]:
        """Depth (m), speed (m/s) and acceleration (m/s²) at ``time`` (s, shape (n,))."""
        p = self.parameters if parameters is None else parameters
        columns = _design(np.asarray(time, float), p[0], p[1], self.degree, self.rebound)
        return tuple(np.tensordot(p[2:], c, axes=(0, 0)) for c in columns)

    def find_stop(self, fraction: float = 0.0, parameters: FloatArray | None = None) -> float:
        """Time after contact (s) at which the speed first falls to ``fraction`` of the impact speed; NaN if never."""
        p = self.parameters if parameters is None else parameters
        span = p[1] - p[0]
        if fraction == 0.0 and not self.rebound:
            return span if self.ends else np.nan
        s = np.linspace(0.0, 1.0, 2001)
        speed = self.evaluate(p[0] + s * span, p)[1] - fraction * p[2]
        below = np.flatnonzero(speed[1:] <= 0.0)
        if below.size == 0:  # a rebound that is as good as none ends without quite turning back
            return span if self.ends and speed[-1] < 0.02 * p[2] else np.nan
        i = int(below[0])
        step = speed[i] / (speed[i] - speed[i + 1]) if speed[i] != speed[i + 1] else 0.0
        return float(span * (s[i] + step * (s[i + 1] - s[i])))

    def find_depth(self, parameters: FloatArray | None = None) -> float:
        """Depth (m) at the first stop."""
        p = self.parameters if parameters is None else parameters
        stop = self.find_stop(0.0, p)
        return float(self.evaluate(np.array([p[0] + stop]), p)[0][0]) if np.isfinite(stop) else np.nan

    def propagate(self, quantity) -> tuple[FloatArray, FloatArray]:  # type: ignore[no-untyped-def]
        """Value and standard uncertainty of ``quantity(parameters)`` by linear propagation of the covariance."""
        p = self.parameters
        value = np.asarray(quantity(p), float)
        step = 0.2 * np.sqrt(np.diag(self.covariance))
        gradient = []
        for k in range(len(p)):
            up, down = p.copy(), p.copy()
            up[k] += step[k]
            down[k] -= step[k]
            above, below = np.asarray(quantity(up), float), np.asarray(quantity(down), float)
            width = np.where(np.isfinite(above) & np.isfinite(below), 2.0, 1.0) * max(step[k], 1e-300)
            above, below = (
                np.where(np.isfinite(above), above, value),
                np.where(np.isfinite(below), below, value),
            )
            gradient.append((above - below) / width)
        g = np.array(gradient)
        variance = np.einsum("i...,ij,j...->...", g, self.covariance, g)
        return value, np.sqrt(np.maximum(variance, 0.0))


def _legendre_integrals(u: FloatArray, degree: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """P_k(2u-1), its integral from 0 and the integral of that, each (degree + 1, n)."""
    p = legendre.legvander(2.0 * u - 1.0, degree + 2).T
    first = np.empty((degree + 2, len(u)))
    second = np.empty((degree + 1, len(u)))
    first[0], first[1] = u, u**2 - u  # ∫ P_k dx = (P_{k+1} - P_{k-1})/(2k + 1), and dx = 2 du
    for k in range(2, degree + 2):
        first[k] = (p[k + 1] - p[k - 1]) / (2 * (2 * k + 1))
    second[0] = 0.5 * u**2
    for k in range(1, degree + 1):
        second[k] = (first[k + 1] - first[k - 1]) / (2 * (2 * k + 1))
    return p[: degree + 1], first[: degree + 1], second


def _design(
    t: FloatArray, t0: float, te: float, degree: int, rebound: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of depth, speed and acceleration by (v0, g, c…, [rebound acceleration]): (p, n) each."""
    span = te - t0
    before, after = t < t0, t > te
    s = np.where(before, t - t0, 0.0)
    u = np.clip((t - t0) / span, 0.0, 1.0)
    e = np.where(after, t - te, 0.0)
    p0, p1, p2 = _legendre_integrals(u, degree)
    inside = ~before & ~after
    z = [np.where(before, s, u * span + e), 0.5 * s**2]
    v = [np.ones_like(t), s]
    a = [np.zeros_like(t), np.where(before, 1.0, 0.0)]
    for k in range(degree + 1):
        end_speed = span if k == 0 else 0.0  # ∫ P_k over the whole span vanishes for k > 0
        z.append(span**2 * p2[k] + end_speed * e)
        v.append(span * p1[k])
        a.append(np.where(inside, p0[k], 0.0))
    if rebound:
        z.append(0.5 * e**2)
        v.append(e)
        a.append(np.where(after, 1.0, 0.0))
    else:  # v(te) = 0: c_0 = -v0/span
        for rows in (z, v, a):
            rows[0] = rows[0] - rows[2] / span
            del rows[2]
    return np.array(z), np.array(v), np.array(a)


def fit_motion(
    time: FloatArray,
    depth: FloatArray,
    sigma: FloatArray,
    degree: int,
    rebound: bool,
    start: tuple[float, float],
    ends: bool = True,
) -> Motion | None:
    """Fit one model; ``start`` = (t0, te) to begin from. Returns None where it cannot be fitted.

    time (s), depth and sigma (m): shape (n,). With ``ends`` False te is held at the last frame and the speed there is
    free: the record ends before the projectile does.
    """
    columns = 2 + (degree + 1) + (1 if rebound and ends else -1 if not rebound else 0)
    model_rebound = rebound or not ends
    if not ends:
        columns = 2 + degree + 1
    if len(time) < columns + 4:
        return None
    prior = np.zeros(columns)
    prior[1] = 1.0 / GRAVITY_PRIOR_SIGMA
    spacing = float(np.median(np.diff(time)))
    duration = time[-1] - time[0]

    def solve(t0: float, te: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        z = _design(time, t0, te, degree, model_rebound)[0][:columns]
        matrix = np.vstack([(z / sigma).T, prior])
        target = np.append(depth / sigma, STANDARD_GRAVITY / GRAVITY_PRIOR_SIGMA)
        scale = np.linalg.norm(matrix, axis=0) + 1e-300
        linear = np.linalg.lstsq(matrix / scale, target, rcond=1e-12)[0] / scale
        return matrix @ linear - target, linear, matrix

    last = time[-1]

    def residual(q: FloatArray) -> FloatArray:
        return solve(q[0], q[1] if ends else last)[0]

    low = [time[0] - 0.5 * duration, start[0] + 2.0 * spacing]
    high = [start[1] - spacing, last + (0.0 if rebound else 0.5 * duration)]
    first = np.clip(np.array(start), np.array(low) + 1e-9, np.array(high) - 1e-9)
    count = 2 if ends else 1
    try:
        found = least_squares(
            residual,
            first[:count],
            bounds=(low[:count], high[:count]),
            x_scale=spacing,
            diff_step=1e-5,
            max_nfev=60,
            xtol=1e-11,
            ftol=1e-10,
        )
    except (ValueError, np.linalg.LinAlgError):
        return None
    t0, te = float(found.x[0]), float(found.x[1]) if ends else last
    misfit, linear, matrix = solve(t0, te)
    by_t0, by_te = np.zeros(len(matrix)), np.zeros(len(matrix))
    step = 0.02 * spacing
    z_of = lambda a, b: np.tensordot(linear, _design(time, a, b, degree, model_rebound)[0][:columns], 1)  # noqa: E731
    by_t0[:-1] = (z_of(t0 + step, te) - z_of(t0 - step, te)) / (2 * step) / sigma
    nonlinear = [by_t0]
    if ends:
        by_te[:-1] = (z_of(t0, te + step) - z_of(t0, te - step)) / (2 * step) / sigma
        nonlinear.append(by_te)
    jacobian = np.column_stack([*nonlinear, matrix])
    scale = np.linalg.norm(jacobian, axis=0) + 1e-300
    covariance = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale)) / np.outer(scale, scale)
    if not ends:
        covariance = np.insert(np.insert(covariance, 1, 0.0, axis=0), 1, 0.0, axis=1)
        if model_rebound:
            linear = np.append(linear, 0.0)
            covariance = np.pad(covariance, (0, 1))
    parameters = np.concatenate([[t0, te], linear])
    chi_square = float(np.sum(misfit[:-1] ** 2))
    return Motion(
        degree, model_rebound, ends, parameters, covariance, chi_square, len(time) - len(parameters)
    )
