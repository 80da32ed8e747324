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
from scipy.stats import chi2, norm

from ..inference.emulator import Emulator, fit_emulator
from ..inference.planar import campaign_setting, round_depth
from ..inference.runs import Progress, RunStore, require_stopped
from ..inference.summary import COARSE, Reading, SummaryCalibration, impact_speed
from ..records import Drop, FloatArray, PublishedScan
from ..sph import DropRun, DropSetting

OUTPUTS = ("depth", "stopping_time")
P_M_STEP = (
    0.05  # p_m of the runs lies on multiples of this in ln p_m, so a repeated study asks for the same runs
)
# share of the variance of a published depth law that all sizes have in common: the rounding of its printed
# coefficient; the rest is the scatter of each size's own drops
LAW_SHARED = 0.5
MISSES = 2.0  # standard deviations beyond which a figure is said to be missed


@dataclass(frozen=True)
class Prediction:
    """One figure: what was published and what the calibrated simulation says, in ``unit``."""

    name: str
    kind: str  # depth, stopping_time, compacted_volume, stopping_time_ratio
    unit: str
    observed: float
    observed_sigma: float
    predicted: float
    predicted_sigma: float
    used: bool = False  # in the calibration
    note: str = ""

    @property
    def deviation(self) -> float:
        """Predicted minus observed in standard deviations of both together."""
        return (self.predicted - self.observed) / math.hypot(self.observed_sigma, self.predicted_sigma)

    @property
    def missed(self) -> bool:
        return abs(self.deviation) > MISSES


@dataclass(frozen=True)
class SizeScaling:
    """Stopping times of two sizes at the same speed, and at the same m v/A."""

    small: float  # m, radius
    large: float
    speed: float  # m/s, of the pair at equal speed
    ratio_equal_speed: float
    ratio_equal_speed_sigma: float
    ratio_equal_momentum: float
    ratio_equal_momentum_sigma: float
    observed: float
    observed_sigma: float

    @property
    def exponent(self) -> float:
        """T_s ∝ R^exponent at equal speed."""
        return math.log(self.ratio_equal_speed) / math.log(self.large / self.small)


@dataclass(frozen=True)
class SummaryDiagnosis:
    calibration: SummaryCalibration
    predictions: tuple[Prediction, ...]
    drop_predictions: tuple[Prediction, ...]  # drop by drop
    scaling: SizeScaling | None
    exponents: dict[
        float, tuple[float, float]
    ]  # by radius: n and sigma of D ∝ (m v/A)^n; the published law has 1
    conflict: (
        tuple[Reading, Reading, float] | None
    )  # depth alone, stopping time alone, difference in sigma of ln p_m
    p_value: float
    probability_wrong: float
    verdict: str
    sentence: str
    runs: dict[float, tuple[DropRun, ...]]  # by radius
    scan_run: DropRun | None
    runs_new: int
    runs_reused: int
    wall: float
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Size:
    radius: float
    drops: list[Drop]
    runs: list[DropRun]
    emulator: Emulator  # (p_m, speed) -> depth, stopping time

    def predict(self, p_m: FloatArray, speed: float) -> FloatArray:
        """(n, 2) raw depth and stopping time."""
        return np.exp(self.emulator.predict_log(np.column_stack([p_m, np.full_like(p_m, speed)])))


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
        sizes.append(_Size(radius, drops, own, _emulate(own)))
    p_m = np.clip(calibration.samples, p_grid[0], p_grid[-1])
    rows, drop_rows, log_samples, diagonal = _predict_sizes(calibration, sizes, p_m)
    scan_run = None
    for scan in scans:
        own = [run for run, at in zip(runs, place, strict=True) if at == ("size", scan.projectile.tip_radius)]
        if not own:
            continue  # no drop of the scanned bead's size
        row, samples, sigma = _predict_scan(calibration, scan, own, p_m)
        scan_run = min(own, key=lambda run: _distance(run, scan, middle))
        rows.append(row)
        log_samples.append(samples)
        diagonal.append(sigma)
    scaling = _compare_sizes(
        calibration, sizes, [run for run, at in zip(runs, place, strict=True) if at[0] == "pair"], p_m
    )
    p_value = _p_value(rows, log_samples, diagonal)
    rows = _calibrated_rows(calibration) + rows
    conflict = _conflict(calibration)
    probability = _probability_wrong(p_value)
    warnings = [warning for run in runs for warning in run.warnings]
    return SummaryDiagnosis(
        calibration=calibration,
        predictions=tuple(rows),
        drop_predictions=tuple(drop_rows),
        scaling=scaling,
        exponents={size.radius: _exponent(calibration, size, p_m) for size in sizes if len(size.drops) > 1},
        conflict=conflict,
        p_value=p_value,
        probability_wrong=probability,
        verdict="unknown" if p_value < 0.05 else "none",
        sentence=_say(calibration, rows, scaling, conflict),
        runs={size.radius: tuple(size.runs) for size in sizes},
        scan_run=scan_run,
        runs_new=store.new - new,
        runs_reused=store.reused - reused,
        wall=time.perf_counter() - began,
        warnings=tuple(dict.fromkeys((*calibration.warnings, *warnings))),
    )


