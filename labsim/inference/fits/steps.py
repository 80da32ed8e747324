"""Gauss-Newton steps of p_m and amplitudes: where a fit stands, what it sees from there, where it goes next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...records import FloatArray
from ..emulation.nodes import hold_known
from ..problem import Problem
from .blocks import Block, solve_globals
from .tangents import Blocks, linearise_at

SETTLED = 0.02  # of a standard deviation
CALM = 0.05  # move of nuisances, as move_nuisances counts it
LOWER = 3.0  # ln likelihood that a step may lose: its aim, the least χ², lies that far from the top or less
OVERSHOOTS = 0.7  # of the last move of nuisances: they go to and fro


@dataclass(frozen=True)
class ParameterPoint:
    """Where a fit stands. nuisances : of every observation."""

    log_p_m: float
    values: dict[str, float]
    nuisances: tuple[FloatArray, ...]


@dataclass(frozen=True)
class Solved:
    """The likelihood about a place, and the Gauss-Newton step from there.

    log_likelihood : of the place itself; log_posterior : with what stands for the priors of amplitudes.
    """

    place: ParameterPoint
    blocks: Blocks
    step: FloatArray
    covariance: FloatArray
    chi_square: float
    points: int
    log_likelihood: float
    log_posterior: float


def solve_at(problem: Problem, place: ParameterPoint) -> Solved:
    """The likelihood about a place with the runs that there are."""
    blocks = linearise_at(problem, place.nuisances, place.log_p_m, place.values)
    stand_ins = {
        name: problem.effects[name].amplitudes[0].stand_in(value) for name, value in place.values.items()
    }
    priors = {name: (place.values[name], width) for name, (width, _) in stand_ins.items()}
    step, covariance, _left, logdet, _weighted = solve_globals(blocks, ("ln_p_m", *place.values), priors)
    chi_square = sum(block.chi_square for block in blocks)
    points = sum(block.residual.size for block in blocks)
    log_likelihood = -0.5 * (chi_square + logdet + points * math.log(2 * math.pi))
    log_posterior = log_likelihood + sum(log_ratio for _, log_ratio in stand_ins.values())
    return Solved(place, blocks, step, covariance, chi_square, points, log_likelihood, log_posterior)


def converge_nuisances(problem: Problem, here: Solved, most: int) -> Solved:
    """The same with the nuisances moved to their best there, ``most`` times; where that overshoots, half as far."""
    share, last = 1.0, math.inf
    for _ in range(most):
        place, shift = _follow(problem, here, here.place.log_p_m, here.place.values)
        if shift > OVERSHOOTS * last:
            share *= 0.5
        pairs = zip(here.place.nuisances, place.nuisances, strict=True)
        moved = tuple(before + share * (after - before) for before, after in pairs)
        here, last = solve_at(problem, replace(place, nuisances=moved)), shift
        if shift < CALM:
            break
    return here


def advance(problem: Problem, here: Solved, share: float) -> tuple[ParameterPoint, bool]:
    """The next place, a share of the step on, and whether it is as good as the last."""
    place = here.place
    moved = share * _shorten(problem, stop_at_limits(problem, here)[0], place.values)
    log_p_m = hold_strength(problem, place.log_p_m + float(np.clip(moved[0], -0.7, 0.7)))
    apart = [abs(log_p_m - place.log_p_m) / math.sqrt(here.covariance[0, 0])]
    values: dict[str, float] = {}
    for k, (name, before) in enumerate(place.values.items(), start=1):
        values[name] = hold(problem, name, before + float(moved[k]))
        apart.append(abs(values[name] - before) / math.sqrt(here.covariance[k, k]))
    there, shift = _follow(problem, here, log_p_m, values)
    return there, max(apart) < SETTLED and shift < CALM


def _follow(
    problem: Problem, here: Solved, log_p_m: float, values: dict[str, float]
) -> tuple[ParameterPoint, float]:
    """The place at other globals, its nuisances at what is best with them as seen from here, and how far these moved."""
    place = here.place
    taken = {"ln_p_m": log_p_m - place.log_p_m}
    taken |= {name: values[name] - before for name, before in place.values.items()}
    weighted = []
    for block in here.blocks:
        change = sum(part * block.tangents[name] for name, part in taken.items())
        weighted.append(block.solve(block.residual - change))
    nuisances, shift = move_nuisances(problem, place.nuisances, here.blocks, weighted)
    return ParameterPoint(log_p_m, values, nuisances), shift


def move_nuisances(
    problem: Problem,
    nuisances: Sequence[FloatArray],
    blocks: Sequence[Block],
    weighted: Sequence[FloatArray],
) -> tuple[tuple[FloatArray, ...], float]:
    """Nuisances of every observation at their conditional best, and the largest move; weighted : as solve_globals gives."""
    followed = [
        observation.follow(own, block, left)
        for observation, own, block, left in zip(
            problem.observations, nuisances, blocks, weighted, strict=True
        )
    ]
    return tuple(own for own, _ in followed), max(move for _, move in followed)


def stop_at_limits(problem: Problem, here: Solved) -> tuple[FloatArray, set[int]]:
    """The step with p_m and amplitudes stopped at their limits, the others at their best with them; and the places of those
    stopped."""
    step, stopped = here.step, set()
    wanted = here.place.log_p_m + float(step[0])
    if (held := hold_strength(problem, wanted)) != wanted:
        step = step + here.covariance[0] / here.covariance[0, 0] * (held - wanted)
        stopped.add(0)
    for k, (name, value) in enumerate(here.place.values.items(), start=1):
        parameter = problem.effects[name].amplitudes[0]
        wanted = value + float(step[k])
        held = hold(problem, name, wanted)
        if not math.isclose(held, wanted, rel_tol=1e-9, abs_tol=1e-9 * abs(parameter.step)):
            step = step + here.covariance[k] / here.covariance[k, k] * (held - wanted)
            stopped.add(k)
    return step, stopped


def hold_strength(problem: Problem, log_p_m: float) -> float:
    """ln p_m, inside its range."""
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    return min(max(log_p_m, low), high)


def hold(problem: Problem, name: str, amplitude: float) -> float:
    """An amplitude, inside the limits of its parameter and within what runs are made of."""
    effect = problem.effects[name]
    if problem.affects_simulation(name):
        return hold_known(effect, amplitude)
    return effect.amplitudes[0].hold(amplitude) - effect.amplitudes[0].null


def _shorten(problem: Problem, step: FloatArray, values: Mapping[str, float]) -> FloatArray:
    """Shorten a step so that no amplitude moves by more than 1.5 of its own simulation steps at once."""
    factor = min(1.0, 0.7 / max(abs(float(step[0])), 1e-12))
    for moved, (name, value) in zip(step[1:], values.items(), strict=True):
        parameter = problem.effects[name].amplitudes[0]
        unit, here = abs(parameter.grade(parameter.step)), parameter.grade(value)
        further = math.copysign(1.5 * max(unit, abs(here)), moved)
        reach = abs(parameter.amplitude_at(here + further) - value)
        if abs(moved) > reach:
            factor = min(factor, reach / abs(float(moved)))
    return step * factor
