"""The segmented motion of a drop: free flight, deceleration in the dust, then rest or rebound.

Depth z below the undisturbed surface, t0 the contact, te the end of the deceleration, u = (t - t0)/(te - t0):

- t < t0: z = v0 (t - t0) + g (t - t0)²/2, with g free;
- t0 ≤ t ≤ te: acceleration Σ c_k P_k(2u - 1), Legendre polynomials up to the degree that the data ask for;
- t > te: at rest. v(te) = 0 fixes c_0 = -v0/(te - t0). "ease" is a rest that is reached without a jump of the acceleration:
  Σ c_k = 0. After a "rebound" the dust unloads as a spring does: the push a = Σ c_k that it has at te fades in proportion to
  the way back, as a cos(π(t - te)/2λ), and from te + λ on the projectile flies with a constant acceleration. "bounce" is
  thrown back at once by more than that push can: a free speed from te on. "open": the record ends before the projectile does.

Position and speed are continuous (but for the speed of a bounce), the acceleration may jump at t0, te and te + λ. For given
t0, te and λ the model is linear in everything else (see variable_projection.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import Legendre, Polynomial

from ...records import FloatArray

Ending = Literal["rest", "ease", "rebound", "bounce", "open"]


@dataclass(frozen=True)
class Motion:
    """One fitted motion. parameters = (t0, te, v0, g, c…, [speed of a bounce], [acceleration after rebound
    or bounce], [λ of a rebound]) in SI; covariance alike. c_0 is among them of an open end only; at ease the last c is not.
    """

    degree: int
    ending: Ending
    parameters: FloatArray
    covariance: FloatArray
    chi_square: float
    freedom: int

    def evaluate(self, time: FloatArray, parameters: FloatArray | None = None) -> tuple[FloatArray, ...]:
        """Depth (m), speed (m/s) and acceleration (m/s²) at ``time`` (s, shape (n,))."""
        p = self.parameters if parameters is None else parameters
        ends, linear = split_parameters(p, self.ending)
        columns = design_motion(np.asarray(time, float), ends, self.degree, self.ending)
        return tuple(linear @ c for c in columns)

    @property
    def ends(self) -> FloatArray:
        """(t0, te) or, of a rebound, (t0, te, λ)."""
        return split_parameters(self.parameters, self.ending)[0]

    @property
    def loose(self) -> float:
        """When the dust has ceased to push (s)."""
        return float(np.sum(self.ends[1:]))

    def find_stop(self, fraction: float = 0.0, parameters: FloatArray | None = None) -> float:
        """Time after contact (s) at which the speed first falls to ``fraction`` of the impact speed; NaN if never."""
        p = self.parameters if parameters is None else parameters
        span = p[1] - p[0]
        if fraction == 0.0 and self.ending != "open":
            return float(span)
        s = np.linspace(0.0, 1.0, 201)
        speed = self.evaluate(p[0] + s * span, p)[1] - fraction * p[2]
        below = np.flatnonzero(speed[1:] <= 0.0)
        if below.size == 0:
            return np.nan
        i = int(below[0])
        found = s[i] + (s[i + 1] - s[i]) * (
            speed[i] / (speed[i] - speed[i + 1]) if speed[i] != speed[i + 1] else 0.0
        )
        for _ in range(2):  # Newton, never out of the step that holds the root
            _, (pace,), (push,) = self.evaluate(np.array([p[0] + found * span]), p)
            if push < 0:
                found = float(np.clip(found - (pace - fraction * p[2]) / (push * span), s[i], s[i + 1]))
        return float(span * found)

    def find_depth(self, parameters: FloatArray | None = None) -> float:
        """Depth (m) at the first stop."""
        p = self.parameters if parameters is None else parameters
        stop = self.find_stop(0.0, p)
        return float(self.evaluate(np.array([p[0] + stop]), p)[0][0]) if np.isfinite(stop) else np.nan

    def differentiate(self, time: FloatArray) -> FloatArray:
        """Derivatives of the depth at ``time`` by the parameters, (n, p)."""
        ends = differentiate_ends(time, self.parameters, self.degree, self.ending)
        linear = design_motion(time, self.ends, self.degree, self.ending, 1)[0].T
        return order_columns(ends, linear)

    def propagate(
        self, quantity: Callable[[FloatArray], FloatArray | float]
    ) -> tuple[FloatArray, FloatArray]:
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


def split_parameters(p: FloatArray, ending: Ending) -> tuple[FloatArray, FloatArray]:
    """(t0, te) or, of a rebound, (t0, te, λ), and the parameters in which the motion is linear."""
    if ending == "rebound":
        return np.append(p[:2], p[-1]), p[2:-1]
    return p[:2], p[2:]


def join_parameters(ends: FloatArray, linear: FloatArray) -> FloatArray:
    """What ``split_parameters`` has split."""
    return np.concatenate([ends[:2], linear, ends[2:]])


def order_columns(by_ends: FloatArray, by_linear: FloatArray) -> FloatArray:
    """Derivatives (n, p) in the order of the parameters."""
    return np.column_stack([by_ends[:, :2], by_linear, by_ends[:, 2:]])


def _unload(e: FloatArray, loose: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Depth, speed and acceleration of a spring's unloading per its push at te, and the derivative of the depth by λ, (n,) each.

    e : (n,) s since te, 0 before it.
    """
    phase = 0.5 * np.pi / loose
    pushed = e < loose
    late = np.where(pushed, 0.0, e - loose)
    turn = phase * np.where(pushed, e, loose)
    sine, rest = np.sin(turn), 1.0 - np.cos(turn)
    depth = rest / phase**2 + late / phase
    acceleration = np.where(pushed, np.cos(turn), 0.0)
    by_phase = np.where(
        pushed, e * sine / phase**2 - 2.0 * rest / phase**3, -2.0 / phase**3 - late / phase**2
    )
    by_loose = -by_phase * phase / loose - np.where(pushed, 0.0, 1.0 / phase)
    return depth, sine / phase, acceleration, by_loose


