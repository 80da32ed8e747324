"""p_m from published figures: penetration depth, stopping time, or both.

Input: a campaign of ``summary`` records and a store of runs. Output: the posterior of p_m (emcee over an emulator of
a few runs) and, beside it, what every other reading of the same figures would have given (``readings``). The prior is
flat in ln p_m.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...records import Campaign, Drop, FloatArray
from ...runs.store import Progress, RunStore, require_stopped
from ...sph import DropRun, DropSetting
from ..fits.posterior import Posterior, sample
from .emulator import Emulator, fit_emulator
from .figures import FIGURE_KINDS, Figure, choose_drops, collect_figures, impact_speed
from .planar import SPACING, campaign_setting
from .readings import FigureLikelihood, NumericalError, Reading, integrate_reading, list_readings

REFERENCE_P_M = 1300.0  # Pa, the seed's dynamic value: where the two spacings are compared
# Pa; the literature on this dust has used the first and the last
OTHER_BULK_MODULI = (4.5e3, 45.0e3, 300.0e3)
COARSE, FINE = SPACING, SPACING / 2  # m, at the radius the box belongs to
DEGREE = 3
RUNS_PER_EMULATOR = 7


@dataclass(frozen=True)
class SummaryCalibration:
    """The posterior of p_m and all that stands beside it."""

    campaign: Campaign
    use: tuple[str, ...]
    depth_reading: str
    bulk_modulus: float
    figures: tuple[Figure, ...]
    posterior: Posterior  # of p_m_Pa
    quantiles: dict[str, float]  # of p_m, Pa: mean, sd, q05 ... q95
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

    def __repr__(self) -> str:
        p_m = {name: self.quantiles[name] / 1e3 for name in ("q05", "q50", "q95")}
        return f"<SummaryCalibration of {self.campaign.name}: p_m = {p_m['q50']:.3g} kPa, {p_m['q05']:.3g} to {p_m['q95']:.3g}>"

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
        place: fit_emulator(grid[:, None], _outputs(found), FIGURE_KINDS, DEGREE)
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

    def likelihood(chosen: Sequence[str], chosen_reading: str, k0: float) -> FigureLikelihood:
        figures = collect_figures(drops, chosen, chosen_reading)
        return FigureLikelihood(
            figures, {name: emulators[name, k0] for name in {f.drop for f in figures}}, numerical[k0]
        )

    main = likelihood(use, reading, modulus)
    posterior = _sample(main, campaign.p_m_range, seed, progress)
    found_readings = []
    for k0 in moduli:
        for chosen, name in list_readings(drops, reading, other_readings, tuple(use)):
            found_readings.append(
                integrate_reading(likelihood(chosen, name, k0), campaign.p_m_range, chosen, name, k0)
            )
    notes = [warning for found in runs.values() for run in found for warning in run.warnings]
    if any(r.at_limit for r in found_readings if r.bulk_modulus == modulus and r.use == tuple(use)):
        notes.append("the posterior of p_m leans on a limit of its prior; widen material.p_m_range_Pa")
    if not posterior.r_hat < 1.05:
        notes.append(f"the chains have not mixed (R-hat {posterior.r_hat:.3f})")
    return SummaryCalibration(
        campaign=campaign,
        use=tuple(use),
        depth_reading=reading,
        bulk_modulus=modulus,
        figures=main.figures,
        posterior=posterior,
        quantiles=summarise(posterior.calibrated),
        emulators=emulators,
        numerical=numerical,
        readings=tuple(found_readings),
        runs={place: tuple(found) for place, found in runs.items()},
        runs_new=store.new - new,
        runs_reused=store.reused - reused,
        wall=time.perf_counter() - began,
        warnings=tuple(dict.fromkeys(notes)),
    )


def summarise(samples: FloatArray) -> dict[str, float]:
    """Mean, standard deviation and quantiles under the names of calibration.json."""
    q = np.quantile(samples, (0.05, 0.16, 0.50, 0.84, 0.95))
    names = ("q05", "q16", "q50", "q84", "q95")
    return {
        "mean": float(np.mean(samples)),
        "sd": float(np.std(samples)),
        **{name: float(value) for name, value in zip(names, q, strict=True)},
    }


def _setting(campaign: Campaign, drop: Drop, p_m: float, k0: float, spacing: float) -> DropSetting:
    return campaign_setting(
        campaign, drop.projectile, impact_speed(drop, campaign), p_m, bulk_modulus=k0, spacing=spacing
    )


def _outputs(runs: Sequence[DropRun]) -> FloatArray:
    return np.array([[run.penetration_depth, run.stopping_time] for run in runs])


def _sample(
    likelihood: FigureLikelihood, limits: tuple[float, float], seed: int, progress: Progress | None
) -> Posterior:
    """emcee on ln p_m."""
    low, high = np.log(limits)

    def log_probability(position: FloatArray) -> FloatArray:
        ln_p_m = position[:, 0]
        inside = (ln_p_m >= low) & (ln_p_m <= high)
        return np.where(inside, likelihood(np.clip(ln_p_m, low, high)), -np.inf)

    # walkers begin all over the range
    return sample(
        log_probability,
        ("p_m_Pa",),
        np.array([0.5 * (low + high)]),
        np.array([[(0.1 * (high - low)) ** 2]]),
        seed=seed,
        transform=lambda _name, values: np.exp(values),
        progress=progress,
    )