def _choose_p_m(calibration: SummaryCalibration) -> FloatArray:
    """Three values over the posterior, on a fixed grid."""
    low, high = np.log(np.quantile(calibration.samples, (0.01, 0.99)))
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


def _emulate(runs: Sequence[DropRun]) -> Emulator:
    inputs = np.array([[run.setting.material.p_m, run.setting.impact_speed] for run in runs])
    outputs = np.array([[run.penetration_depth, run.stopping_time] for run in runs])
    return fit_emulator(inputs, outputs, OUTPUTS, degree=2)


def _predict_sizes(
    calibration: SummaryCalibration, sizes: list[_Size], p_m: FloatArray
) -> tuple[list[Prediction], list[Prediction], list[FloatArray], list[float]]:
    """A row per size and kind (mean over its drops), a row per drop, ln samples and independent sigma per row."""
    rows, drop_rows, log_samples, diagonal = [], [], [], []
    numerical = calibration.numerical[calibration.bulk_modulus]
    for size in sizes:
        for column, kind in enumerate(OUTPUTS):
            ratio, observed_sigma = [], []
            for drop in size.drops:
                published = drop.published
                assert published is not None
                found = published.penetration_depth if kind == "depth" else published.stopping_time
                if found is None:
                    continue
                predicted = size.predict(p_m, impact_speed(drop, calibration.campaign))[:, column]
                if kind == "depth":
                    predicted = round_depth(1.0, calibration.depth_reading) * predicted
                own = math.hypot(numerical.relative(kind), size.emulator.sigma[column])
                drop_rows.append(
                    Prediction(
                        drop.name,
                        kind,
                        "m" if kind == "depth" else "s",
                        found.value,
                        found.sigma,
                        float(predicted.mean()),
                        float(math.hypot(predicted.std(), own * predicted.mean())),
                    )
                )
                ratio.append(np.log(predicted / found.value))
                observed_sigma.append(found.sigma / found.value)
            if not ratio:
                continue
            mean = np.mean(ratio, axis=0)  # ln predicted/observed, mean over the drops of this size
            own = math.hypot(numerical.relative(kind), size.emulator.sigma[column])
            sigma = float(
                np.mean(observed_sigma)
            )  # one published law: its error does not shrink with the drops
            value, unit, name = _published_value(size, kind)
            predicted_value = value * float(np.exp(mean.mean()))
            rows.append(
                Prediction(
                    name,
                    kind,
                    unit,
                    value,
                    sigma * value,
                    predicted_value,
                    math.hypot(mean.std(), own) * predicted_value,
                    note=f"mean of {len(ratio)} drops",
                )
            )
            log_samples.append(mean)
            diagonal.append(math.hypot(own, 0.0 if kind == "depth" else sigma))
    return rows, drop_rows, log_samples, diagonal


