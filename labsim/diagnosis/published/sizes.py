"""Predictions of published drops, size by size: each size's depth law and stopping time, and how they grow with the size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...inference.published.calibrate import SummaryCalibration
from ...inference.published.emulator import Emulator, fit_emulator
from ...inference.published.figures import FIGURE_KINDS, impact_speed, published_figure
from ...inference.published.planar import round_depth
from ...records import Drop, FloatArray
from ...sph import DropRun
from .prediction import Prediction


@dataclass(frozen=True)
class Size:
    """The drops of one radius, their runs, and what stands between the runs."""

    radius: float
    drops: list[Drop]
    runs: list[DropRun]
    emulator: Emulator  # (p_m, speed) -> depth, stopping time

    def predict(self, p_m: FloatArray, speed: float) -> FloatArray:
        """(n, 2) raw depth and stopping time."""
        return np.exp(self.emulator.predict_log(np.column_stack([p_m, np.full_like(p_m, speed)])))


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


def emulate_runs(runs: Sequence[DropRun]) -> Emulator:
    inputs = np.array([[run.setting.material.p_m, run.setting.impact_speed] for run in runs])
    outputs = np.array([[run.penetration_depth, run.stopping_time] for run in runs])
    return fit_emulator(inputs, outputs, FIGURE_KINDS, degree=2)


def predict_sizes(
    calibration: SummaryCalibration, sizes: list[Size], p_m: FloatArray
) -> tuple[list[Prediction], list[Prediction], list[FloatArray], list[float]]:
    """A row per size and kind (mean over its drops), a row per drop, ln samples and independent sigma per row."""
    rows, drop_rows, log_samples, diagonal = [], [], [], []
    numerical = calibration.numerical[calibration.bulk_modulus]
    for size in sizes:
        for column, kind in enumerate(FIGURE_KINDS):
            ratio, observed_sigma = [], []
            for drop in size.drops:
                if (found := published_figure(drop, kind)) is None:
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


def _published_value(size: Size, kind: str) -> tuple[float, str, str]:
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


def compare_sizes(
    calibration: SummaryCalibration, sizes: list[Size], pair: list[DropRun], p_m: FloatArray
) -> SizeScaling | None:
    if len(pair) != 2:
        return None
    small, large = sorted(pair, key=lambda run: run.setting.projectile.tip_radius)
    numerical = calibration.numerical[calibration.bulk_modulus].relative("stopping_time")
    ratio = large.stopping_time / small.stopping_time

    def over_drops(size: Size) -> FloatArray:
        speeds = [impact_speed(drop, calibration.campaign) for drop in size.drops]
        return np.mean([np.log(size.predict(p_m, speed)[:, 1]) for speed in speeds], axis=0)

    def observed(size: Size) -> tuple[float, float]:
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


def find_exponent(calibration: SummaryCalibration, size: Size, p_m: FloatArray) -> tuple[float, float]:
    """n of D ∝ (m v/A)^n over the speeds of one size's drops, between the slowest and the fastest."""
    speeds = [impact_speed(drop, calibration.campaign) for drop in size.drops]
    low, high = min(speeds), max(speeds)
    n = np.log(size.predict(p_m, high)[:, 0] / size.predict(p_m, low)[:, 0]) / math.log(high / low)
    emulated = math.sqrt(2.0) * float(size.emulator.sigma[0]) / math.log(high / low)
    return float(n.mean()), math.hypot(float(n.std()), emulated)


def predict_calibrated(calibration: SummaryCalibration) -> list[Prediction]:
    """Both figures of the calibration drops: those used, and those left for a test."""
    rows = []
    used = {(figure.drop, figure.kind) for figure in calibration.figures}
    numerical = calibration.numerical[calibration.bulk_modulus]
    for drop in calibration.campaign.drops:
        place = (drop.name, calibration.bulk_modulus)
        if place not in calibration.emulators or drop.published is None:
            continue
        emulator = calibration.emulators[place]
        outputs = emulator.predict(calibration.posterior.calibrated[:, None])
        for column, kind in enumerate(FIGURE_KINDS):
            if (found := published_figure(drop, kind)) is None:
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
