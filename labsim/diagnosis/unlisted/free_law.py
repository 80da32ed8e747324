"""A free law where the equations have a place for it: in the strength of the dust and in the force on the projectile.

    m (1 + Σ_m d_m h_m(z/a)) (d²z/dt² - g) = - F_dust[Σ(φ) (1 + Σ_m e_m h_m(φ))] - A Σ_m b_m h_m(z/a) - A Σ_m c_m h_m(v)

h_m are hats between knots, A the cross-section of the tip, a its radius: one law for all sizes. Some go with the depth in mm, as
layers of the sample do (law_places.py). What every hat changes of drops
and maps is simulated as for an effect of the catalogue, in which they never stand. Coefficients, alike in all data, are Gaussian
about nought with one size, ln p_m is flat. Their integral over the linearised data is closed: docs/free-law.md.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ...effects.law_places import LAW_PLACES
from ...inference.emulation.grid import Request
from ...inference.emulation.nodes import amplitude_nodes, hold_known, place_strength
from ...inference.fits.blocks import Block, solve_globals
from ...inference.fits.evidence import cut_gaussian
from ...inference.fits.fitting import Fit
from ...inference.fits.steps import move_nuisances
from ...inference.fits.tangents import linearise_at
from ...inference.problem import Problem
from ...records import FloatArray
from ...runs.parts import Push
from ..screen import has_runs
from .hats import FreeLaw, add_terms, list_laws, make_hats

# of the unit. A law of 3 to 24 % all along the way moves depths by 1 to 8 %; one hat is a fourth of the way
SIZES = (0.1, 0.2, 0.4, 0.8)
# of what a law changes of the depth: error of a response known at one amplitude. A force of 320 Pa at one tip radius changes ln D
# by 0.08 to 0.13 where runs at 120 Pa, in proportion, say 0.13 to 0.14
ONE_AMPLITUDE = 0.15
CLEAR = 3.0  # standard deviations from which a hat larger than its step is simulated about its estimate too
MOST_BENT = 3  # such hats in a round
ANYWHERE = (-1e3, 1e3)  # limits of ln p_m that are none
ROUNDS = 2  # of Gauss and Newton about the law that is found
# freedom -> the laws that are free together: at every place that runs tell of, and at three at once
EMBEDDED = {name: (name,) for name, place in LAW_PLACES.items() if place.simulated} | {
    "strength and forces": ("strength of filling factor", "force of depth", "force of speed")
}


@dataclass(frozen=True)
class RecoveredLaw:
    """What the data say of one free law. mean : (k,) at its knots in value_unit; covariance : (k, k)."""

    law: FreeLaw
    mean: FloatArray
    covariance: FloatArray

    @property
    def sigma(self) -> FloatArray:
        return np.sqrt(np.diag(self.covariance))

    def at(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The law and its standard deviation: linear between knots, constant beyond."""
        grid, knots = np.array(self.law.grid), np.array(self.law.knots)
        weights = np.stack([np.interp(place, grid, (grid == knot).astype(float)) for knot in knots], axis=1)
        return weights @ self.mean, np.sqrt(np.einsum("nk,kl,nl->n", weights, self.covariance, weights))


@dataclass(frozen=True)
class Tangents:
    """Whitened products of all data about a law. names : ln_p_m, hats, terms that need no runs; gram : (2 + k, 2 + k), the
    residual of no law first; log_determinant of the covariance; drops : (n, k) tangents of the drops, m per unit amplitude;
    log_p_m : there."""

    laws: tuple[FreeLaw, ...]
    names: tuple[str, ...]
    gram: FloatArray
    log_determinant: float
    points: int
    drops: FloatArray
    log_p_m: float

    def of_drops(self, hats: Sequence[str]) -> FloatArray:
        """Tangents (n, k) of these hats."""
        return self.drops[:, [self.names.index(name) - 1 for name in hats]]


@dataclass(frozen=True)
class Marginal:
    """One size of some laws, integrated. coefficients : ln p_m first, then what is flat, then hats in the order asked, in units
    of their scales."""

    evidence: float
    coefficients: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class Hats:
    """What every hat by itself changes is known from runs. problem : with them among its effects; laws : with the hats that have
    runs; index : the strength that they were made at."""

    problem: Problem
    laws: tuple[FreeLaw, ...]
    index: int

    @property
    def names(self) -> list[str]:
        return [hat for law in self.laws for hat in law.hats]

    @property
    def scales(self) -> dict[str, float]:
        return {hat: law.scale for law in self.laws for hat in law.hats}