def _tabulate_legendre(highest: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Powers of u in P_k(2u - 1), in its integral from 0 and in the integral of that: (highest + 1, highest + 3) each."""
    tables = [np.zeros((highest + 1, highest + 3)) for _ in range(3)]
    for k in range(highest + 1):
        power = Legendre.basis(k, domain=(0.0, 1.0)).convert(kind=Polynomial)
        for table, each in zip(tables, (power, power.integ(), power.integ(2)), strict=True):
            table[k, : len(each.coef)] = each.coef
    return tables[0], tables[1], tables[2]


HIGHEST_DEGREE = 7
_TABLES = _tabulate_legendre(HIGHEST_DEGREE)


def _integrate_legendre(u: FloatArray, degree: int, orders: int) -> list[FloatArray]:
    """Twofold integral of P_k(2u - 1) from 0, its integral and itself (the first ``orders`` of them), (degree + 1, n) each."""
    powers = np.vander(u, degree + 3, increasing=True).T
    return [table[: degree + 1, : degree + 3] @ powers for table in _TABLES[::-1][:orders]]


def design_motion(
    t: FloatArray, ends: FloatArray, degree: int, ending: Ending, orders: int = 3
) -> list[FloatArray]:
    """Derivatives of depth, speed and acceleration (the first ``orders`` of them) by (v0, g, c…, …): (p, n) each.

    ends : (t0, te) or, of a rebound, (t0, te, λ).
    """
    t0, te = ends[:2]
    span = te - t0
    before, after = t < t0, t > te
    inside = np.flatnonzero(~before & ~after)
    s = np.where(before, t - t0, 0.0)
    e = np.where(after, t - te, 0.0)
    integrals = _integrate_legendre((t[inside] - t0) / span, degree, orders)
    columns: list[FloatArray] = [
        np.zeros((degree + 3 + {"rebound": 1, "bounce": 2}.get(ending, 0), len(t))) for _ in range(orders)
    ]
    z = columns[0]
    z[0], z[1] = np.where(before, s, np.clip(t - t0, 0.0, span) + e), 0.5 * s**2
    # at te: ∫ P_0 = 1, ∫∫ P_0 = 1/2, ∫∫ P_1 = -1/6, all others vanish there
    z[2, after] = 0.5 * span**2 + span * e[after]
    if degree > 0:
        z[3, after] = -(span**2) / 6.0
    flight = np.maximum(e - ends[2], 0.0) if ending == "rebound" else e
    if ending in ("rebound", "bounce"):
        z[-1] = 0.5 * flight**2
    if ending == "bounce":
        z[-2] = e
    if orders > 1:
        v = columns[1]
        v[0], v[1], v[2, after] = 1.0, s, span
        if ending in ("rebound", "bounce"):
            v[-1] = flight
        if ending == "bounce":
            v[-2] = after
    if orders > 2:
        columns[2][1] = before
        if ending in ("rebound", "bounce"):
            columns[2][-1] = flight > 0.0
    if ending == "rebound":  # P_k = 1 at te: every c has its share in the push there
        for rows, one in zip(columns, _unload(e, ends[2]), strict=False):
            rows[2 : degree + 3, after] += one[after]
    for k, rows in enumerate(columns):
        rows[2 : degree + 3, inside] = span ** (2 - k) * integrals[k]
    if ending == "ease":  # the last c is minus the sum of the others
        for rows in columns:
            rows[2:-1] -= rows[-1]
        columns = [rows[:-1] for rows in columns]
    if ending != "open":  # v(te) = 0: c_0 = -v0/span
        for rows in columns:
            rows[0] -= rows[2] / span
            rows[2:-1] = rows[3:]
        columns = [rows[:-1] for rows in columns]
    return columns


def differentiate_ends(t: FloatArray, p: FloatArray, degree: int, ending: Ending) -> FloatArray:
    """Derivatives of the depth by t0 and te, (n, 2), and by λ of a rebound, (n, 3)."""
    t0, te, v0, g = p[:4]
    span = te - t0
    c, by_span = np.zeros(degree + 1), np.zeros(degree + 1)  # all coefficients; how they change with te - t0
    if ending != "open":
        c[0], by_span[0] = -v0 / span, v0 / span**2
        given = degree - (ending == "ease")
        c[1 : 1 + given] = p[4 : 4 + given]
        if ending == "ease":
            c[degree] = -np.sum(c[:degree])
            by_span[degree] = -by_span[0]
    else:
        c[:] = p[4 : 5 + degree]
    before, after = t < t0, t > te
    inside = np.flatnonzero(~before & ~after)
    u = (t[inside] - t0) / span
    twice, once = _integrate_legendre(u, degree, 2)
    end = np.zeros(degree + 1)
    end[0] = 0.5
    if degree > 0:
        end[1] = -1.0 / 6.0
    e = t[after] - te
    push, kick = (p[-1], p[-2]) if ending == "bounce" else (0.0, 0.0)
    slopes = np.zeros((len(t), 2))
    slopes[before, 0] = -v0 - g * (t[before] - t0)
    for k, (grows, since) in enumerate(((-1.0, -1.0), (1.0, 0.0))):  # how te - t0 and t - t0 change
        slopes[inside, k] = (
            v0 * since
            + 2 * span * grows * (c @ twice)
            + span * (since - u * grows) * (c @ once)
            + span**2 * grows * (by_span @ twice)
        )
        slopes[after, k] = (
            v0 * grows
            + 2 * span * grows * (c @ end)
            + span**2 * grows * (by_span @ end)
            + grows * (c[0] + span * by_span[0]) * e
            - (k == 1) * (v0 + span * c[0] + kick + push * e)
        )
    if ending != "rebound":
        return slopes
    flight, since = p[-2], np.maximum(e - p[-1], 0.0)
    depth, speed, _, by_loose = _unload(e, p[-1])
    slopes[after, 0] -= np.sum(by_span) * depth
    slopes[after, 1] += np.sum(by_span) * depth - np.sum(c) * speed - flight * since
    loose = np.zeros(len(t))
    loose[after] = np.sum(c) * by_loose - flight * since
    return np.column_stack([slopes, loose])
