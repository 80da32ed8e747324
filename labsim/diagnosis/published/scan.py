"""Prediction of a published compaction figure: dust between two filling factors under a bead."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import norm

from ...inference.published.emulator import fit_emulator
from ...records import FloatArray, PublishedScan
from ...sph import DropRun
from .prediction import Prediction


def compacted_area(run: DropRun, low: float, high: float) -> float:
    """Area of dust between two filling factors under a planar run, in cross-sections of its cylinder."""
    return (run.compacted_volume(low) - run.compacted_volume(high)) / (
        math.pi * run.setting.projectile.tip_radius**2
    )


def predict_scan(
    scan: PublishedScan, runs: list[DropRun], p_m: FloatArray
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


def find_distance(run: DropRun, scan: PublishedScan, p_m: float) -> float:
    """How far a run is from a scan, in ln speed and ln p_m."""
    return abs(math.log(run.setting.impact_speed / scan.speed.value)) + abs(
        math.log(run.setting.material.p_m / p_m)
    )