def simulate_hats(problem: Problem, fit: Fit) -> Hats:
    """Runs of every hat by itself, about the strength of a fit; a hat whose runs fail is left out."""
    laws = list_laws(problem, fit)
    index = round(place_strength(fit.log_p_m))  # not screening's, which may lie where soft dust costs most
    problem.require_base([index])
    plain = Request("", None, index, rough=True)
    problem.grid.require([plain], "free law")
    deepest = {
        run.setting: run.penetration_depth
        for number in range(len(problem.groups))
        for run in problem.grid.stopped_runs(plain, number) or ()
        if not isinstance(run, Push)
    }
    hats = {name: hat for law in laws for name, hat in make_hats(law, deepest).items()}
    # shares tables, runs and what they hold
    budget = replace(problem.budget, numerical_change=ONE_AMPLITUDE)
    free = replace(problem, effects={**problem.effects, **hats}, budget=budget)
    # at every speed: what a force at some depth changes has a peak where drops end there
    nodes = [(name, hat.amplitudes[0].step, index) for name, hat in hats.items()]
    free.require_changes(nodes, "free law", rough=True)
    kept = tuple(
        replace(
            law,
            knots=tuple(knot for knot, hat in zip(law.knots, law.hats, strict=True) if has_runs(free, hat)),
        )
        for law in laws
    )
    return Hats(free, kept, index)


def fit_hats(problem: Problem, fit: Fit, simulated: Hats) -> Tangents:
    """All data about the best law that the hats find.

    Logarithms of depth and time are what hats change, in proportion to their coefficients, large and clear ones along
    further runs; p_m moves along its own.
    """
    free, kept, index = simulated.problem, simulated.laws, simulated.index
    names, scales = simulated.names, simulated.scales
    hats = free.effects
    free, formulas, units = add_terms(free)
    scales |= units
    names += formulas
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    nuisances, log_p_m = fit.nuisances, fit.log_p_m
    values = dict.fromkeys(names, 0.0)
    for rounds in range(ROUNDS + 1):
        problem.require_base_about(log_p_m)
        blocks = linearise_at(free, nuisances, log_p_m, {**fit.values, **values})
        gram, log_determinant, points = gather(blocks, names, scales, values)
        drops = np.stack([blocks[0].tangents[name] * scales[name] for name in names], axis=1)
        found = Tangents(kept, ("ln_p_m", *names), gram, log_determinant, points, drops, log_p_m)
        if rounds == ROUNDS:
            break
        own, size = max(
            ((choose_hats(found, freedom), size) for freedom in EMBEDDED for size in SIZES),
            key=lambda each: integrate(found, each[0], each[1], (low, high)).evidence,
        )
        priors = {name: (values[name], size * scales[name]) for name in own}
        step, covariance, _, _, weighted = solve_globals(blocks, ["ln_p_m", *own], priors)
        before, log_p_m = log_p_m, float(np.clip(log_p_m + np.clip(step[0], -0.7, 0.7), low, high))
        # the others' best where p_m stops short of its own
        step += covariance[0] / covariance[0, 0] * (log_p_m - before - step[0])
        best = {
            name: hold_known(hats[name], values[name] + float(part), sparse=True)
            for name, part in zip(own, step[1:], strict=True)
        }
        values = dict.fromkeys(names, 0.0) | best
        sigma = np.sqrt(np.diag(covariance)[1:])
        clear = {
            name: abs(best[name]) / width
            for name, width in zip(own, sigma, strict=True)
            if abs(best[name]) > max(CLEAR * width, hats[name].amplitudes[0].step)
        }
        bent = sorted(clear, key=lambda name: -clear[name])[:MOST_BENT]
        nodes = [(n, a, index) for n in bent for a in amplitude_nodes(hats[n], values[n], sparse=True)]
        free.require_changes(nodes, "free law, large", rough=True)
        nuisances, _ = move_nuisances(problem, nuisances, blocks, weighted)
    return found


def weigh_beside(simulated: Hats, fit: Fit) -> float:
    """ln Bayes factor of a law that is left free on top of a listed cause, or of a pair, over these by themselves: the mean over
    all freedoms and sizes; minus infinity where nothing can be said. What the hats change is taken as without the cause; its
    amplitude is flat in both, as ln p_m is."""
    free, causes = simulated.problem, list(fit.hypothesis)
    free.require_base_about(fit.log_p_m)
    values = {**fit.values, **dict.fromkeys(simulated.names, 0.0)}
    blocks = linearise_at(free, fit.nuisances, fit.log_p_m, values)
    names, scales = [*causes, *simulated.names], simulated.scales | dict.fromkeys(causes, 1.0)
    gram, log_determinant, points = gather(blocks, names, scales)
    found = Tangents(
        simulated.laws,
        ("ln_p_m", *names),
        gram,
        log_determinant,
        points,
        np.zeros((0, len(names))),
        fit.log_p_m,
    )
    low, high = (math.log(p) for p in free.campaign.p_m_range)
    try:
        alone = integrate(found, [], 1.0, (low, high), causes).evidence
        weighed = weigh_freedoms(found, (low, high), causes)
    except np.linalg.LinAlgError:  # the data say nothing of the cause where its fit ended
        return -math.inf
    evidences = [one.evidence for each in weighed.values() for one in each]
    return log_mean(evidences) - alone if evidences else -math.inf


