"""What a calibrated planar simulation gets wrong about published figures.

Input: a campaign of ``summary`` records and a calibration of p_m. Output: predictions of every figure with their
uncertainty, how many standard deviations each misses, how the stopping time scales with size at equal speed, and a
probability that nothing is wrong. Every statement is made from these numbers.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ...inference.fits.fitting import Hypothesis
from ...inference.published.calibrate import COARSE, SummaryCalibration
from ...inference.published.figures import impact_speed
from ...inference.published.planar import campaign_setting
from ...inference.published.readings import Reading
from ...records import Drop, FloatArray
from ...runs.store import Progress, RunStore, require_stopped
from ...sph import DropRun, DropSetting
from ..judge import Verdict
from .prediction import Prediction
from .scan import find_distance, predict_scan
from .sentence import say_summary
from .sizes import (
    Size,
    SizeScaling,
    compare_sizes,
    emulate_runs,
    find_exponent,
    predict_calibrated,
    predict_sizes,
)

# p_m of the runs lies on multiples of this in ln p_m, so a repeated study asks for the same runs
P_M_STEP = 0.05
# share of the variance of a published depth law that all sizes have in common: the rounding of its printed
# coefficient; the rest is the scatter of each size's own drops
LAW_SHARED = 0.5


@dataclass(frozen=True)
class SummaryDiagnosis:
    calibration: SummaryCalibration
    predictions: tuple[Prediction, ...]
    drop_predictions: tuple[Prediction, ...]  # drop by drop
    scaling: SizeScaling | None
    # by radius: n and sigma of D ∝ (m v/A)^n; the published law has 1
    exponents: dict[float, tuple[float, float]]
    # depth alone, stopping time alone, difference in sigma of ln p_m
    conflict: tuple[Reading, Reading, float] | None
    p_value: float
    verdict: Verdict  # of ("none",) and ("unknown",): published figures carry no search for a cause
    sentence: str
    runs: dict[float, tuple[DropRun, ...]]  # by radius
    scan_run: DropRun | None
    runs_new: int
    runs_reused: int
    wall: float
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<SummaryDiagnosis of {self.calibration.campaign.name}: {self.verdict.word}, p = {self.p_value:.2g}>"


def diagnose_summary(
    calibration: SummaryCalibration,
    store: RunStore,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> SummaryDiagnosis:
    """Predict what was not calibrated, and judge. Raises SimulationError where a run fails."""
    began, new, reused = time.perf_counter(), store.new, store.reused
    campaign = calibration.campaign
    calibrated = {figure.drop for figure in calibration.figures}
    groups: dict[float, list[Drop]] = {}
    for drop in campaign.drops:
        if drop.published is not None and drop.name not in calibrated:
            groups.setdefault(drop.projectile.tip_radius, []).append(drop)
    scans = campaign.published_scans
    p_grid = _choose_p_m(calibration)
    middle = float(p_grid[len(p_grid) // 2])

    plan: list[DropSetting] = []
    place: list[tuple[str, float]] = []
    for radius, drops in sorted(groups.items()):
        speeds = [impact_speed(drop, campaign) for drop in drops]
        speeds += [scan.speed.value for scan in scans if math.isclose(scan.projectile.tip_radius, radius)]
        for p_m in p_grid:
            for speed in _spread(min(speeds), max(speeds)):
                plan.append(_setting(calibration, drops[0], speed, p_m))
                place.append(("size", radius))
    pair = _pair_at_equal_speed(calibration, groups, middle)
    plan += pair
    place += [("pair", setting.projectile.tip_radius) for setting in pair]
    results = store.get_many(
        plan, workers=workers, scheduler=scheduler, progress=progress, text="prediction runs"
    )
    runs = require_stopped(results)

    sizes = []
    for radius, drops in sorted(groups.items()):
        own = [run for run, at in zip(runs, place, strict=True) if at == ("size", radius)]
        sizes.append(Size(radius, drops, own, emulate_runs(own)))
    p_m = np.clip(calibration.posterior.calibrated, p_grid[0], p_grid[-1])
    rows, drop_rows, log_samples, diagonal = predict_sizes(calibration, sizes, p_m)
    scan_run = None
    for scan in scans:
        own = [run for run, at in zip(runs, place, strict=True) if at == ("size", scan.projectile.tip_radius)]
        if not own:
            continue  # no drop of the scanned bead's size
        row, samples, sigma = predict_scan(scan, own, p_m)
        scan_run = min(own, key=lambda run: find_distance(run, scan, middle))
        rows.append(row)
        log_samples.append(samples)
        diagonal.append(sigma)
    scaling = compare_sizes(
        calibration, sizes, [run for run, at in zip(runs, place, strict=True) if at[0] == "pair"], p_m
    )
    p_value = judge_predictions(rows, log_samples, diagonal)
    rows = predict_calibrated(calibration) + rows
    conflict = _conflict(calibration)
    warnings = [warning for run in runs for warning in run.warnings]
    return SummaryDiagnosis(
        calibration=calibration,
        predictions=tuple(rows),
        drop_predictions=tuple(drop_rows),
        scaling=scaling,
        exponents={
            size.radius: find_exponent(calibration, size, p_m) for size in sizes if len(size.drops) > 1
        },
        conflict=conflict,
        p_value=p_value,
        verdict=_judge(p_value),
        sentence=say_summary(calibration, rows, scaling, conflict),
        runs={size.radius: tuple(size.runs) for size in sizes},
        scan_run=scan_run,
        runs_new=store.new - new,
        runs_reused=store.reused - reused,
        wall=time.perf_counter() - began,
        warnings=tuple(dict.fromkeys((*calibration.warnings, *warnings))),
    )


def _choose_p_m(calibration: SummaryCalibration) -> FloatArray:
    """Three values over the posterior, on a fixed grid."""
    low, high = np.log(np.quantile(calibration.posterior.calibrated, (0.01, 0.99)))
    low = P_M_STEP * math.floor(low / P_M_STEP)
    high = P_M_STEP * math.ceil(high / P_M_STEP)
    return np.exp(np.round(np.linspace(low, high, 3) / P_M_STEP) * P_M_STEP)


def _spread(low: float, high: float) -> list[float]:
    if math.isclose(low, high):
        low, high = 0.9 * low, 1.1 * high
    return [float(value) for value in np.geomspace(low, high, 3)]


def _setting(calibration: SummaryCalibration, drop: Drop, speed: float, p_m: float) -> DropSetting:
    return campaign_setting(
        calibration.campaign,
        drop.projectile,
        speed,
        float(p_m),
        bulk_modulus=calibration.bulk_modulus,
        spacing=COARSE,
    )


def _pair_at_equal_speed(
    calibration: SummaryCalibration, groups: dict[float, list[Drop]], p_m: float
) -> list[DropSetting]:
    """The smallest and the largest projectile at the geometric mean of their speeds."""
    if len(groups) < 2:
        return []
    chosen = [groups[min(groups)], groups[max(groups)]]
    speeds = [impact_speed(drop, calibration.campaign) for drops in chosen for drop in drops]
    speed = float(np.exp(np.mean(np.log(speeds))))
    return [_setting(calibration, drops[0], speed, p_m) for drops in chosen]


def _conflict(calibration: SummaryCalibration) -> tuple[Reading, Reading, float] | None:
    """Depth alone against stopping time alone, as calibrated here."""
    own = [r for r in calibration.readings if r.bulk_modulus == calibration.bulk_modulus]
    depth = next(
        (r for r in own if r.use == ("depth",) and r.depth_reading == calibration.depth_reading), None
    )
    stop = next((r for r in own if r.use == ("stopping_time",)), None)
    if depth is None or stop is None:
        return None
    width = math.hypot(math.log(depth.q95 / depth.q05), math.log(stop.q95 / stop.q05)) / (2 * 1.6449)
    return depth, stop, math.log(depth.q50 / stop.q50) / width


def judge_predictions(
    rows: Sequence[Prediction], log_samples: list[FloatArray], diagonal: list[float]
) -> float:
    """χ² of all predictions together; p_m correlates them, and the sizes share part of a published law's error."""
    if not rows:
        return 1.0
    residual = np.array([samples.mean() for samples in log_samples])
    covariance = np.atleast_2d(np.cov(np.array(log_samples))) + np.diag(np.square(diagonal))
    law = np.array([r.observed_sigma / r.observed if r.kind == "depth" else 0.0 for r in rows])
    covariance += LAW_SHARED * np.outer(law, law) + (1.0 - LAW_SHARED) * np.diag(law**2)
    return float(chi2.sf(residual @ np.linalg.solve(covariance, residual), len(rows)))


def _judge(p_value: float) -> Verdict:
    wrong = bound_probability(p_value)
    ranked: list[tuple[Hypothesis, float]] = sorted(
        [(("unknown",), wrong), (("none",), 1.0 - wrong)], key=lambda each: -each[1]
    )
    return Verdict("unknown" if p_value < 0.05 else "none", ranked)


def bound_probability(p_value: float) -> float:
    """Upper bound of the probability that something is wrong, from even odds (Sellke, Bayarri & Berger 2001)."""
    if p_value >= 1.0 / math.e:
        return 0.5
    bound = -math.e * max(p_value, 1e-300) * math.log(max(p_value, 1e-300))
    return 1.0 / (1.0 + bound)
