"""What ``labsim check`` sees beyond the form of the files: what the data themselves say, and what they contradict.

Every track is fitted, every video is decoded, every scan is reduced; nothing is simulated. ``inspect_campaign`` gives what
is there, what cannot be read, what looks odd and what is missing; the questions are asked in one file each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..ct.reduce import reduce_scan
from ..errors import LabsimError
from ..records import Campaign, Scan
from .drops import inspect_drop
from .found import ODD, Found
from .resistance import judge_resistance
from .scales import judge_scales
from .strength import inspect_strength_test

GREY_SHARE = 0.005  # relative, of a filling factor whose grey calibration has no stated error

Progress = Callable[[float, float, str], None]


@dataclass(frozen=True)
class Inspection:
    """drops, scans, tests (of strength) : one Found each; odd, missing : lines of the campaign as a whole."""

    drops: list[Found]
    scans: list[Found]
    tests: list[Found]
    odd: list[str]
    missing: list[str]

    @property
    def parts(self) -> list[Found]:
        """All that was measured."""
        return [*self.drops, *self.scans, *self.tests]

    @property
    def troubles(self) -> dict[str, LabsimError]:
        """Why a drop or scan cannot be read, by its name."""
        return {found.name: found.trouble for found in self.parts if found.trouble is not None}

    @property
    def all_odd(self) -> list[str]:
        """What looks odd, of the campaign first, then of each drop and scan with its name."""
        return self.odd + [f"{found.name}: {text}" for found in self.parts for text in found.odd]


def inspect_campaign(campaign: Campaign, progress: Progress) -> Inspection:
    """Read and judge everything in a campaign; what cannot be read does not stop the rest."""
    total = len(campaign.drops) + len(campaign.scans)
    drops, scans = [], []
    for drop in campaign.drops:
        drops.append(inspect_drop(drop, campaign))
        progress(len(drops), total, "reading drops and scans")
    for scan in campaign.scans:
        scans.append(inspect_scan(scan, campaign))
        progress(len(drops) + len(scans), total, "reading drops and scans")
    judge_resistance(campaign, drops)
    tests = [inspect_strength_test(test, campaign) for test in campaign.strength_tests]
    return Inspection(drops, scans, tests, judge_scales(drops), list_missing(campaign))


def inspect_scan(scan: Scan, campaign: Campaign) -> Found:
    stated = campaign.sample
    try:
        reduced = reduce_scan(scan, sample_filling_factor=stated.filling_factor)
    except LabsimError as trouble:
        return Found(scan.name, "no map can be made", trouble=trouble)
    phi = reduced.undisturbed
    found = Found(
        scan.name,
        f"{2e3 * scan.projectile.tip_radius:.3g} mm bead, tip {reduced.map.tip_depth * 1e3:.3f} mm deep, undisturbed dust of "
        f"filling factor {phi.value:.5f} ± {phi.sigma:.5f}",
        {"filling_factor_undisturbed": phi.value, "tip_depth_m": reduced.map.tip_depth},
        list(reduced.map.warnings),
    )
    sigma = math.hypot(phi.sigma, stated.filling_factor_sigma, GREY_SHARE * stated.filling_factor)
    if abs(phi.value - stated.filling_factor) > ODD * sigma:
        found.odd.append(
            f"the undisturbed dust has filling factor {phi.value:.4f}, but campaign.toml states {stated.filling_factor:g} ± "
            f"{stated.filling_factor_sigma:g}; check the grey calibration or sample.filling_factor"
        )
    return found


def list_missing(campaign: Campaign) -> list[str]:
    """One line for each thing that is missing."""
    lines = []
    tracked = [drop for drop in campaign.drops if drop.record.kind != "summary"]
    dropped = [drop for drop in tracked if drop.gauge is None]
    if dropped and not campaign.scans:
        lines.append(
            "no CT scan: nothing is seen of the dust itself; scale of the CT, crust and gradient cannot be told"
        )
    if dropped and len({round(drop.projectile.tip_radius, 7) for drop in tracked}) == 1:
        lines.append("one tip radius only: causes that depend on size look like others")
    heights = [drop.height.value for drop in tracked if drop.height is not None]
    if heights and max(heights) < 4 * min(heights):
        lines.append("speeds within a factor of two: causes that depend on speed look like others")
    if 0 < len(tracked) < 4:
        lines.append(
            f"{len(tracked)} tracked drop{'s' * (len(tracked) > 1)}: p_m can be found, the scatter of samples and causes hardly"
        )
    blank = [drop.name for drop in dropped if drop.projectile.mass_sigma == 0]
    if blank:
        lines.append(f"mass_sigma_mg is 0 or not given in {shorten(blank)}: the mass is taken as exact")
    if campaign.sample.filling_factor_sigma == 0:
        lines.append("sample.filling_factor_sigma is 0: the filling factor is taken as exact")
    return lines


def shorten(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
