"""What ``labsim check`` sees beyond the form of the files: what the data themselves say, and what they contradict.

Every track is fitted, every video is decoded, every scan is reduced; nothing is simulated. ``inspect_campaign`` gives what
is there, what cannot be read, what looks odd and what is missing; the questions are asked in one file each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..errors import LabsimError
from ..records import Campaign
from .drops import inspect_drop
from .found import Found
from .missing import list_missing
from .resistance import judge_resistance
from .scales import judge_scales
from .scans import inspect_scan
from .strength import inspect_strength_test

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
