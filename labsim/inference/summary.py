"""p_m from published figures: penetration depth, stopping time, or both.

Input: a campaign of ``summary`` records and a store of runs. Output: the posterior of p_m (emcee over an emulator of
a few runs) and, beside it, what every other reading of the same figures would have given. The likelihood is normal in
the logarithm of each figure; its variance holds the published uncertainty, the emulator's error on runs left out and
the numerical error, taken as the change of the figure between two spacings. The prior is flat in ln p_m.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import emcee
import numpy as np
from scipy.integrate import cumulative_trapezoid

from ..errors import InferenceError
from ..records import Campaign, Drop, FloatArray
from ..sph import DropRun
from .emulator import Emulator, fit_emulator
from .planar import READINGS, SPACING, campaign_setting, expected_raw_depth
from .runs import Progress, RunStore, require_stopped

USES = ("depth", "stopping_time")
REFERENCE_P_M = 1300.0  # Pa, the seed's dynamic value: where the two spacings are compared
OTHER_BULK_MODULI = (
    4.5e3,
    45.0e3,
    300.0e3,
)  # Pa; the literature on this dust has used the first and the last
COARSE, FINE = SPACING, SPACING / 2  # m, at the radius the box belongs to
DEGREE = 3
RUNS_PER_EMULATOR = 7


@dataclass(frozen=True)
class Figure:
    """One published number as the planar run must show it: ``value`` in SI, ``sigma`` of its logarithm."""

    drop: str
    kind: str  # "depth" or "stopping_time"
    value: float
    sigma: float


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
class SummaryCalibration:
    """The posterior of p_m and all that stands beside it."""

    campaign: Campaign
    use: tuple[str, ...]
    depth_reading: str
    bulk_modulus: float
    figures: tuple[Figure, ...]
    posterior: Any  # arviz.InferenceData with p_m in Pa
    quantiles: dict[str, float]  # of p_m, Pa: mean, sd, q05 ... q95
    r_hat: float
    ess: float
    emulators: dict[
        tuple[str, float], Emulator
    ]  # (drop, bulk modulus) -> depth and stopping time against p_m
    numerical: dict[float, NumericalError]  # by bulk modulus
    readings: tuple[Reading, ...]
    runs: dict[tuple[str, float], tuple[DropRun, ...]]
    runs_new: int
    runs_reused: int
    wall: float
    warnings: tuple[str, ...] = ()
    extra: dict = field(default_factory=dict)

    @property
    def finest_run(self) -> DropRun:
        """The run with the smallest spacing at this calibration's bulk modulus."""
        return min(self.runs["spacing", self.bulk_modulus], key=lambda run: run.setting.spacing)

    @property
    def slopes(self) -> dict[float, float]:
        """dlnD/dlnp_m by bulk modulus, over a factor of two to either side of the reference p_m."""
        drop = self.figures[0].drop
        at = REFERENCE_P_M * np.array([[0.5], [2.0]])
        return {
            k0: float(np.diff(self.emulators[drop, k0].predict_log(at)[:, 0])[0] / math.log(4.0))
            for k0 in self.numerical
        }

    @property
    def samples(self) -> FloatArray:
        """p_m of the posterior, (n,) Pa."""
        return self.posterior.posterior["p_m"].values.ravel()


