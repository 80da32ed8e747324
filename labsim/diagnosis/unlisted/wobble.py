"""A camera that wobbles: all its films swing at one frequency, each with its own phase, in flight and in the dust alike.

    row of film i at t = what is seen + a_i cos(2π f t) + b_i sin(2π f t)

a and b are Gaussian about nought with one size for all films, ln p_m is flat; f is even between bounds. So the evidence is closed
for every f (free_law.integrate), and no simulation is needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ...inference.fits.blocks import whiten_all
from ...inference.fits.fitting import REJECTED, Fit
from ...inference.observations.drop_model import DropModel
from ...inference.problem import Problem
from ...records import FloatArray
from .free_law import Tangents, integrate

SIZES_PX = (0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
SLOWEST = 2.0  # swings in the shortest film: slower ones bend it as the dust does
FASTEST = 0.25  # of the lowest frame rate: faster ones alternate from frame to frame, as noise does
STEPS = 4.0  # frequencies in what the longest film tells apart
CLEAR = 10.0  # ln evidence over the nominal model, from which on a wobble may explain the data alone


@dataclass(frozen=True)
class Wobble:
    """evidences : ln, of every frequency and size. The best of them: frequency, Hz; amplitude and sigma over the films, px; ln of
    p_m and its standard deviation with the wobble taken out; law : (n,) what it does to the data of the drops, m; p_value of what
    is left."""

    evidences: FloatArray
    frequency: float
    amplitude: float
    sigma: float
    log_p_m: float
    log_p_m_sigma: float
    law: FloatArray
    p_value: float

    def explains(self, nominal: Fit) -> bool:
        """Whether nothing but the wobble is wrong."""
        return float(self.evidences.max()) > nominal.evidence + CLEAR and self.p_value >= REJECTED


def fit_wobble(problem: Problem, fit: Fit) -> Wobble | None:
    """The wobble that explains most of what the nominal model leaves; None without films of several swings."""
    films = [model for model in problem.tracks.models if isinstance(model, DropModel)]
    if not films:
        return None
    lengths = [float(np.ptp(model.observed.time)) for model in films]
    slowest = SLOWEST / min(lengths)
    fastest = FASTEST * min(model.camera.frame_rate for model in films)
    frequencies = np.arange(slowest, fastest, 1.0 / (STEPS * max(lengths)))
    if not frequencies.size:
        return None
    drops, (low, high) = fit.drops, (math.log(p) for p in problem.campaign.p_m_range)
    plain = whiten_all(fit.blocks, ["ln_p_m"])
    others = plain[drops.residual.size :].T @ plain[drops.residual.size :]
    plain = plain[: drops.residual.size]
    log_determinant = sum(block.log_determinant for block in fit.blocks)
    points = sum(block.residual.size for block in fit.blocks)
    names = ("ln_p_m", *(f"{model.observed.name} {part}" for model in films for part in ("cos", "sin")))
    evidences, best = [], None
    for frequency in frequencies:
        swings = _draw_swings(films, fit, float(frequency))
        columns = np.hstack([plain, drops.whiten(swings)])
        gram = columns.T @ columns
        gram[:2, :2] += others
        found = Tangents((), names, gram, log_determinant, points, swings, fit.log_p_m)
        for size in SIZES_PX:
            one = integrate(found, names[1:], size, (low, high))
            evidences.append(one.evidence)
            if best is None or one.evidence > best[0].evidence:
                best = one, float(frequency), swings, gram
    assert best is not None
    one, frequency, swings, gram = best
    swing = np.hypot(one.coefficients[1::2], one.coefficients[2::2])
    left = (
        gram[0, 0] - 2 * one.coefficients @ gram[1:, 0] + one.coefficients @ gram[1:, 1:] @ one.coefficients
    )
    return Wobble(
        np.array(evidences),
        frequency,
        float(np.sqrt(np.mean(swing**2))),
        float(np.std(swing)),
        fit.log_p_m + float(one.coefficients[0]),
        math.sqrt(one.covariance[0, 0]),
        swings @ one.coefficients[1:],
        float(chi2.sf(left, points - len(names))),
    )


def _draw_swings(films: list[DropModel], fit: Fit, frequency: float) -> FloatArray:
    """(n, 2 films) what a swing of one pixel does to the data of the drops, m: cosine and sine of each film."""
    swings = np.zeros((fit.drops.residual.size, 2 * len(films)))
    for k, model in enumerate(films):
        angle = 2 * np.pi * frequency * model.observed.time
        begin = fit.drops.sections[model.observed.name].start
        both = model.matrix @ np.stack([np.cos(angle), np.sin(angle)], axis=1) * model.observed.pixel
        swings[begin : begin + len(both), 2 * k : 2 * k + 2] = both
    return swings
