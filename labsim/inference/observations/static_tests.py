"""Static strength tests: the law's curves fitted to them alone, and the tests as one more part of a campaign's data.

    compression  Σ(φ) = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10)        tension  |T(φ)| = 10^(a + bφ)        shear  Y = f √(Σ|T|)

Stresses are compared by their logarithms. Errors: each row's own (``relative_sigma``), and one common to a test, for its sample
is one of those that scatter. Source of the curves: Güttler et al. (2009), eqs. 4 to 6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from ...errors import InferenceError
from ...records import Campaign, FloatArray, Material, StrengthTest
from ...sph.sirono import compressive_strength, tensile_strength
from ..fits.blocks import Block
from . import Direct
from .linearised_drop import ErrorBudget, Perturbation

PARAMETERS = {  # of each kind's own curve, with units
    "compression_omnidirectional": (("p_m", "Pa"), ("phi_1", "1"), ("phi_2", "1"), ("delta", "1")),
    "compression_unidirectional": (("p_m", "Pa"), ("phi_1", "1"), ("phi_2", "1"), ("delta", "1")),
    "tension": (("tensile_log10_a", "1"), ("tensile_log10_b", "1")),
    "shear": (("strength", "Pa"), ("growth", "1")),
}
# a sample squeezed along one direction gives way to its sides: its curve is no material's, so it is fitted and not compared
COMPARED = ("compression_omnidirectional", "tension", "shear")
STARTS = (0.02, 0.1, 0.3)  # distances of φ1 and φ2 from the data, of the way to their limits


@dataclass(frozen=True)
class StrengthFit:
    """The curve of one kind of test. values, sigma : by parameter; covariance : (k, k) in the order of ``values``;
    chi_square for ``points`` data; p_value : of the fit."""

    kind: str
    tests: tuple[str, ...]
    values: dict[str, float]
    covariance: FloatArray
    chi_square: float
    points: int
    p_value: float

    @property
    def sigma(self) -> dict[str, float]:
        return {
            name: float(s) for name, s in zip(self.values, np.sqrt(np.diag(self.covariance)), strict=True)
        }

    def stress(self, filling_factor: FloatArray) -> FloatArray:
        """Pa, (n,)."""
        return np.exp(_log_curve(self.kind, np.array(list(self.values.values())), filling_factor))


def _log_curve(kind: str, values: FloatArray, phi: FloatArray) -> FloatArray:
    """ln of the stress in Pa by a kind's own parameters, (n,)."""
    if kind.startswith("compression"):
        p_m, phi_1, phi_2, delta = values
        return np.asarray(math.log(p_m) + delta * math.log(10.0) * np.log((phi - phi_1) / (phi_2 - phi)))
    if kind == "tension":
        return np.asarray(math.log(10.0) * (values[0] + values[1] * phi))
    return np.asarray(math.log(values[0]) + values[1] * np.log(phi / 0.15))


def fit_strength(kind: str, tests: Sequence[StrengthTest], scatter: float) -> StrengthFit:
    """The curve of one kind through all its tests, by least squares in ln stress. scatter : of ln strength between samples.

    Shear has a curve of its own, strength (φ/0.15)^growth: what f is takes the other two. Raises InferenceError.
    """
    phi, stress, lower = _stack(tests, [1.0] * len(tests), scatter)
    names = [name for name, _ in PARAMETERS[kind]]
    if phi.size <= len(names):
        raise InferenceError(
            f"strength/{tests[0].name}",
            "file",
            f"{phi.size} rows do not tell {len(names)} parameters; measure more",
        )
    low, high = float(phi.min()), float(phi.max())
    if high - low < 1e-3:
        raise InferenceError(f"strength/{tests[0].name}", "file", "all rows have one filling factor")

    def read(x: FloatArray) -> FloatArray:
        """Parameters from what is searched: logarithms of what is positive, φ1 and φ2 beyond the data."""
        if kind.startswith("compression"):
            return np.array([math.exp(x[0]), low - math.exp(x[1]), high + math.exp(x[2]), math.exp(x[3])])
        return np.asarray(x) if kind == "tension" else np.array([math.exp(x[0]), x[1]])

    def miss(x: FloatArray) -> FloatArray:
        return np.linalg.solve(lower, np.log(stress) - _log_curve(kind, read(x), phi))

    level = float(np.mean(np.log(stress)))
    if kind.startswith("compression"):
        starts = [
            [level, math.log(share * low), math.log(share * (1.0 - high)), math.log(0.5)] for share in STARTS
        ]
        bounds = (
            [-20.0, math.log(1e-6), math.log(1e-6), math.log(0.01)],
            [40.0, math.log(max(low - 1e-6, 2e-6)), math.log(max(1.0 - high, 2e-6)), math.log(10.0)],
        )
    else:
        starts = [[level / math.log(10.0) if kind == "tension" else level, 1.0]]
        bounds = ([-np.inf] * 2, [np.inf] * 2)
    found = min(
        (least_squares(miss, start, bounds=bounds, x_scale="jac", max_nfev=2000) for start in starts),
        key=lambda each: float(each.cost),
    )
    step = 1e-6 * np.maximum(np.abs(found.x), 1.0)
    turn = np.array(
        [(read(found.x + d) - read(found.x - d)) / (2 * h) for h, d in zip(step, np.diag(step), strict=True)]
    ).T
    covariance = turn @ np.linalg.pinv(found.jac.T @ found.jac) @ turn.T
    values = {name: float(value) for name, value in zip(names, read(found.x), strict=True)}
    chi_square = 2.0 * float(found.cost)
    p_value = float(chi2.sf(chi_square, phi.size - len(names)))
    return StrengthFit(kind, tuple(t.name for t in tests), values, covariance, chi_square, phi.size, p_value)


