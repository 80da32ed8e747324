"""What is shown of every scan: the map measured, the map simulated, their difference."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...ct.reduce import reduce_scan
from ...errors import MeasurementError
from ...inference.fits.fitting import Fit
from ...inference.observations.compacted_zone import CompactedZones
from ...inference.problem import Problem
from ...records import Campaign, FillingMap, FloatArray


@dataclass(frozen=True)
class MapView:
    """One scan. measured : (nz, nr) filling factor; simulated : name of the fit -> (nz, nr), NaN where it is not compared."""

    name: str
    map: FillingMap
    undisturbed: float
    simulated: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def measured(self) -> FloatArray:
        return self.map.filling_factor

    def left(self, fit: str) -> FloatArray:
        """Measured minus simulated, (nz, nr)."""
        return self.measured - self.simulated[fit]

    def rms(self, fit: str) -> float:
        return float(np.sqrt(np.nanmean(self.left(fit) ** 2)))


def view_maps(problem: Problem, fits: Sequence[tuple[str, Fit]]) -> list[MapView]:
    """Every scan of the likelihood; simulated dust is seen through the scan's own cells, blur and grey level."""
    found = problem.find(CompactedZones)
    if found is None:
        return []
    number, zones = found
    views = []
    for place, scan in enumerate(zones.zones):
        observed = scan.observed
        simulated = {}
        for name, fit in fits:
            features = scan.table.features(fit.log_p_m, float(fit.nuisances[number][place]), fit.values)
            scale = problem.instruments(fit.values)[observed.name].ct_scale
            full = np.full(observed.cells.shape, np.nan)
            full[observed.cells] = scale * features[1:]
            simulated[name] = full
        views.append(MapView(observed.name, observed.map, observed.undisturbed, simulated))
    return views


def measure_maps(campaign: Campaign, known: Sequence[MapView]) -> list[MapView]:
    """Maps of the scans that the likelihood did not take up, measured alone; a scan that cannot be reduced is left out."""
    names = {view.name for view in known}
    views = list(known)
    for scan in campaign.scans:
        if scan.name not in names:
            with contextlib.suppress(MeasurementError):  # the diagnosis has warned of it
                reduced = reduce_scan(scan, sample_filling_factor=campaign.sample.filling_factor)
                views.append(MapView(scan.name, reduced.map, float(reduced.undisturbed.value)))
    return views