def weigh_freedoms(
    found: Tangents, limits: tuple[float, float], flat: Sequence[str] = ()
) -> dict[str, list[Marginal]]:
    """Every freedom that has hats, with coefficients of all SIZES."""
    hats = {freedom: choose_hats(found, freedom) for freedom in EMBEDDED}
    return {
        freedom: [integrate(found, own, size, limits, flat) for size in SIZES]
        for freedom, own in hats.items()
        if own
    }


def choose_hats(found: Tangents, freedom: str) -> list[str]:
    """Hats of the laws that are free together."""
    return [hat for law in found.laws if law.name in EMBEDDED[freedom] for hat in law.hats]


def gather(
    blocks: Sequence[Block],
    names: Sequence[str],
    scales: Mapping[str, float],
    values: Mapping[str, float] | None = None,
) -> tuple[FloatArray, float, int]:
    """Gram matrix of whitened (residual, ln p_m, hats per unit coefficient), ln det C, number of data.

    values : amplitudes that the blocks are linearised about; the residual is that of none, by the tangents there.
    """
    gram, log_determinant, points = np.zeros((2 + len(names),) * 2), 0.0, 0
    for block in blocks:
        residual = block.residual + sum(
            block.tangents[name] * value for name, value in (values or {}).items()
        )
        columns = [residual, block.tangents["ln_p_m"], *(block.tangents[n] * scales[n] for n in names)]
        white = block.whiten(np.stack(columns, axis=1))
        gram += white.T @ white
        log_determinant += block.log_determinant
        points += block.residual.size
    return gram, log_determinant, points


def integrate(
    found: Tangents,
    hats: Sequence[str],
    size: float,
    limits: tuple[float, float] = ANYWHERE,
    flat: Sequence[str] = (),
) -> Marginal:
    """Evidence and posterior with Gaussian coefficients of this size and ln p_m flat between limits, others flat everywhere.

    Evidence without the limits is that of the covariance C + size² T Tᵀ over all data at once, by the matrix inversion lemma.
    """
    own = ["ln_p_m", *flat, *hats]
    places = np.array([found.names.index(name) for name in own]) + 1
    prior = [0.0] * (1 + len(flat)) + [size**-2] * len(hats)
    information = found.gram[np.ix_(places, places)] + np.diag(prior)
    factor = cho_factor(information, lower=True)
    towards = found.gram[places, 0]
    best, covariance = cho_solve(factor, towards), cho_solve(factor, np.eye(len(own)))
    chi_square = found.gram[0, 0] - towards @ best
    log_information = 2 * float(np.sum(np.log(np.diag(factor[0]))))
    evidence = -0.5 * (chi_square + found.log_determinant)
    evidence -= 0.5 * (found.points - 1 - len(flat)) * math.log(2 * math.pi)
    evidence -= 0.5 * log_information + len(hats) * math.log(size) + math.log(limits[1] - limits[0])
    low, high = (limit - found.log_p_m for limit in limits)
    sigma = math.sqrt(covariance[0, 0])
    # a Gaussian cut in its first coordinate: the others follow that one's mean and variance
    log_share, mean, variance = cut_gaussian(low, high, float(best[0]), sigma)
    evidence += log_share
    along = covariance[0] / sigma
    best = best + along * mean
    return Marginal(float(evidence), best, covariance + np.outer(along, along) * (variance - 1.0))


def log_mean(values: Collection[float]) -> float:
    """ln of the mean of what these are the logarithms of."""
    top = max(values)
    return top + math.log(sum(math.exp(value - top) for value in values) / len(values))


def average(laws: Sequence[FreeLaw], each: Sequence[Marginal]) -> tuple[tuple[RecoveredLaw, ...], FloatArray]:
    """Laws over the sizes by their evidence, and the mean (1 + k,) of the coefficients."""
    top = max(one.evidence for one in each)
    weights = np.exp([one.evidence - top for one in each])
    weights /= weights.sum()
    mean = np.sum([w * one.coefficients for w, one in zip(weights, each, strict=True)], axis=0)
    covariance = np.sum(
        [
            w * (one.covariance + np.outer(one.coefficients - mean, one.coefficients - mean))
            for w, one in zip(weights, each, strict=True)
        ],
        axis=0,
    )
    recovered, at = [], 1
    for law in laws:
        own = slice(at, at + len(law.knots))
        at = own.stop
        recovered.append(RecoveredLaw(law, mean[own] * law.scale, covariance[own, own] * law.scale**2))
    return tuple(recovered), mean