def _published_value(size: _Size, kind: str) -> tuple[float, str, str]:
    """A size's figure: the mean stopping time, or the mean coefficient of D = C m v/A."""
    diameter = f"{2e3 * size.radius:g} mm"
    values = []
    for drop in size.drops:
        published = drop.published
        assert published is not None
        if kind == "stopping_time" and published.stopping_time is not None:
            values.append(published.stopping_time.value)
        elif (
            kind == "depth" and published.penetration_depth is not None and published.impact_speed is not None
        ):
            area = math.pi * size.radius**2
            momentum = drop.projectile.mass * published.impact_speed.value / area
            values.append(published.penetration_depth.value / momentum)
    if kind == "depth":
        return float(np.mean(values)), "m² s/kg", f"D/(m v/A), {diameter}"
    return float(np.mean(values)), "s", f"T_s, {diameter}"


def _distance(run: DropRun, scan: PublishedScan, p_m: float) -> float:
    return abs(math.log(run.setting.impact_speed / scan.speed.value)) + abs(
        math.log(run.setting.material.p_m / p_m)
    )


def compacted_area(run: DropRun, low: float, high: float) -> float:
    """Area of dust between two filling factors under a planar run, in cross-sections of its cylinder."""
    return (run.compacted_volume(low) - run.compacted_volume(high)) / (
        math.pi * run.setting.projectile.tip_radius**2
    )


def _predict_scan(
    calibration: SummaryCalibration, scan: PublishedScan, runs: list[DropRun], p_m: FloatArray
) -> tuple[Prediction, FloatArray, float]:
    """Compacted area per cross-section stands for compacted volume per sphere volume; its speed is uncertain too."""
    inputs = np.array([[run.setting.material.p_m, run.setting.impact_speed] for run in runs])
    outputs = np.array(
        [[compacted_area(run, scan.filling_factor_low, scan.filling_factor_high)] for run in runs]
    )
    emulator = fit_emulator(inputs, np.maximum(outputs, 1e-3), ("area",), degree=2)
    low, high = inputs[:, 1].min(), inputs[:, 1].max()
    quantiles = (np.arange(p_m.size) * 0.6180339887498949) % 1.0  # an even spread of speeds over the samples
    speed = np.clip(
        norm.ppf(np.clip(quantiles, 1e-6, 1 - 1e-6), scan.speed.value, scan.speed.sigma), low, high
    )
    samples = emulator.predict_log(np.column_stack([p_m, speed]))[:, 0]
    value = float(np.exp(samples).mean())
    row = Prediction(
        f"volume at φ {scan.filling_factor_low:g}-{scan.filling_factor_high:g}",
        "compacted_volume",
        "sphere volumes",
        scan.sphere_volumes.value,
        scan.sphere_volumes.sigma,
        value,
        math.hypot(float(np.exp(samples).std()), float(emulator.sigma[0]) * value),
        note=f"{2e3 * scan.projectile.tip_radius:g} mm bead at {scan.speed.value:g} m/s",
    )
    observed = scan.sphere_volumes
    return (
        row,
        samples - math.log(observed.value),
        math.hypot(emulator.sigma[0], observed.sigma / observed.value),
    )


