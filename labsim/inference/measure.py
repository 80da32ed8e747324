"""Everything a campaign's files say, reduced once: tracks with their errors, maps, undisturbed dust."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..ct.reduce import ReducedScan, reduce_scan
from ..errors import MeasurementError
from ..records import Campaign
from .observations.observe import Observed, observe_drops
from .observations.undisturbed import UndisturbedDust, observe_undisturbed


@dataclass
class Measurements:
    """drops to be compared; reduced scans; dust : their undisturbed part; warnings : what had to be left out."""

    drops: list[Observed]
    reduced: list[ReducedScan] = field(default_factory=list)
    dust: list[UndisturbedDust] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def measure(campaign: Campaign, *, workers: int | None = 1) -> Measurements:
    """Read tracks, track videos, reduce scans. A drop or scan that shows nothing is left out with a warning.

    workers : processes for tracks and videos; None for one a core.
    Raises MeasurementError where no drop is left, InferenceError where a worker dies.
    """
    drops, warnings = observe_drops(campaign, workers=workers)
    seen = Measurements(drops, warnings=warnings)
    for scan in campaign.scans:
        try:
            reduced = reduce_scan(scan, sample_filling_factor=campaign.sample.filling_factor)
        except MeasurementError as error:
            seen.warnings.append(f"scan {scan.name} left out: {error}")
            continue
        seen.reduced.append(reduced)
        dust = observe_undisturbed(reduced)
        if dust is None:
            seen.warnings.append(f"scan {scan.name}: too little dust beyond the reach of the bead")
        else:
            seen.dust.append(dust)
    return seen
