"""Depth and stopping time for a spacing of zero, from runs at several spacings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InferenceError
from ..records import Measured
from ..sph import DropRun, DropSetting

RATIO = 2.0**0.5  # between neighbouring spacings: a third run costs as much as eight of the first


def refine(setting: DropSetting, count: int) -> list[DropSetting]:
    """The setting at ``count`` spacings, each √2 finer than the one before, coarsest first."""
    if count < 2:
        raise InferenceError("", "--spacings", f"{count} spacing cannot be extrapolated; use 2 or more")
    return [setting.replace(spacing=setting.spacing / RATIO**i) for i in range(count)]


def extrapolate(runs: Sequence[DropRun], name: str) -> Measured:
    """Value at zero spacing by a straight line in the spacing, for ``name`` a number of DropRun.

    sigma is the distance from the finest run to that value, and with three runs or more at least the scatter about
    the line: the order of convergence is not proved, so no more is claimed.
    """
    spacing = np.array([run.setting.spacing for run in runs])
    value = np.array([getattr(run, name) for run in runs])
    slope, at_zero = np.polyfit(spacing, value, 1)
    scatter = np.sqrt(np.sum((value - at_zero - slope * spacing) ** 2) / max(len(runs) - 2, 1))
    return Measured(float(at_zero), float(max(abs(value[np.argmin(spacing)] - at_zero), scatter)))