def _compare_sizes(
    calibration: SummaryCalibration, sizes: list[_Size], pair: list[DropRun], p_m: FloatArray
) -> SizeScaling | None:
    if len(pair) != 2:
        return None
    small, large = sorted(pair, key=lambda run: run.setting.projectile.tip_radius)
    numerical = calibration.numerical[calibration.bulk_modulus].relative("stopping_time")
    ratio = large.stopping_time / small.stopping_time

    def over_drops(size: _Size) -> FloatArray:
        speeds = [impact_speed(drop, calibration.campaign) for drop in size.drops]
        return np.mean([np.log(size.predict(p_m, speed)[:, 1]) for speed in speeds], axis=0)

    def observed(size: _Size) -> tuple[float, float]:
        times = [
            drop.published.stopping_time
            for drop in size.drops
            if drop.published and drop.published.stopping_time
        ]
        return float(np.mean([t.value for t in times])), float(np.mean([t.sigma for t in times]))

    by_radius = {size.radius: size for size in sizes}
    a, b = by_radius[min(by_radius)], by_radius[max(by_radius)]
    momentum = np.exp(over_drops(b) - over_drops(a))
    (t_a, s_a), (t_b, s_b) = observed(a), observed(b)
    emulated = math.hypot(a.emulator.sigma[1], b.emulator.sigma[1])
    return SizeScaling(
        small=a.radius,
        large=b.radius,
        speed=small.setting.impact_speed,
        ratio_equal_speed=ratio,
        # the two runs have the same number of particles across the projectile: the numerical error is shared, at most
        ratio_equal_speed_sigma=numerical * ratio,
        ratio_equal_momentum=float(momentum.mean()),
        ratio_equal_momentum_sigma=float(math.hypot(momentum.std(), emulated * momentum.mean())),
        observed=t_b / t_a,
        observed_sigma=t_b / t_a * math.hypot(s_a / t_a, s_b / t_b),
    )


def _exponent(calibration: SummaryCalibration, size: _Size, p_m: FloatArray) -> tuple[float, float]:
    """n of D ∝ (m v/A)^n over the speeds of one size's drops, between the slowest and the fastest."""
    speeds = [impact_speed(drop, calibration.campaign) for drop in size.drops]
    low, high = min(speeds), max(speeds)
    n = np.log(size.predict(p_m, high)[:, 0] / size.predict(p_m, low)[:, 0]) / math.log(high / low)
    emulated = math.sqrt(2.0) * float(size.emulator.sigma[0]) / math.log(high / low)
    return float(n.mean()), math.hypot(float(n.std()), emulated)


def _calibrated_rows(calibration: SummaryCalibration) -> list[Prediction]:
    """Both figures of the calibration drops: those used, and those left for a test."""
    rows = []
    used = {(figure.drop, figure.kind) for figure in calibration.figures}
    numerical = calibration.numerical[calibration.bulk_modulus]
    for drop in calibration.campaign.drops:
        place = (drop.name, calibration.bulk_modulus)
        if place not in calibration.emulators or drop.published is None:
            continue
        emulator = calibration.emulators[place]
        outputs = emulator.predict(calibration.samples[:, None])
        for column, kind in enumerate(OUTPUTS):
            found = drop.published.penetration_depth if kind == "depth" else drop.published.stopping_time
            if found is None:
                continue
            values = outputs[:, column]
            if kind == "depth":
                values = values * round_depth(1.0, calibration.depth_reading)
            own = math.hypot(numerical.relative(kind), emulator.sigma[column]) * values.mean()
            rows.append(
                Prediction(
                    f"{'D' if kind == 'depth' else 'T_s'} of {drop.name}",
                    kind,
                    "m" if kind == "depth" else "s",
                    found.value,
                    found.sigma,
                    float(values.mean()),
                    math.hypot(float(values.std()), own),
                    used=(drop.name, kind) in used,
                )
            )
    return rows


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


def _p_value(rows: Sequence[Prediction], log_samples: list[FloatArray], diagonal: list[float]) -> float:
    """χ² of all predictions together; p_m correlates them, and the sizes share part of a published law's error."""
    if not rows:
        return 1.0
    residual = np.array([samples.mean() for samples in log_samples])
    covariance = np.atleast_2d(np.cov(np.array(log_samples))) + np.diag(np.square(diagonal))
    law = np.array([r.observed_sigma / r.observed if r.kind == "depth" else 0.0 for r in rows])
    covariance += LAW_SHARED * np.outer(law, law) + (1.0 - LAW_SHARED) * np.diag(law**2)
    return float(chi2.sf(residual @ np.linalg.solve(covariance, residual), len(rows)))


def _probability_wrong(p_value: float) -> float:
    """Upper bound of the probability that something is wrong, from even odds (Sellke, Bayarri & Berger 2001)."""
    if p_value >= 1.0 / math.e:
        return 0.5
    bound = -math.e * max(p_value, 1e-300) * math.log(max(p_value, 1e-300))
    return 1.0 / (1.0 + bound)