def fit_softness(
    tests: Sequence[StrengthTest], material: Material, scatter: float
) -> tuple[float, float, float]:
    """p_m (Pa) of compression tests with φ1, φ2 and Δ as stated, the standard deviation of its logarithm, p value of the fit."""
    phi, stress, lower = _stack(tests, [1.0] * len(tests), scatter)
    missed = np.log(stress / compressive_strength(phi, material.replace(p_m=1.0)))
    white = np.linalg.solve(lower, np.stack([missed, np.ones_like(missed)], axis=1))
    information = float(white[:, 1] @ white[:, 1])
    best = float(white[:, 0] @ white[:, 1]) / information
    left = white[:, 0] - best * white[:, 1]
    return math.exp(best), 1.0 / math.sqrt(information), float(chi2.sf(left @ left, max(phi.size - 1, 1)))


def _stack(
    tests: Sequence[StrengthTest], shares: Sequence[float], scatter: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """φ, stress (Pa) and the lower factor of the covariance of ln stress of all tests; shares : of ``scatter``, one a test."""
    points = np.array([point for test in tests for point in test.points])
    covariance = np.diag(np.concatenate([np.full(len(t.points), t.relative_sigma**2) for t in tests]))
    at = 0
    for test, share in zip(tests, shares, strict=True):
        own = slice(at, at + len(test.points))
        covariance[own, own] += (share * scatter) ** 2
        at = own.stop
    return points[:, 0], points[:, 1], np.linalg.cholesky(covariance)


@dataclass(frozen=True)
class StaticTests(Direct):
    """The tests that the law of the drops speaks of."""

    tests: tuple[StrengthTest, ...]
    kind: str = "static tests"
    name: str = "static tests"

    def expect(self, log_p_m: float, point: Perturbation) -> FloatArray:
        """ln of the stresses in Pa by the law."""
        setting = point.setting("static test")
        factor = next(iter(point.instruments.values())).static_factor
        material = setting.material.replace(p_m=math.exp(log_p_m) * factor)
        shear_factor = math.log(max(material.shear_factor, 1e-12))
        expected = []
        for test in self.tests:
            phi = np.array([phi for phi, _ in test.points])
            compressive = np.log(compressive_strength(phi, material))
            if setting.strength_shape:
                compressive = compressive + np.log(np.interp(phi, *np.transpose(setting.strength_shape)))
            tensile = np.log(-tensile_strength(phi, material))
            curves = {
                "compression_omnidirectional": compressive,
                "tension": tensile,
                "shear": shear_factor + 0.5 * (compressive + tensile),
            }
            expected.append(curves[test.kind])
        return np.concatenate(expected)

    def compare(self, expected: FloatArray, tangents: Mapping[str, FloatArray], budget: ErrorBudget) -> Block:
        # strength of tension does not follow p_m, of shear half; all samples scatter alike
        shares = [0.5 if test.kind == "shear" else 1.0 for test in self.tests]
        _, stress, lower = _stack(self.tests, shares, budget.scatter)
        return Block(np.log(stress) - expected, lower @ lower.T, tangents)


def observe(campaign: Campaign) -> StaticTests | None:
    """The tests of a campaign that are compared; None where there is none."""
    tests = tuple(test for test in campaign.strength_tests if test.kind in COMPARED)
    return StaticTests(tests) if tests else None