def calibrate_summary(
    campaign: Campaign,
    store: RunStore,
    *,
    use: Sequence[str] = ("depth",),
    depth_reading: str | None = None,
    bulk_modulus: float | None = None,
    other_readings: bool = True,
    workers: int | None = None,
    scheduler: str | None = None,
    seed: int = 1,
    progress: Progress | None = None,
) -> SummaryCalibration:
    """Posterior of p_m. Raises InferenceError where the campaign lacks a figure, SimulationError where a run fails."""
    began = time.perf_counter()
    new, reused = store.new, store.reused
    reading = depth_reading or campaign.planar.depth_reading
    modulus = bulk_modulus or campaign.material.bulk_modulus
    drops = choose_drops(campaign, use)
    moduli = sorted({modulus, *OTHER_BULK_MODULI}, reverse=True) if other_readings else [modulus]
    grid = np.geomspace(*campaign.p_m_range, RUNS_PER_EMULATOR)

    plan, where = [], []
    for k0 in moduli:
        for drop in drops:
            for p_m in grid:
                plan.append(_setting(campaign, drop, p_m, k0, COARSE))
                where.append((drop.name, k0))
        for spacing in (COARSE, FINE):
            plan.append(_setting(campaign, drops[0], REFERENCE_P_M, k0, spacing))
            where.append(("spacing", k0))
    results = store.get_many(
        plan, workers=workers, scheduler=scheduler, progress=progress, text="calibration runs"
    )
    runs: dict[tuple[str, float], list[DropRun]] = {}
    for place, run in zip(where, require_stopped(results), strict=True):
        runs.setdefault(place, []).append(run)

    emulators = {
        place: fit_emulator(grid[:, None], _outputs(found), USES, DEGREE)
        for place, found in runs.items()
        if place[0] != "spacing"
    }
    numerical = {}
    for k0 in moduli:
        coarse, fine = runs["spacing", k0]
        numerical[k0] = NumericalError(
            k0,
            REFERENCE_P_M,
            (coarse.penetration_depth, fine.penetration_depth),
            (coarse.stopping_time, fine.stopping_time),
            (coarse.setting.spacing, fine.setting.spacing),
        )

    def likelihood(chosen: Sequence[str], chosen_reading: str, k0: float) -> _Likelihood:
        figures = collect_figures(drops, chosen, chosen_reading)
        return _Likelihood(
            figures, {name: emulators[name, k0] for name in {f.drop for f in figures}}, numerical[k0]
        )

    main = likelihood(use, reading, modulus)
    posterior, r_hat, ess = _sample(main, campaign.p_m_range, seed, progress)
    samples = posterior.posterior["p_m"].values.ravel()
    found_readings = []
    for k0 in moduli:
        for chosen, name in _list_readings(drops, reading, other_readings, tuple(use)):
            found_readings.append(
                _integrate(likelihood(chosen, name, k0), campaign.p_m_range, chosen, name, k0)
            )
    notes = [warning for found in runs.values() for run in found for warning in run.warnings]
    if any(r.at_limit for r in found_readings if r.bulk_modulus == modulus and r.use == tuple(use)):
        notes.append("the posterior of p_m leans on a limit of its prior; widen material.p_m_range_Pa")
    if not r_hat < 1.05:
        notes.append(f"the chains have not mixed (R-hat {r_hat:.3f})")
    return SummaryCalibration(
        campaign=campaign,
        use=tuple(use),
        depth_reading=reading,
        bulk_modulus=modulus,
        figures=main.figures,
        posterior=posterior,
        quantiles=summarise(samples),
        r_hat=r_hat,
        ess=ess,
        emulators=emulators,
        numerical=numerical,
        readings=tuple(found_readings),
        runs={place: tuple(found) for place, found in runs.items()},
        runs_new=store.new - new,
        runs_reused=store.reused - reused,
        wall=time.perf_counter() - began,
        warnings=tuple(dict.fromkeys(notes)),
    )


def choose_drops(campaign: Campaign, use: Sequence[str]) -> list[Drop]:
    """The drops to calibrate on: those named in [planar], or all. Raises InferenceError where figures are missing."""
    for name in use:
        if name not in USES:
            raise InferenceError(
                "", "--use", f'"{name}" is not a figure; use one or more of {", ".join(USES)}'
            )
    if not use:
        raise InferenceError("", "--use", f"names no figure; use one or more of {', '.join(USES)}")
    where = campaign.folder / "campaign.toml"
    if campaign.geometry != "planar":
        raise InferenceError(
            where,
            "model.geometry",
            'published figures are calibrated with planar runs; write geometry = "planar"',
        )
    wanted = campaign.planar.calibration_drops or tuple(drop.name for drop in campaign.drops)
    drops = [drop for drop in campaign.drops if drop.name in wanted and drop.published is not None]
    for name in use:
        if not any(_published(drop, name) for drop in drops):
            raise InferenceError(
                where, "--use", f"no calibration drop has a published {name}; choose another figure"
            )
    return drops


