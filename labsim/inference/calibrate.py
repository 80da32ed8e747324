"""The posterior of p_m, and of any named effects' parameters, from the tracks and maps of a campaign."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import truncnorm

from ..calibrated import show_parameter
from ..effects import list_effects
from ..effects.model import Model
from ..errors import ExtrapolationError, InferenceError
from ..own_keys import DUST
from ..records import Campaign
from ..runs.store import Progress, RunStore
from .emulation.nodes import is_farthest
from .fits.error_sizes import integrate_sizes
from .fits.fitting import DOUBTFUL, Fit, fit_hypothesis, fit_p_value
from .fits.posterior import Posterior, sample
from .fits.refine import list_large_effects, refine
from .fits.target import make_target
from .free_fall import doubt_scales
from .measure import Measurements, measure
from .observations.compacted_zone import observe_scan
from .observations.linearised_drop import ErrorBudget
from .open_problem import open_problem
from .problem import Problem
from .scatter import ScatterEstimate, allow_scatter, estimate_scatter, set_error_budget
from .surface_rows import doubt_surface_rows

LEANS = 2.0  # standard errors of ln p_m from an end of its range: one in twenty of the Gaussian is cut off from there on
UNSETTLED = 0.5  # standard deviations of a parameter
AT = 0.1  # the same, that nobody would tell from none
LOST = 1e-6  # p value of a nominal fit that is not believed
STATIC = "static_strength"  # nobody knows beforehand that dust at rest is as strong as in a drop
FIRST_START = 1414.0  # Pa, or what the range has nearest to it: laboratories report some kPa
OTHER_STARTS = (500.0, 3500.0)  # Pa, of a fit to films that is lost
RUNG = 0.7  # of ln p_m, between two of the strengths that a lost fit to accelerometers is looked for at


@dataclass(frozen=True)
class Calibration:
    """What calibrate found. scatter : of ln p_m between samples, as the residuals show it; problem.budget has the one in use."""

    campaign: Campaign
    problem: Problem
    fit: Fit
    posterior: Posterior
    scatter: ScatterEstimate
    p_value: float
    runs_new: int
    runs_reused: int
    wall: float
    warnings: tuple[str, ...]
    doubts: int = 0  # how many of the warnings, the first ones, are about p_m itself: nobody should read it without them

    def __repr__(self) -> str:
        p_m = self.posterior.samples("p_m_Pa") / 1e3
        return f"<Calibration of {self.campaign.name}: p_m = {p_m.mean():.3g} ± {p_m.std():.2g} kPa>"


def prepare(
    campaign: Campaign,
    store: RunStore,
    *,
    budget: ErrorBudget | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    use_scans: bool = True,
    cells: int | None = None,
    measurements: Measurements | None = None,
    model: Model | None = None,
) -> tuple[Problem, Fit]:
    """Measure the campaign (where that has not been done) and fit the nominal model."""
    seen = measurements or measure(campaign, workers=workers)
    effects = list_effects(campaign.folder)
    problem = open_problem(
        campaign,
        store,
        effects,
        budget=budget,
        workers=workers,
        scheduler=scheduler,
        progress=progress,
        drops=seen.drops,
        scans=[observe_scan(each) for each in seen.reduced] if use_scans else [],
        undisturbed=seen.dust,
        model=model,
        cells=cells,
    )
    problem.warnings += seen.warnings
    middle = math.log(math.sqrt(campaign.p_m_range[0] * campaign.p_m_range[1]))
    dust = campaign.material.law == DUST
    start = max(min(middle, math.log(FIRST_START)), math.log(campaign.p_m_range[0])) if dust else middle
    nominal = fit_hypothesis(problem, (), (start, {}))
    if dust and fit_p_value(nominal) < LOST:  # Gauss and Newton may have run away
        nominal = fit_from_afar(problem, nominal)
    if problem.numerics:
        problem.require_fingerprints(
            list(problem.numerics), nominal.log_p_m, "what the solver's settings change"
        )
        nominal = fit_hypothesis(problem, (), (nominal.log_p_m, {}), nuisances=nominal)
    return problem, nominal


def fit_from_afar(problem: Problem, nominal: Fit) -> Fit:
    """The better of ``nominal`` and of fits from other strengths.

    Of accelerometers from where, on a ladder over the range of p_m, the data are least improbable: a drop that is simulated to
    stop before the measured one has no force at all where the data have the largest, and its slope there says nothing.
    """
    low, high = (math.log(p) for p in problem.campaign.p_m_range)
    if not problem.felt:
        starts = [math.log(p) for p in OTHER_STARTS if low <= math.log(p) <= high]
        fits = [nominal, *(fit_hypothesis(problem, (), (start, {})) for start in starts)]
        return max(fits, key=lambda fit: fit.evidence)
    ladder = np.linspace(low, high, 1 + math.ceil((high - low) / RUNG))
    seen = [nominal]
    for start in ladder:
        with suppress(ExtrapolationError):  # its runs fail: not from there
            seen.append(fit_hypothesis(problem, (), (float(start), {}), iterations=0))
    best = max(seen, key=lambda fit: fit.evidence)
    if best is nominal:
        return nominal
    again = fit_hypothesis(problem, (), (best.log_p_m, {}), nuisances=best)
    return max((best, again), key=lambda fit: fit.evidence)


def calibrate(
    campaign: Campaign,
    parameters: Sequence[str] = ("p_m",),
    *,
    store: RunStore | None = None,
    model: Model | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    seed: int = 1,
    progress: Progress | None = None,
    backend: Path | None = None,
    use_scans: bool = True,
) -> Calibration:
    """Posterior of p_m (Pa) and of effects named in ``parameters`` ("shear_strength" or "shear_strength.factor").

    Where static tests of compression or shear are among the data, "static_strength" (static over dynamic p_m) is one of them.

    model : effects (and material) held fixed as part of the simulation, as read from a model.toml.
    Returns a Calibration; its posterior opens with ArviZ.
    Raises InferenceError for an unknown parameter, MeasurementError and SimulationError as the parts do.
    """
    began = time.perf_counter()
    store = store or RunStore()
    names = tuple(name.split(".")[0] for name in parameters if name not in ("p_m", "p_m_Pa"))
    problem, nominal = prepare(
        campaign,
        store,
        budget=set_error_budget(campaign),
        workers=workers,
        scheduler=scheduler,
        progress=progress,
        use_scans=use_scans,
        model=model,
    )
    for name in names:
        if model is not None and name in dict(model.effects):
            raise InferenceError(
                campaign.folder, f"parameter {name}", "is held by the model; leave one of the two out"
            )
        if name not in problem.effects:
            reason = problem.reasons.get(name, f"is none of {', '.join(sorted(problem.effects))}")
            raise InferenceError(campaign.folder, f"parameter {name}", reason)
    if (
        STATIC in problem.effects
        and STATIC not in names
        and STATIC not in dict(model.effects if model else ())
    ):
        names += (STATIC,)
    fit = fit_hypothesis(problem, names, (nominal.log_p_m, {})) if names else nominal
    if list_large_effects(problem, fit):
        fit = refine(problem, fit)
    usual = problem.budget.scatter, fit_p_value(fit)
    problem, fit, scatter = allow_scatter(problem, fit)
    doubts = []
    if scatter is not None:
        label, _, _ = show_parameter(campaign.material.law)
        doubts.append(
            f"from drop to drop {label} scatters by {100 * scatter.value:.0f} %, more than the {100 * usual[0]:.0f} % of samples "
            f"that are alike (with which p = {usual[1]:.2g}); {label} and its error hold if the samples do differ by as much. A "
            "cause that changes from drop to drop looks the same: labsim diagnose tells them apart"
        )
    posterior = sample_fit(problem, fit, seed=seed, backend=backend, progress=progress)
    p_value = fit_p_value(fit)
    doubts += warn_of_range(problem, fit) + warn_unsettled(fit) + doubt_scales(problem.drops)
    if p_value < DOUBTFUL:
        doubts.append(
            f"the model does not explain the data (p = {p_value:.2g}), so that the error of p_m is too small; labsim "
            "diagnose asks why"
        )
        doubts += doubt_surface_rows(problem.drops)
    return Calibration(
        campaign,
        problem,
        fit,
        posterior,
        estimate_scatter(problem, fit),
        p_value,
        store.new,
        store.reused,
        time.perf_counter() - began,
        (*doubts, *warn_unused_scans(problem)),
        len(doubts),
    )


def warn_unsettled(fit: Fit) -> list[str]:
    """A line where a fit ended before it was at its best."""
    if fit.unsettled < UNSETTLED:
        return []
    return [
        f"the fit still asks for a step of {fit.unsettled:.1f} standard deviations: runs about it do not lie on one smooth "
        "curve, or there were too few steps; its numbers are no best fit"
    ]


def warn_of_range(problem: Problem, fit: Fit) -> list[str]:
    """A line where p_m is where its range, more than the data, puts it: at an end, or within LEANS standard errors of it. One
    for every effect that is as large as runs are made of.

    A fit does not leave the range; its value, χ² and chain are those of the best p_m inside.
    """
    low, high = problem.campaign.p_m_range
    sigma = math.sqrt(fit.covariance[0, 0])
    lines = []
    for end in (low, high):
        apart = abs(fit.log_p_m - math.log(end)) / sigma
        if apart < LEANS:
            where = "at" if apart < AT else f"{apart:.1f} standard errors from"
            lines.append(
                f"the best p_m lies {where} the end of its range, {end:.4g} Pa of {low:.4g} to {high:.4g} Pa: the range, not "
                "the data, says where it stops, and its error does not hold; widen material.p_m_range_Pa"
            )
            break
    for name, value in fit.values.items():
        if problem.affects_simulation(name) and is_farthest(problem.effects[name], value):
            lines.append(
                f"{name} is at the largest value that is simulated: it may be larger, and neither its error nor that of p_m holds"
            )
    return lines


def warn_unused_scans(problem: Problem) -> list[str]:
    """What was left out of the measurement, one line each."""
    lines = list(problem.warnings)
    if problem.undisturbed and not problem.scans:
        names = ", ".join(dust.name for dust in problem.undisturbed)
        lines.append(
            f"of scans {names} only the undisturbed dust and the point spread enter the likelihood, not the compacted zone"
        )
    return lines


def sample_fit(
    problem: Problem,
    fit: Fit,
    *,
    seed: int = 1,
    backend: Path | None = None,
    progress: Progress | None = None,
) -> Posterior:
    """emcee about a fit: parameters p_m_Pa and EFFECT.PARAMETER, flat prior in ln p_m, the effects' own priors.

    p_m is moved and widened, inside its range, by what another code would say, and where the data leave the shape of the
    effect open by what it is with the others.
    """
    target = make_target(problem, fit)
    if any(problem.affects_simulation(name) for name in fit.hypothesis):
        target = replace(target, sizes=integrate_sizes(problem, fit, target))
    posterior = sample(
        target.log_probability,
        target.names,
        np.clip(target.misfit.centre, *target.bounds.T),
        fit.covariance,
        seed=seed,
        transform=target.transform,
        backend=backend,
        progress=progress,
    )
    moved, width = fit.log_p_m_beside
    if width > 0.0:
        name = posterior.names[0]
        p_m = posterior.data.posterior[name]
        ends = ((np.log(end / p_m.values) - moved) / width for end in problem.campaign.p_m_range)
        other = truncnorm.rvs(*ends, size=p_m.shape, random_state=np.random.default_rng(seed))
        posterior.data.posterior[name] = p_m * np.exp(moved + width * other)
    return posterior
