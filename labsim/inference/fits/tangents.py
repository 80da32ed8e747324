"""All parts of the data about one point of the globals, by finite differences of what the workbench predicts there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from ...records import FloatArray
from ..observations import Observation
from ..observations.drop_terms import Probe
from ..workbench import Workbench
from .blocks import Block

Blocks = tuple[Block, ...]  # one an observation, in the workbench's order


def linearise_at(
    bench: Workbench,
    nuisances: Sequence[FloatArray],
    log_p_m: float,
    values: Mapping[str, float],
    further: Sequence[str] = (),
) -> Blocks:
    """Every observation about a point. further : effects whose tangents at null are wanted too."""
    probes = {}
    for name, amplitude in {**{name: 0.0 for name in further}, **values}.items():
        parameter = bench.effects[name].amplitudes[0]
        step = 0.05 * parameter.grade(parameter.step)
        here = parameter.grade(amplitude)
        low, high = parameter.limits
        if not low <= parameter.null + parameter.amplitude_at(here + step) <= high:
            step = -step
        step = parameter.amplitude_at(here + step) - amplitude
        probes[name] = _stand(bench, {**values, name: amplitude + step}, step)
    nominal = _stand(bench, values)
    return tuple(
        each.linearise(own, log_p_m, nominal, bench.terms, probes)
        for each, own in zip(bench.observations, nuisances, strict=True)
    )


def linearise_alone(
    bench: Workbench, observation: Observation, values: Mapping[str, float], steps: Mapping[str, float]
) -> Block:
    """One observation that rests on no runs about amplitudes, with tangents by the given steps."""
    probes = {
        name: _stand(bench, {**values, name: values.get(name, 0.0) + step}, step)
        for name, step in steps.items()
    }
    return observation.linearise(observation.begin(), 0.0, _stand(bench, values), bench.terms, probes)


def _stand(bench: Workbench, values: Mapping[str, float], step: float = 0.0) -> Probe:
    setting = partial(bench.initial_setting, values)
    return Probe(values, bench.instruments(values), bench.log_offsets(values), setting, step)
