"""All parts of the data about one point of the globals, by finite differences of what the problem predicts there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from ...records import FloatArray
from ..observations import Observation
from ..observations.linearised_drop import Perturbation
from ..problem import Problem
from .blocks import Block

Blocks = tuple[Block, ...]  # one an observation, in the problem's order


def linearise_at(
    problem: Problem,
    nuisances: Sequence[FloatArray],
    log_p_m: float,
    values: Mapping[str, float],
    further: Sequence[str] = (),
) -> Blocks:
    """Every observation about a point. further : effects whose tangents at null are wanted too."""
    perturbations = {}
    for name, amplitude in {**{name: 0.0 for name in further}, **values}.items():
        step = problem.effects[name].amplitudes[0].difference(amplitude)
        perturbations[name] = _stand(problem, {**values, name: amplitude + step}, step)
    nominal = _stand(problem, values)
    return tuple(
        each.linearise(own, log_p_m, nominal, problem.budget, perturbations)
        for each, own in zip(problem.observations, nuisances, strict=True)
    )


def linearise_alone(
    problem: Problem, observation: Observation, values: Mapping[str, float], steps: Mapping[str, float]
) -> Block:
    """One observation that rests on no runs about amplitudes, with tangents by the given steps."""
    perturbations = {
        name: _stand(problem, {**values, name: values.get(name, 0.0) + step}, step)
        for name, step in steps.items()
    }
    return observation.linearise(
        observation.begin(), 0.0, _stand(problem, values), problem.budget, perturbations
    )


def _stand(problem: Problem, values: Mapping[str, float], step: float = 0.0) -> Perturbation:
    setting = partial(problem.initial_setting, values)
    return Perturbation(values, problem.instruments(values), problem.log_offsets(values), setting, step)
