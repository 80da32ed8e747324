"""Fit p_m, and the amplitudes of any effects, to a whole campaign: ask for runs, interpolate, Gauss-Newton, ask again.

A Hypothesis is a tuple of effect names; the empty one is the nominal model. Runs are asked for at the strength nodes and
amplitude nodes that enclose the current estimate, so that the answer never rests on extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ...records import FloatArray
from ..emulation.nodes import amplitude_nodes, nearest_nodes, nodes_around, screening_node
from ..observations.tracks import DropsBlock
from ..problem import Problem
from .blocks import Block
from .evidence import integrate_by_laplace
from .steps import (
    LOWER,
    ParameterPoint,
    Solved,
    advance,
    converge_nuisances,
    hold,
    hold_strength,
    solve_at,
    stop_at_limits,
)
from .tangents import Blocks, linearise_at

Hypothesis = tuple[str, ...]
# a fit has this many steps; beyond PATIENT each has to gain more than LOWER, but not where accelerometers are: there p_m and a
# strength lie in a valley so bent that fits from the nominal p_m were left halfway, up to 12 below the top in ln evidence
ITERATIONS, PATIENT = 40, 12
# p values of fit_p_value, one policy for all who ask: below the first a model may fail, and what else explains the data is
# looked for where that costs nothing; below the second it fails, and runs are made to find out why
DOUBTFUL, REJECTED = 0.05, 0.01
MOST_HALVED = 3  # times a step is
MOST_NUISANCES = 3  # times nuisances alone are moved


@dataclass(frozen=True)
class Fit:
    """One hypothesis, fitted. values : name of effect -> amplitude (parameter minus null, in the parameter's unit).

    covariance : of (ln p_m, amplitudes in order); evidence : ln of the integrated likelihood (Laplace), priors included.
    unsettled : the step that it still asks for, the largest of its parameters', in standard deviations.
    """

    hypothesis: Hypothesis
    log_p_m: float
    values: dict[str, float]
    covariance: FloatArray
    chi_square: float
    points: int
    log_likelihood: float
    evidence: float
    blocks: Blocks
    nuisances: tuple[FloatArray, ...]  # of every observation, at their best
    # of ln p_m over the shapes of the effect that were fitted, by their evidence: mean minus this one's, standard deviation
    over_shapes: tuple[float, float] = (0.0, 0.0)
    unsettled: float = 0.0
    between_codes: float = (
        0.0  # standard deviation of ln p_m by which other codes differ beyond the likelihood's own
    )

    @property
    def drops(self) -> DropsBlock:
        """All drops about the fit."""
        first = self.blocks[0]
        assert isinstance(first, DropsBlock)
        return first

    @property
    def log_p_m_beside(self) -> tuple[float, float]:
        """What ln p_m is moved by, and widened by, beyond this fit: the shapes of its effect, and other codes."""
        moved, width = self.over_shapes
        return moved, math.hypot(width, self.between_codes)

    @property
    def log_p_m_over_shapes(self) -> tuple[float, float]:
        """Mean and standard deviation of ln p_m, those beside this fit included."""
        moved, width = self.log_p_m_beside
        return self.log_p_m + moved, math.hypot(math.sqrt(self.covariance[0, 0]), width)


def fit_hypothesis(
    problem: Problem,
    hypothesis: Hypothesis,
    start: tuple[float, Mapping[str, float]],
    *,
    sparse: bool = False,
    around: bool = False,
    nuisances: Fit | None = None,
    iterations: int = ITERATIONS,
    known: bool = False,
) -> Fit:
    """Gauss-Newton from ``start`` = (ln p_m, amplitudes), with runs about each new estimate.

    A step that ends lower than it began, by more than LOWER, is halved until it does not, MOST_HALVED times at most.
    sparse : what effects change is taken from fingerprints. around : it is simulated at three strengths and amplitudes about the
    estimate, not one or two: what a large effect changes bends. nuisances : a fit whose nuisances are the starting values.
    iterations : most steps of the globals; with none they stay, and the nuisances alone are moved to their best. known : no runs
    are made but of the nominal model: effects change what the runs that there are say, in proportion.
    """
    begin = tuple(each.begin() for each in problem.observations) if nuisances is None else nuisances.nuisances
    values = {name: hold(problem, name, start[1].get(name, 0.0)) for name in hypothesis}
    place = ParameterPoint(hold_strength(problem, start[0]), values, begin)
    best: Solved | None = None
    share, settled, calm = 1.0, False, False
    gain = math.inf
    for iteration in range(iterations + 1):
        if known:
            problem.require_base_about(place.log_p_m)
        else:
            _ask(problem, hypothesis, place.log_p_m, place.values, sparse=sparse, around=around)
        there = solve_at(problem, place)
        if best is not None and there.log_posterior < best.log_posterior - LOWER:
            # posteriors compare where nuisances are at their best; the runs made since count for both
            best = converge_nuisances(problem, solve_at(problem, best.place), 0 if calm else MOST_NUISANCES)
            calm = True
            if there.log_posterior < best.log_posterior - LOWER:
                there = converge_nuisances(problem, there, 1)
        if best is None or there.log_posterior >= best.log_posterior - LOWER:
            gain = math.inf if best is None else there.log_posterior - best.log_posterior
            best, share, calm = there, 1.0, False
        else:
            share *= 0.5
        if settled or share < 0.5**MOST_HALVED:
            break
        place, settled = advance(problem, best, share)
        settled = settled and iteration > 0
        if iteration >= PATIENT and gain <= LOWER and not problem.felt:
            break
    assert best is not None
    if not (settled or calm):
        best = converge_nuisances(problem, best, MOST_NUISANCES)
    step = np.abs(stop_at_limits(problem, best)[0]) / np.sqrt(np.diag(best.covariance))
    return Fit(
        hypothesis,
        best.place.log_p_m,
        best.place.values,
        best.covariance,
        best.chi_square,
        best.points,
        best.log_likelihood,
        integrate_by_laplace(problem, best),
        best.blocks,
        best.place.nuisances,
        unsettled=float(step.max()),
        between_codes=problem.budget.other_codes,
    )


def find_leading(fits: Iterable[Fit], nominal: Fit) -> Fit:
    """The fit with most evidence; the nominal one where there is none."""
    return max(fits, key=lambda fit: fit.evidence, default=nominal)


def fit_p_value(fit: Fit) -> float:
    """p value of χ², the smallest of the drops' and of the scans' own, times their number.

    Contact time and speed of each drop are free; parts that are known better than they scatter do not hide one that fails.
    """
    worst = [rate_block(block, fit.hypothesis) for block in fit.blocks]
    return min(1.0, len(worst) * min(worst))


def rate_block(block: Block, hypothesis: Hypothesis) -> float:
    """p value of one observation's χ²; drops pay for the globals and for contact time and speed of each."""
    free = 1 + len(hypothesis) + 2 * len(block.sections) if isinstance(block, DropsBlock) else 0
    return float(chi2.sf(block.chi_square, max(block.residual.size - free, 1)))


def with_perturbations(
    problem: Problem, fit: Fit, names: Sequence[str], log_p_m: float | None = None
) -> Blocks:
    """The observations about a fit (or of its nuisances at another p_m) with tangents of further effects at their null."""
    place = fit.log_p_m if log_p_m is None else log_p_m
    return linearise_at(problem, fit.nuisances, place, fit.values, names)


def is_stopped(problem: Problem, fit: Fit) -> bool:
    """Whether the range of p_m stops a fit, not the data."""
    return any(math.isclose(fit.log_p_m, math.log(end), abs_tol=1e-9) for end in problem.campaign.p_m_range)


def keep_strengths(problem: Problem, fit: Fit, log_p_m: float) -> tuple[FloatArray, ...]:
    """A fit's nuisances at another ln p_m. Its drops show how strong each sample is, whatever p_m they have in common: with their
    differences from it held instead, curves would bend with p_m in ways that the covariance of the fit does not know."""
    change = log_p_m - fit.log_p_m
    return problem.tracks.keep_strengths(fit.nuisances[0], fit.drops, change), *fit.nuisances[1:]


def require_runs(problem: Problem, fit: Fit, *, sparse: bool = False) -> None:
    """Make sure that a problem has the runs that a fit, perhaps to another problem with the same effects, rests on."""
    _ask(problem, fit.hypothesis, fit.log_p_m, fit.values, sparse=sparse, around=False)


def _ask(
    problem: Problem,
    hypothesis: Hypothesis,
    log_p_m: float,
    values: Mapping[str, float],
    *,
    sparse: bool,
    around: bool,
) -> None:
    problem.require_base_about(log_p_m)
    indices: list[float] = [screening_node(log_p_m)] if sparse else nearest_nodes(log_p_m, problem.node_step)
    wanted = []
    for name in filter(problem.affects_simulation, hypothesis):
        close = around and not problem.follows_trend(name)
        # on a straight line a crust of a fifth of a long step is off by a tenth of itself
        nodes = amplitude_nodes(
            problem.effects[name], values[name], sparse=sparse, around=close, bent=problem.felt
        )
        strengths = nodes_around(log_p_m) if close else indices
        wanted += [(name, amplitude, index) for amplitude in nodes for index in strengths]
    if wanted:
        problem.require_changes(wanted, " and ".join(hypothesis), sparse=sparse)
    for name in hypothesis:
        if not sparse and problem.affects_simulation(name) and problem.acts_on_projectile(name):
            problem.require_trend(name, log_p_m, values[name])
