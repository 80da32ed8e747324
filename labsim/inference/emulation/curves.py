"""From a handful of runs of one drop to its depth curve anywhere near them.

The features of a run are (ln D, ln T_s, s(τ)): depth over D at fixed fractions τ of the stopping time, to a little beyond the
stop. These are smooth in every parameter even where the curve itself is not (its kink moves with the stop), so low
polynomials in (ln p_m, ln v0, effect amplitude) carry them; docs/error-budget.md gives the measured error.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, CubicSpline, PPoly

from ...records import FloatArray
from ...runs.parts import Motion
from ...sph import DropRun
from ...sph.profile import is_blunt
from ...sph.tips import make_profile

FRACTIONS = np.concatenate([np.linspace(0.0, 1.0, 41), np.linspace(1.025, 1.15, 6)])
# a cubic spline is linear in its values, and all curves have theirs at FRACTIONS: (4, pieces, values)
UNIT_SPLINES = np.ascontiguousarray(CubicSpline(FRACTIONS, np.eye(FRACTIONS.size)).c)
PIECES = 4  # of the spline through the speed up to the stop


def _smooth_to_the_stop(blunt: bool) -> tuple[FloatArray, FloatArray]:
    """(n, n) from speeds at FRACTIONS to those of a cubic spline of PIECES pieces, fitted up to the stop and met at both ends;
    and (n,) what a slope of one at contact adds, where the matrix has none: nothing for a blunt tip, which meets its whole
    force there and whose slope is fitted.

    The force of a run grows particle by particle; it is known over a quarter of the stop, not over a fortieth.
    """
    inside = FRACTIONS[FRACTIONS <= 1.0]
    knots = np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, PIECES + 1), [1.0] * 3])
    basis = BSpline.design_matrix(inside, knots, 3).toarray()
    # the second coefficient less the first, over a third of a piece, is the slope
    by_slope = basis[:, 1] / (3.0 * PIECES)
    if not blunt:
        basis = np.column_stack([basis[:, 0] + basis[:, 1], basis[:, 2:]])
    weights = np.ones(inside.size)
    weights[[0, -1]] = 100.0
    fitted = basis @ np.linalg.pinv(weights[:, None] * basis) * weights
    whole, slope = np.eye(FRACTIONS.size), np.zeros(FRACTIONS.size)
    whole[: inside.size, : inside.size] = fitted
    slope[: inside.size] = by_slope - fitted @ by_slope
    return whole, slope


SMOOTHED = {blunt: _smooth_to_the_stop(blunt) for blunt in (False, True)}


def extract_curve(run: DropRun | Motion) -> FloatArray:
    """(2 + len(FRACTIONS),): ln D, ln T_s and the normalised depths of one run."""
    shape = run.depth_at(FRACTIONS * run.stopping_time) / run.penetration_depth
    return np.concatenate([[np.log(run.penetration_depth), np.log(run.stopping_time)], shape])


def extract_speeds(run: DropRun | Motion) -> FloatArray:
    """(2 + len(FRACTIONS),): ln D, ln T_s and the speeds of one run in D/T_s, whose differences are accelerations: the second
    difference of stored depths would show the straight lines between them. Smooth up to the stop: SMOOTHED.

    Where a tip that is not blunt meets the dust it still falls freely: a force that began with a jump would move contact."""
    speed = np.interp(FRACTIONS * run.stopping_time, run.time, run.velocity)
    depth, stop = run.penetration_depth, run.stopping_time
    smoothed, sloped = SMOOTHED[is_blunt(make_profile(run.setting.projectile))]
    shape = smoothed @ speed * stop / depth + sloped * run.setting.gravity * stop**2 / depth
    return np.concatenate([[np.log(depth), np.log(stop)], shape])


def interpolate_speed(features: FloatArray, time: FloatArray) -> FloatArray:
    """Speed (m/s) at times (s, since contact, >= 0) of what ``extract_speeds`` made; held after the last fraction."""
    depth, stop = np.exp(features[0]), np.exp(features[1])
    return depth / stop * _draw_spline(features)(np.clip(time / stop, 0.0, FRACTIONS[-1]))


def interpolate_depth(features: FloatArray, time: FloatArray) -> FloatArray:
    """Depth (m) at times (s, since contact, >= 0) from the features of a run; held after the last fraction."""
    depth, stop = np.exp(features[0]), np.exp(features[1])
    return depth * _draw_spline(features)(np.clip(time / stop, 0.0, FRACTIONS[-1]))


def interpolate_rate(features: FloatArray, time: FloatArray) -> FloatArray:
    """Speed (m/s) from the features of a run at times (s) since contact."""
    depth, stop = np.exp(features[0]), np.exp(features[1])
    fraction = time / stop
    rate = depth / stop * _draw_spline(features)(np.clip(fraction, 0.0, FRACTIONS[-1]), 1)
    return np.where(fraction <= FRACTIONS[-1], rate, 0.0)


def _draw_spline(features: FloatArray) -> PPoly:
    """The cubic spline (not-a-knot) through the normalised depths among the features of a run."""
    return PPoly.construct_fast(UNIT_SPLINES @ features[2:], FRACTIONS)