def collect_figures(drops: Sequence[Drop], use: Sequence[str], depth_reading: str) -> tuple[Figure, ...]:
    """The published figures to calibrate on, as planar runs must show them."""
    figures = []
    for drop in drops:
        for kind in use:
            if (found := _published(drop, kind)) is not None:
                value = expected_raw_depth(found.value, depth_reading) if kind == "depth" else found.value
                figures.append(Figure(drop.name, kind, value, found.sigma / found.value))
    return tuple(figures)


def summarise(samples: FloatArray) -> dict[str, float]:
    """Mean, standard deviation and quantiles under the names of calibration.json."""
    q = np.quantile(samples, (0.05, 0.16, 0.50, 0.84, 0.95))
    names = ("q05", "q16", "q50", "q84", "q95")
    return {
        "mean": float(np.mean(samples)),
        "sd": float(np.std(samples)),
        **{name: float(value) for name, value in zip(names, q, strict=True)},
    }


def _published(drop: Drop, kind: str):  # type: ignore[no-untyped-def]
    if drop.published is None:
        return None
    return drop.published.penetration_depth if kind == "depth" else drop.published.stopping_time


def _setting(campaign: Campaign, drop: Drop, p_m: float, k0: float, spacing: float):  # type: ignore[no-untyped-def]
    return campaign_setting(
        campaign, drop.projectile, impact_speed(drop, campaign), p_m, bulk_modulus=k0, spacing=spacing
    )


def impact_speed(drop: Drop, campaign: Campaign) -> float:
    """The published speed at contact, or that of the free fall from the stated height (m/s)."""
    if drop.published is not None and drop.published.impact_speed is not None:
        return drop.published.impact_speed.value
    assert drop.height is not None
    return math.sqrt(2.0 * (campaign.gravity or 9.81) * drop.height.value)


def _outputs(runs: Sequence[DropRun]) -> FloatArray:
    return np.array([[run.penetration_depth, run.stopping_time] for run in runs])


@dataclass(frozen=True)
class _Likelihood:
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


def _sample(
    likelihood: _Likelihood, limits: tuple[float, float], seed: int, progress: Progress | None
) -> tuple[Any, float, float]:
    """emcee on ln p_m; arviz.InferenceData, R-hat and effective sample size."""
    low, high = np.log(limits)

    def log_probability(position: FloatArray) -> FloatArray:
        ln_p_m = position[:, 0]
        inside = (ln_p_m >= low) & (ln_p_m <= high)
        return np.where(inside, likelihood(np.clip(ln_p_m, low, high)), -np.inf)

    walkers, steps, discard = 16, 4000, 500
    random = np.random.default_rng(seed)
    start = random.uniform(low, high, (walkers, 1))
    sampler = emcee.EnsembleSampler(walkers, 1, log_probability, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    for number, _state in enumerate(sampler.sample(start, iterations=steps), start=1):
        if progress is not None and number % 500 == 0:
            progress(number, steps, "sampling p_m")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # arviz announces its own rewriting at every import
        import arviz
    chain = np.exp(np.swapaxes(sampler.get_chain(discard=discard), 0, 1)[:, :, 0])
    data = arviz.from_dict(
        posterior={"p_m": chain},
        sample_stats={"lp": np.swapaxes(sampler.get_log_prob(discard=discard), 0, 1)},
        attrs={"unit": "Pa", "prior": f"flat in ln p_m between {limits[0]:g} and {limits[1]:g} Pa"},
    )
    return data, float(arviz.rhat(data)["p_m"]), float(arviz.ess(data)["p_m"])


def _list_readings(
    drops: Sequence[Drop], reading: str, others: bool, use: tuple[str, ...]
) -> list[tuple[tuple[str, ...], str]]:
    if not others:
        return [(use, reading)]
    has = [kind for kind in USES if any(_published(drop, kind) for drop in drops)]
    rows: list[tuple[tuple[str, ...], str]] = []
    if "depth" in has:
        rows += [(("depth",), name) for name in READINGS]
    if "stopping_time" in has:
        rows.append((("stopping_time",), reading))
    if len(has) == 2:
        rows += [(("depth", "stopping_time"), name) for name in READINGS]
    return rows


def _integrate(
    likelihood: _Likelihood, limits: tuple[float, float], use: tuple[str, ...], depth_reading: str, k0: float
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
