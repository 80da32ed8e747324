"""Grey levels and what they mean: scan.toml's calibration, and what the scan itself says about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import MeasurementError
from ...records import FloatArray, Scan
from ..bead import Bead
from ..surface import Surface
from .stack import SliceStack


@dataclass(frozen=True)
class GreyCheck:
    """The calibration that was used and what the scan itself says about it.

    grey_air_stated, grey_air : levels; filling_factor_air : of the measured air, should be 0;
    scale_air_dust : factor on the filling factor if air and undisturbed dust (of the stated sample) were the two points,
    NaN where no sample was given; clipped, saturated : shares of dust and air voxels at the ends of the range.
    """

    grey_air_stated: float
    grey_air: float
    filling_factor_air: float
    scale_air_dust: float
    clipped: float
    saturated: float


def to_filling_factor(grey: FloatArray, scan: Scan) -> FloatArray:
    """Filling factor of grey levels by scan.toml's calibration, the same shape."""
    c = scan.calibration
    return (grey - c.grey_air) / (c.grey_per_density * c.density_solid)


def check_levels(stack: SliceStack, scan: Scan) -> None:
    """Hold the stated bit depth against the files. Raises MeasurementError."""
    top = 2**scan.bits - 1
    if stack.dtype.kind in "ui" and scan.bits > 8 * stack.dtype.itemsize:
        raise MeasurementError(
            scan.slices,
            "scan.bits",
            f"is {scan.bits} but the slices have {8 * stack.dtype.itemsize}; correct scan.toml",
        )
    brightest = max(float(stack.slice(k).max()) for k in range(0, stack.count, max(1, stack.count // 40)))
    if stack.dtype.kind in "ui" and brightest > top:
        raise MeasurementError(
            scan.slices,
            "scan.bits",
            f"is {scan.bits} but a slice holds grey level {brightest:.0f}; correct scan.toml",
        )
    if scan.calibration.grey_per_density <= 0:
        raise MeasurementError(
            scan.slices, "calibration.grey_per_density", "must be positive: denser is brighter"
        )


def check_grey(
    stack: SliceStack, scan: Scan, surface: Surface, hidden: Callable, level: float, sample: float | None
) -> GreyCheck:
    """Air and undisturbed dust against the calibration. hidden : mask of what is the bead's in a slice; level : filling
    factor of the undisturbed dust, sample : as stated."""
    top = 2**scan.bits - 1
    at_zero = at_top = seen = air_zero = air_seen = 0
    for k in range(0, stack.count, max(1, stack.count // 60)):
        image, mask = stack.slice(k), hidden(k, (0.0, 0.0))
        free = image if mask is None else image[~mask]
        at_zero, at_top, seen = at_zero + (free == 0).sum(), at_top + (free >= top).sum(), seen + free.size
        if k < surface.row - 5:
            air_zero, air_seen = air_zero + (free == 0).sum(), air_seen + free.size
    solid = scan.calibration.grey_per_density * scan.calibration.density_solid
    return GreyCheck(
        scan.calibration.grey_air,
        surface.air,
        (surface.air - scan.calibration.grey_air) / solid,
        float("nan")
        if sample is None
        else sample / (level * (1 - (surface.air - scan.calibration.grey_air) / solid / level)),
        max(at_zero / seen, air_zero / max(air_seen, 1)),
        at_top / seen,
    )


def warn_of_grey(grey: GreyCheck, surface: Surface, bead: Bead, scan: Scan, level: float) -> list[str]:
    """What the user should know of the grey levels before trusting the map."""
    warnings = []
    if grey.clipped > 0.01:
        warnings.append(
            f"{grey.clipped:.1%} of the air or dust voxels sit at grey 0: air is clipped, its mean reads high"
        )
    if grey.saturated > 0.001:
        warnings.append(f"{grey.saturated:.2%} of the voxels outside the bead sit at the top of the range")
    if bead.saturated:
        warnings.append(
            "the bead is saturated: its density cannot be read, so its mass_mg is not checked from above; "
            "a wider window of grey levels at export would show it"
        )
    if abs(grey.filling_factor_air) > 0.003:
        warnings.append(
            f"air reads a filling factor of {grey.filling_factor_air:+.4f}; "
            f"grey_air is {grey.grey_air_stated:g}, measured {grey.grey_air:.2f}"
        )
    if np.isfinite(grey.scale_air_dust) and abs(grey.scale_air_dust - 1) > 0.03:
        warnings.append(
            f"undisturbed dust reads {level:.4f}; air and the stated sample would scale it by {grey.scale_air_dust:.3f}"
        )
    if scan.bits == 8 and surface.dust_scatter < 0.5:
        warnings.append("8-bit slices with less noise than half a grey level: filling factors come in steps")
    return warnings
