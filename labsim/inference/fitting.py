"""Fit p_m, and the amplitudes of any effects, to a whole campaign: ask for runs, interpolate, Gauss-Newton, ask again.

A Hypothesis is a tuple of effect names; the empty one is the nominal model. Runs are asked for at the strength nodes and
amplitude nodes that enclose the current estimate, so that the answer never rests on extrapolation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr
from scipy.stats import chi2

from ..records import FloatArray
from .blocks import Block
from .drop_model import DropModel
from .drop_terms import Probe
from .likelihood import Linearised, linearise, solve_globals, update_nuisances
from .nodes import amplitude_nodes, enclosing_nodes, nearest_nodes, screening_node
from .scans import linearise_scan, update_speed
from .undisturbed import Seen, linearise_undisturbed
from .workbench import Workbench, find_family

Hypothesis = tuple[str, ...]
ITERATIONS = 12
SETTLED = 0.02  # of a standard deviation
MOST_CUT = 1.0 - 1e-12  # of a Gaussian, by two limits closer than rounding
BEYOND = 0.7  # of ln p_m, how far outside its range an estimate may stray


@dataclass(frozen=True)
class Fit:
    """One hypothesis, fitted. values : name of effect -> amplitude (parameter minus null, in the parameter's unit).

    covariance : of (ln p_m, amplitudes in order); evidence : ln of the integrated likelihood (Laplace), priors included.
    """

    hypothesis: Hypothesis
    log_p_m: float
    values: dict[str, float]
    covariance: FloatArray
    chi_square: float
    points: int
    log_likelihood: float
    evidence: float
    linear: Linearised
    models: list[DropModel]
    scan_speeds: tuple[float, ...] = ()  # ln of the impact speeds of the scans, at their best
    # of ln p_m over the shapes of the effect that were fitted, by their evidence: mean minus this one's, standard deviation
    over_shapes: tuple[float, float] = (0.0, 0.0)

    @property
    def log_p_m_over_shapes(self) -> tuple[float, float]:
        """Mean and standard deviation of ln p_m, those of the effect's shapes included."""
        moved, width = self.over_shapes
        return self.log_p_m + moved, math.hypot(math.sqrt(self.covariance[0, 0]), width)


def fit_hypothesis(
    bench: Workbench,
    hypothesis: Hypothesis,
    start: tuple[float, Mapping[str, float]],
    *,
    coarse: bool = False,
    around: bool = False,
    nuisances: Fit | None = None,
    iterations: int = ITERATIONS,
) -> Fit:
    """Gauss-Newton from ``start`` = (ln p_m, amplitudes), with runs about each new estimate.

    coarse : what effects change is taken from fingerprints. around : it is simulated at three strengths and amplitudes about the
    estimate, not one or two: what a large effect changes bends. nuisances : a fit whose nuisances are the starting values.
    """
    # nuisances are the fit's own, tables those of the workbench
    models = [
        replace(model, table=bench.tables[_table_number(bench, model)])
        for model in (nuisances.models if nuisances is not None else bench.models)
    ]
    speeds = list(nuisances.scan_speeds if nuisances is not None else (scan.stated for scan in bench.scans))
    low, high = (math.log(p) for p in bench.campaign.p_m_range)
    log_p_m, values = start[0], {name: start[1].get(name, 0.0) for name in hypothesis}
    names = ("ln_p_m", *hypothesis)
    for iteration in range(iterations):
        _ask(bench, hypothesis, log_p_m, values, coarse=coarse, around=around)
        linear = linearise_at(bench, models, speeds, log_p_m, values)
        step, covariance, _chi, _logdet, weighted = solve_globals(
            linear.blocks, names, _priors(bench, values)
        )
        moved = _limit(bench, hypothesis, step, values)
        new_log = float(np.clip(log_p_m + np.clip(moved[0], -0.7, 0.7), low - BEYOND, high + BEYOND))
        change = [abs(new_log - log_p_m) / math.sqrt(covariance[0, 0])]
        log_p_m = new_log
        for k, name in enumerate(hypothesis):
            before = values[name]
            values[name] = _inside(bench, name, before + float(moved[k + 1]))
            change.append(abs(values[name] - before) / math.sqrt(covariance[k + 1, k + 1]))
        shift = move_nuisances(bench, models, speeds, linear, weighted)
        if max(change) < SETTLED and shift < 0.05 and iteration > 0:
            break
    _ask(bench, hypothesis, log_p_m, values, coarse=coarse, around=around)
    linear = linearise_at(bench, models, speeds, log_p_m, values)
    step, covariance, _chi, logdet, _ = solve_globals(linear.blocks, names, _priors(bench, values))
    solved_here = sum(block.chi_square for block in linear.blocks)
    n = sum(block.residual.size for block in linear.blocks)
    log_likelihood = -0.5 * (solved_here + logdet + n * math.log(2 * math.pi))
    evidence = (
        log_likelihood + 0.5 * len(names) * math.log(2 * math.pi) + 0.5 * np.linalg.slogdet(covariance)[1]
    )
    evidence -= math.log(high - low)
    limits = [(low - log_p_m, high - log_p_m)]
    for name in hypothesis:
        parameter = bench.effects[name].amplitudes[0]
        limits.append(tuple(limit - parameter.null - values[name] for limit in parameter.limits))
    for moved, sigma, between in zip(step, np.sqrt(np.diag(covariance)), limits, strict=True):
        # Laplace's formula where a limit cuts the Gaussian, or its top, off
        evidence += 0.5 * (moved / sigma) ** 2 + log_share_inside(*between, moved, sigma)
    for name in hypothesis:
        parameter = bench.effects[name].amplitudes[0]
        evidence += float(parameter.log_prior(parameter.hold(values[name])))
        evidence += bench.shape_evidence.get(name, 0.0)
    return Fit(
        hypothesis,
        log_p_m,
        values,
        covariance,
        solved_here,
        n,
        log_likelihood,
        float(evidence),
        linear,
        models,
        tuple(speeds),
    )


def move_nuisances(
    bench: Workbench,
    models: list[DropModel],
    speeds: list[float],
    linear: Linearised,
    weighted: Sequence[FloatArray],
) -> float:
    """Move the nuisances of drops, and speeds (ln) of scans, to their conditional best values; weighted : as solve_globals gives.

    The largest move: in prior widths, contact time in units of a frame, speeds of scans in two of theirs.
    """
    shift = update_nuisances(models, linear, weighted[0])
    for k, (scan, block) in enumerate(zip(bench.scans, linear.scans, strict=True)):
        speeds[k], moved_by = update_speed(scan, speeds[k], block, weighted[1 + k])
        shift = max(shift, 0.5 * moved_by)
    return shift


def log_share_inside(low: float, high: float, mean: float, sigma: float) -> float:
    """ln of the share of a Gaussian between two limits: what is left of an integral that a flat prior ends at."""
    below, above = (low - mean) / sigma, (high - mean) / sigma
    if below > 0.0:  # the other tail, where shares do not round to 1
        below, above = -above, -below
    return float(log_ndtr(above) + math.log1p(-min(math.exp(log_ndtr(below) - log_ndtr(above)), MOST_CUT)))


def goodness_of_fit(fit: Fit) -> float:
    """p value of χ², the smallest of the drops' and of the scans' own, times their number.

    Contact time and speed of each drop are free; parts that are known better than they scatter do not hide one that fails.
    """
    worst = []
    for k, block in enumerate(fit.linear.blocks):
        free = 1 + len(fit.hypothesis) + 2 * len(fit.models) if k == 0 else 0
        worst.append(float(chi2.sf(block.chi_square, max(block.residual.size - free, 1))))
    return min(1.0, len(worst) * min(worst))


def _table_number(bench: Workbench, model: DropModel) -> int:
    return find_family(bench.families, model.observed.drop.projectile, is_scan=False)


def with_probes(bench: Workbench, fit: Fit, names: Sequence[str], log_p_m: float | None = None) -> Linearised:
    """The linearisation of a fit (or of its nuisances at another p_m) with tangents of further effects at their null."""
    place = fit.log_p_m if log_p_m is None else log_p_m
    return linearise_at(bench, fit.models, fit.scan_speeds, place, fit.values, names)


def linearise_at(
    bench: Workbench,
    models: list[DropModel],
    scan_speeds: Sequence[float],
    log_p_m: float,
    values: Mapping[str, float],
    further: Sequence[str] = (),
) -> Linearised:
    probes = {}
    for name, amplitude in {**{name: 0.0 for name in further}, **values}.items():
        step = 0.05 * bench.effects[name].amplitudes[0].step
        parameter = bench.effects[name].amplitudes[0]
        low, high = parameter.limits
        if not low <= parameter.null + amplitude + step <= high:
            step = -step
        probes[name] = _stand(bench, {**values, name: amplitude + step}, step)
    nominal = _stand(bench, values)
    linear = linearise(models, log_p_m, nominal, bench.terms, probes)
    scans = tuple(
        linearise_scan(scan, speed, log_p_m, nominal, bench.terms.scatter, probes)
        for scan, speed in zip(bench.scans, scan_speeds, strict=True)
    )
    return replace(linear, scans=scans, undisturbed=tuple(_linearise_dust(bench, nominal, probes)))


def _stand(bench: Workbench, values: Mapping[str, float], step: float = 0.0) -> Probe:
    return Probe(values, bench.instruments(values), bench.log_offsets(values), step)


def linearise_dust(bench: Workbench, values: Mapping[str, float], steps: Mapping[str, float]) -> list[Block]:
    """The undisturbed dust about amplitudes, with tangents by the given steps; empty without scans."""
    probes = {
        name: _stand(bench, {**values, name: values.get(name, 0.0) + step}, step)
        for name, step in steps.items()
    }
    return _linearise_dust(bench, _stand(bench, values), probes)


def _linearise_dust(bench: Workbench, nominal: Probe, probes: Mapping[str, Probe]) -> list[Block]:
    if not bench.undisturbed:
        return []
    plain = bench.grid.setting(bench.families[0], bench.families[0].speeds[0], 1000.0)

    def see(point: Probe) -> dict[str, Seen]:
        seen = {}
        for dust in bench.undisturbed:
            setting = plain
            for name, amplitude in point.amplitudes.items():
                if amplitude != 0.0:
                    place = bench.places[dust.name]
                    setting = bench.effects[name].apply(setting, bench.at(name, amplitude), place)
            seen[dust.name] = (setting, point.instruments[dust.name])
        return seen

    moved = {name: (see(point), point.step) for name, point in probes.items()}
    sigma = bench.campaign.sample.filling_factor_sigma
    return [linearise_undisturbed(bench.undisturbed, see(nominal), moved, sigma)]


def _ask(
    bench: Workbench,
    hypothesis: Hypothesis,
    log_p_m: float,
    values: Mapping[str, float],
    *,
    coarse: bool,
    around: bool,
) -> None:
    bench.require_base(enclosing_nodes(log_p_m, bench.campaign.p_m_range))
    wanted = [
        (name, amplitude, index)
        for name in hypothesis
        if bench.costs_runs(name)
        for amplitude in amplitude_nodes(bench.effects[name], values[name], coarse=coarse, around=around)
        for index in ([screening_node(log_p_m)] if coarse else nearest_nodes(log_p_m, around=around))
    ]
    if wanted:
        bench.require_changes(wanted, " and ".join(hypothesis), coarse=coarse)


def _priors(bench: Workbench, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Per effect its distance from null and the width of its prior about it."""
    return {name: (amplitude, bench.effects[name].amplitudes[0].scale) for name, amplitude in values.items()}


def _inside(bench: Workbench, name: str, amplitude: float) -> float:
    parameter = bench.effects[name].amplitudes[0]
    return parameter.hold(amplitude) - parameter.null


def _limit(
    bench: Workbench, hypothesis: Hypothesis, step: FloatArray, values: Mapping[str, float]
) -> FloatArray:
    """Shorten a step so that no amplitude moves by more than 1.5 of its own simulation steps at once."""
    factor = min(1.0, 0.7 / max(abs(float(step[0])), 1e-12))
    for k, name in enumerate(hypothesis):
        reach = (
            1.5
            * abs(bench.effects[name].amplitudes[0].step)
            * max(1.0, abs(values[name] / bench.effects[name].amplitudes[0].step))
        )
        if abs(step[k + 1]) > reach:
            factor = min(factor, reach / abs(float(step[k + 1])))
    return step * factor
