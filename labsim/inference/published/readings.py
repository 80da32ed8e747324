"""p_m from one choice of published figures: the likelihood, and its posterior by quadrature.

The likelihood is normal in the logarithm of each figure; its variance holds the published uncertainty, the emulator's
error on runs left out and the numerical error, taken as the change of the figure between two spacings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from ...records import Drop, FloatArray
from .emulator import Emulator
from .figures import FIGURE_KINDS, Figure, published_figure
from .planar import READINGS


@dataclass(frozen=True)
class NumericalError:
    """A figure at two spacings and the same p_m."""

    bulk_modulus: float
    p_m: float
    depth: tuple[float, float]  # m, coarse and fine
    stopping_time: tuple[float, float]  # s
    spacings: tuple[float, float]  # m

    def relative(self, kind: str) -> float:
        coarse, fine = getattr(self, kind)
        return abs(math.log(coarse / fine))


@dataclass(frozen=True)
class Reading:
    """p_m from one choice of figures, planar factor and bulk modulus."""

    use: tuple[str, ...]
    depth_reading: str
    bulk_modulus: float
    q05: float
    q50: float
    q95: float
    misfit: float  # sum of squared standard deviations at the best p_m
    at_limit: bool  # the posterior leans on a limit of the prior

    @property
    def name(self) -> str:
        used = " + ".join(self.use).replace("_", " ")
        reading = f", {self.depth_reading}" if "depth" in self.use else ""
        return f"{used}{reading}, K0 {self.bulk_modulus / 1e3:g} kPa"


@dataclass(frozen=True)
class FigureLikelihood:
    """ln likelihood of ln p_m, vectorised: (n,) in, (n,) out."""

    figures: tuple[Figure, ...]
    emulators: dict[str, Emulator]
    numerical: NumericalError

    def residuals(self, ln_p_m: FloatArray) -> FloatArray:
        """(figures, n), in standard deviations."""
        rows = []
        for figure in self.figures:
            emulator = self.emulators[figure.drop]
            column = emulator.column(figure.kind)
            sigma = math.hypot(figure.sigma, emulator.sigma[column], self.numerical.relative(figure.kind))
            rows.append(
                (emulator.predict_log(np.exp(ln_p_m)[:, None])[:, column] - math.log(figure.value)) / sigma
            )
        return np.array(rows)

    def __call__(self, ln_p_m: FloatArray) -> FloatArray:
        return -0.5 * np.sum(self.residuals(ln_p_m) ** 2, axis=0)


def list_readings(
    drops: Sequence[Drop], reading: str, others: bool, use: tuple[str, ...]
) -> list[tuple[tuple[str, ...], str]]:
    """(figures, planar factor) of every reading that the drops allow, or of the asked one alone."""
    if not others:
        return [(use, reading)]
    has = [kind for kind in FIGURE_KINDS if any(published_figure(drop, kind) for drop in drops)]
    rows: list[tuple[tuple[str, ...], str]] = []
    if "depth" in has:
        rows += [(("depth",), name) for name in READINGS]
    if "stopping_time" in has:
        rows.append((("stopping_time",), reading))
    if len(has) == 2:
        rows += [(("depth", "stopping_time"), name) for name in READINGS]
    return rows


def integrate_reading(
    likelihood: FigureLikelihood,
    limits: tuple[float, float],
    use: tuple[str, ...],
    depth_reading: str,
    k0: float,
) -> Reading:
    """The same posterior by quadrature: one parameter needs no chain."""
    ln_p_m = np.linspace(math.log(limits[0]), math.log(limits[1]), 2001)
    log_like = likelihood(ln_p_m)
    density = np.exp(log_like - log_like.max())
    total = cumulative_trapezoid(density, ln_p_m, initial=0.0)
    q05, q50, q95 = np.exp(np.interp((0.05, 0.5, 0.95), total / total[-1], ln_p_m))
    best = int(np.argmax(log_like))
    return Reading(
        use=use,
        depth_reading=depth_reading,
        bulk_modulus=k0,
        q05=float(q05),
        q50=float(q50),
        q95=float(q95),
        misfit=float(-2.0 * log_like[best]),
        at_limit=bool(max(density[0], density[-1]) > 0.05),
    )
