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
from numba import njit
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

    e : (n,) s since te.
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


def _tabulate_legendre(highest: int) -> FloatArray:
    """Powers of u in P_k(2u - 1), in its integral from 0 and in the integral of that: (3, highest + 1, highest + 3)."""
    tables = np.zeros((3, highest + 1, highest + 3))
    for k in range(highest + 1):
        power = Legendre.basis(k, domain=(0.0, 1.0)).convert(kind=Polynomial)
        for table, each in zip(tables, (power, power.integ(), power.integ(2)), strict=True):
            table[k, : len(each.coef)] = each.coef
    return tables


HIGHEST_DEGREE = 7
_TABLES = _tabulate_legendre(HIGHEST_DEGREE)


@njit(cache=True)
def _fill_columns(t, t0, te, degree, tables, columns):  # pragma: no cover - compiled
    """Depth, speed and acceleration per v0, g and each c, where the dust pushes and no more once it has ceased.

    tables : (3, m, m + 2) as ``_TABLES``; columns : (orders, p, n), zero before.
    """
    orders, span = columns.shape[0], te - t0
    for i in range(t.size):
        since = t[i] - t0
        if orders > 1:
            columns[1, 0, i] = 1.0
        if since < 0.0:
            columns[0, 0, i], columns[0, 1, i] = since, 0.5 * since**2
            if orders > 1:
                columns[1, 1, i] = since
            if orders > 2:
                columns[2, 1, i] = 1.0
        elif t[i] <= te:
            columns[0, 0, i] = since
            u = since / span
            for order in range(orders):
                table, scale = tables[2 - order], span ** (2 - order)
                for k in range(degree + 1):
                    value = 0.0
                    for power in range(k + 2 - order, -1, -1):
                        value = value * u + table[k, power]
                    columns[order, 2 + k, i] = scale * value
        else:  # at te: ∫ P_0 = 1, ∫∫ P_0 = 1/2, ∫∫ P_1 = -1/6, all others vanish there
            e = t[i] - te
            columns[0, 0, i] = since
            columns[0, 2, i] = 0.5 * span**2 + span * e
            if degree > 0:
                columns[0, 3, i] = -(span**2) / 6.0
            if orders > 1:
                columns[1, 2, i] = span


def design_motion(
    t: FloatArray, ends: FloatArray, degree: int, ending: Ending, orders: int = 3
) -> FloatArray:
    """Derivatives of depth, speed and acceleration (the first ``orders`` of them) by (v0, g, c…, …): (orders, p, n).

    ends : (t0, te) or, of a rebound, (t0, te, λ).
    """
    t0, te = ends[:2]
    columns = np.zeros((orders, degree + 3 + {"rebound": 1, "bounce": 2}.get(ending, 0), len(t)))
    _fill_columns(t, t0, te, degree, _TABLES, columns)
    if ending in ("rebound", "bounce"):
        after = np.flatnonzero(t > te)
        e = t[after] - te
        flight = np.maximum(e - ends[2], 0.0) if ending == "rebound" else e
        for rows, one in zip(columns, (0.5 * flight**2, flight, flight > 0.0), strict=False):
            rows[-1, after] = one
        if ending == "bounce":
            for rows, one in zip(columns, (e, 1.0), strict=False):
                rows[-2, after] = one
        else:  # P_k = 1 at te: every c has its share in the push there
            for rows, one in zip(columns, _unload(e, ends[2]), strict=False):
                rows[2 : degree + 3, after] += one
    if ending == "ease":  # the last c is minus the sum of the others
        columns[:, 2:-1] -= columns[:, -1:]
        columns = columns[:, :-1]
    if ending != "open":  # v(te) = 0: c_0 = -v0/span
        columns[:, 0] -= columns[:, 2] / (te - t0)
        columns[:, 2:-1] = columns[:, 3:]
        columns = columns[:, :-1]
    return columns


@njit(cache=True)
def _fill_slopes(t, t0, te, v0, g, twice, once, by_span, faster, slopes):  # pragma: no cover - compiled
    """Derivatives of the depth by t0 and te of a motion that rests after te, or goes on as fast.

    twice, once : the powers of u in Σ c_k times the twofold and the single integral of P_k; by_span : in how the first changes
    with te - t0; faster : how the speed at te changes with te - t0; slopes : (n, 2), zero before.
    """
    span = te - t0
    for i in range(t.size):
        since = t[i] - t0
        if since < 0.0:
            slopes[i, 0] = -v0 - g * since
            continue
        u = min(since / span, 1.0)
        a = b = c = 0.0
        for power in range(twice.size - 1, -1, -1):
            a, b, c = a * u + twice[power], b * u + once[power], c * u + by_span[power]
        grow = 2.0 * span * a + span**2 * c  # by te - t0, at te or for given u
        speed = v0 + span * b
        if t[i] <= te:
            grow -= span * u * b
            slopes[i, 0], slopes[i, 1] = -speed - grow, grow
        else:
            grow += v0 + faster * (t[i] - te)
            slopes[i, 0], slopes[i, 1] = -grow, grow - speed


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
    # Σ c_k times the twofold and the single integral of P_k, as polynomials of u
    twice, once, twice_by_span = (
        weights @ table[: degree + 1, : degree + 3]
        for weights, table in ((c, _TABLES[2]), (c, _TABLES[1]), (by_span, _TABLES[2]))
    )
    slopes = np.zeros((len(t), 2))
    _fill_slopes(t, t0, te, v0, g, twice, once, twice_by_span, c[0] + span * by_span[0], slopes)
    if ending not in ("rebound", "bounce"):
        return slopes
    after = t > te
    e = t[after] - te
    if ending == "bounce":
        slopes[after, 1] -= p[-2] + p[-1] * e
        return slopes
    flight, since = p[-2], np.maximum(e - p[-1], 0.0)
    depth, speed, _, by_loose = _unload(e, p[-1])
    slopes[after, 0] -= np.sum(by_span) * depth
    slopes[after, 1] += np.sum(by_span) * depth - np.sum(c) * speed - flight * since
    loose = np.zeros(len(t))
    loose[after] = np.sum(c) * by_loose - flight * since
    return np.column_stack([slopes, loose])
