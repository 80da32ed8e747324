"""emcee on a campaign's likelihood, stopped when the chain is long enough, stored so that a killed chain goes on.

The likelihood near its maximum is carried by the whitened residual as a quadratic function of the parameters (exact for what
is linear, measured at the corners), so a step of all walkers costs a matrix product.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import emcee
import numpy as np

from ...errors import InferenceError
from ...records import FloatArray
from ...runs.store import Progress
from .chain import fingerprint, read_chain, write_chain

REACH = 2.5  # standard deviations at which the residual is measured
WALKERS_PER_PARAMETER = 16
LONG_ENOUGH = 50  # autocorrelation times
CHECK_EVERY = 250
LONGEST = 40_000
REDRAWS = 100  # of walkers that begin beyond a limit


@dataclass(frozen=True)
class Posterior:
    """data : arviz.InferenceData, variables ``names`` in the units given to ``transform``."""

    names: tuple[str, ...]
    data: Any
    r_hat: float
    ess: float
    steps: int
    autocorrelation: float

    def __repr__(self) -> str:
        return f"<Posterior of {', '.join(self.names)}: R-hat {self.r_hat:.3f}, {self.ess:.0f} independent samples>"

    def samples(self, name: str) -> FloatArray:
        return np.asarray(self.data.posterior[name].values).ravel()

    @property
    def calibrated(self) -> FloatArray:
        """What is calibrated of the law, the first of ``names``: p_m (Pa) of dust."""
        return self.samples(self.names[0])


@dataclass(frozen=True)
class QuadraticResidual:
    """w(θ) = w0 + A u + Σ b_jk u_j u_k with θ = centre + axes u: whitened residuals (n,). axes : (d, d), one a column."""

    centre: FloatArray
    axes: FloatArray
    coefficients: FloatArray  # (terms, n)

    @cached_property
    def gram(self) -> FloatArray:
        """(terms, terms) products of the coefficients: n is large, terms are few."""
        return self.coefficients @ self.coefficients.T

    def __call__(self, theta: FloatArray) -> FloatArray:
        """(m, d) -> (m,) half the squared length of the residual."""
        terms = _terms(np.linalg.solve(self.axes, (np.atleast_2d(theta) - self.centre).T).T)
        return 0.5 * np.sum((terms @ self.gram) * terms, axis=1)


def _terms(u: FloatArray) -> FloatArray:
    d = u.shape[1]
    columns = [np.ones(len(u)), *u.T]
    columns += [u[:, j] * u[:, k] for j, k in itertools.combinations_with_replacement(range(d), 2)]
    return np.stack(columns, axis=1)


def measure_residual(
    residual: Callable[[FloatArray], FloatArray],
    centre: FloatArray,
    covariance: FloatArray,
) -> QuadraticResidual:
    """Quadratic through the centre, both sides of each principal axis of the covariance and one corner of each pair.

    Along the axes of parameters that make up for each other the ends would lie far from all that the data allow.
    """
    sigma = np.sqrt(np.diag(covariance))
    widths, directions = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    axes = sigma[:, None] * directions * np.sqrt(widths)
    d = len(centre)
    u = [np.zeros(d)]
    for k in range(d):
        for sign in (-REACH, REACH):
            point = np.zeros(d)
            point[k] = sign
            u.append(point)
    for j, k in itertools.combinations(range(d), 2):
        point = np.zeros(d)
        point[j] = point[k] = REACH / math.sqrt(2)
        u.append(point)
    grid = np.array(u)
    values = np.array([residual(centre + axes @ row) for row in grid])
    coefficients = np.linalg.lstsq(_terms(grid), values, rcond=None)[0]
    return QuadraticResidual(centre, axes, coefficients)


def spread_walkers(
    log_probability: Callable[[FloatArray], FloatArray],
    centre: FloatArray,
    covariance: FloatArray,
    walkers: int,
    random: np.random.Generator,
) -> FloatArray:
    """(walkers, d) starts, twice as wide as the posterior, all of them where it is not zero: a walker that begins beyond a
    limit may never move, and then no chain is long enough. Raises InferenceError where no start is found."""
    start = random.multivariate_normal(centre, 4.0 * covariance, size=walkers)
    for attempt in range(REDRAWS):
        outside = ~np.isfinite(log_probability(start))
        if not outside.any():
            return start
        narrower = 4.0 * 0.95 ** (2 * attempt) * covariance
        start[outside] = random.multivariate_normal(centre, narrower, size=int(outside.sum()))
    raise InferenceError("", "posterior", f"is zero all around the best fit {centre}; look at labsim check")


def sample(
    log_probability: Callable[[FloatArray], FloatArray],
    names: Sequence[str],
    centre: FloatArray,
    covariance: FloatArray,
    *,
    seed: int,
    transform: Callable[[str, FloatArray], FloatArray] = lambda name, values: values,
    backend: Path | None = None,
    progress: Progress | None = None,
) -> Posterior:
    """Run walkers from an over-dispersed start until the chain is LONG_ENOUGH and its times have settled.

    log_probability : (m, d) -> (m,). backend : an HDF5 file; where it holds a chain of the same target and seed, that chain is
    gone on with and ends as it would have ended unbroken, step for step; any other content is replaced.
    Walkers move by differences of others (ter Braak 2006): autocorrelation times of 7 steps in two dimensions and 37 in twelve,
    where the stretch move has 29 and 100. R-hat compares the halves of four groups of walkers: single walkers are not
    independent chains (emcee, Foreman-Mackey et al. 2013).
    """
    d = len(names)
    walkers = max(32, WALKERS_PER_PARAMETER * d)
    random = np.random.default_rng(seed)
    start = spread_walkers(log_probability, centre, covariance, walkers, random)
    mark = fingerprint(tuple(names), seed, start, log_probability(start))
    kept = read_chain(backend, mark) if backend is not None else None
    memory = kept or emcee.backends.Backend()
    sampler = emcee.EnsembleSampler(
        walkers, d, log_probability, vectorize=True, backend=memory, moves=emcee.moves.DEMove()
    )
    if kept is None:
        sampler.random_state = np.random.RandomState(seed).get_state()
    else:
        start = kept.get_last_sample()
    old = np.inf
    tau = np.inf
    done = memory.iteration
    if done > CHECK_EVERY:  # what the check before the last one saw
        old = float(np.max(emcee.autocorr.integrated_time(memory.get_chain()[:-CHECK_EVERY], tol=0)))
    while done < LONGEST:
        tau = float(np.max(sampler.get_autocorr_time(tol=0))) if done >= CHECK_EVERY else np.inf
        if done > LONG_ENOUGH * tau and abs(old - tau) < 0.05 * tau:
            break
        old = tau
        start = sampler.run_mcmc(start, CHECK_EVERY)
        done += CHECK_EVERY
        if backend is not None:
            write_chain(backend, memory, mark)
        if progress is not None:
            progress(done, max(done, 2000), "sampling the posterior")
    discard = int(5 * tau)
    chain = sampler.get_chain(discard=discard)  # (steps, walkers, d)
    arviz = import_arviz()
    groups = np.swapaxes(chain, 0, 1)
    data = arviz.from_dict(
        posterior={name: transform(name, groups[:, :, k]) for k, name in enumerate(names)},
        sample_stats={"lp": np.swapaxes(sampler.get_log_prob(discard=discard), 0, 1)},
    )
    quarters = groups.reshape(4, -1, d) if walkers % 4 == 0 else groups
    with uncompiled(arviz.Numba):
        r_hat = max(float(arviz.rhat(quarters[:, :, k])) for k in range(d))
    total = chain.shape[0] * walkers
    return Posterior(tuple(names), data, r_hat, total / tau, int(chain.shape[0]), tau)


def import_arviz() -> ModuleType:
    """arviz, without what it says of its own rewriting at the first import of a day."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz
    return arviz


@contextmanager
def uncompiled(numba: Any) -> Iterator[None]:
    """Within it arviz leaves its functions uncompiled: to compile one takes longer than all it is called for here."""
    before, numba.numba_flag = numba.numba_flag, False
    try:
        yield
    finally:
        numba.numba_flag = before