def _say(
    calibration: SummaryCalibration,
    rows: Sequence[Prediction],
    scaling: SizeScaling | None,
    conflict: tuple[Reading, Reading, float] | None,
) -> str:
    """The one sentence, made of the numbers."""
    used = " and ".join(dict.fromkeys(kind.replace("_", " ") for kind in calibration.use))
    q = calibration.quantiles
    open_rows = [row for row in rows if not row.used]
    missed = sorted((row for row in open_rows if row.missed), key=lambda row: -abs(row.deviation))
    kept = [row for row in open_rows if not row.missed]
    begin = (
        f"Calibrated on the {used} of {', '.join(dict.fromkeys(f.drop for f in calibration.figures))} "
        f"(p_m = {q['q50'] / 1e3:.2f} kPa, 90 % between {q['q05'] / 1e3:.2f} and {q['q95'] / 1e3:.2f}), the simulation "
    )
    if missed:
        begin += "misses " + "; ".join(describe(row) for row in missed)
    else:
        begin += "misses none of the other figures"
    if kept:
        begin += "; it keeps " + " and ".join(
            f"the {row.name}" if row.kind == "compacted_volume" else row.name for row in kept
        )
    parts = [begin]
    if scaling is not None:
        away = (scaling.ratio_equal_speed - scaling.observed) / math.hypot(
            scaling.ratio_equal_speed_sigma, scaling.observed_sigma
        )
        parts.append(
            f"from {2e3 * scaling.small:g} to {2e3 * scaling.large:g} mm at equal speed its stopping time grows "
            f"{scaling.ratio_equal_speed:.2f} times (T_s ∝ R^{scaling.exponent:.2f}: it has no length of its own), "
            f"at equal m v/A {scaling.ratio_equal_momentum:.2f} times, where {scaling.observed:.2f} ± "
            f"{scaling.observed_sigma:.2f} was measured ({abs(away):.0f} σ at equal speed)"
            if abs(scaling.exponent - 1.0) < 0.02
            else f"from {2e3 * scaling.small:g} to {2e3 * scaling.large:g} mm at equal speed its stopping time grows "
            f"{scaling.ratio_equal_speed:.2f} times, at equal m v/A {scaling.ratio_equal_momentum:.2f} times, where "
            f"{scaling.observed:.2f} ± {scaling.observed_sigma:.2f} was measured"
        )
    if conflict is not None:
        depth, stop, sigma = conflict
        relation = "exclude each other" if not _overlap(depth, stop) else "overlap"
        parts.append(
            f"the depth asks for p_m = {depth.q50 / 1e3:.2f} kPa and the stopping time for {stop.q50 / 1e3:.2f} kPa: "
            f"their 90 % intervals {relation} ({abs(sigma):.1f} σ)"
        )
    return "; ".join(parts) + "."


def _overlap(a: Reading, b: Reading) -> bool:
    return a.q05 <= b.q95 and b.q05 <= a.q95


def describe(row: Prediction) -> str:
    """``T_s, 1 mm: 2.31 ± 0.10 against 3.00 ± 0.10 ms (-4.9 σ)``."""
    factor, unit, digits = people(row)
    return (
        f"{row.name}: {row.predicted * factor:.{digits}f} ± {row.predicted_sigma * factor:.{digits}f} against "
        f"{row.observed * factor:.{digits}f} ± {row.observed_sigma * factor:.{digits}f}"
        f"{' ' + unit if unit else ''} ({row.deviation:+.1f} σ)"
    )


def people(row: Prediction) -> tuple[float, str, int]:
    """Factor, unit and digits in which people see a figure."""
    return {
        "m": (1e3, "mm", 3),
        "s": (1e3, "ms", 2),
        "m² s/kg": (1e4, "1e-4 m² s/kg", 2),
        "sphere volumes": (1.0, "sphere volumes", 2),
    }.get(row.unit, (1.0, row.unit, 2))
