"""Runs on a fixed grid of impact speeds and p_m, shared by every campaign with the same projectiles and dust.

Drops differ in speed by a continuum, runs need not: codes of runs (curves.py) are smooth in ln v and ln p_m, so the nodes
are fixed numbers (SPEED_RATIO, STRENGTH_RATIO apart) and a second campaign with the same projectiles finds them stored.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..records import Campaign, FloatArray, Projectile
from ..sph import DropRun, DropSetting
from .runs import FailedRun, Progress, RunStore

SPEED_ANCHOR, SPEED_RATIO = 0.1, 1.7  # m/s
STRENGTH_ANCHOR, STRENGTH_RATIO = 1000.0, 2.0  # Pa
FEWEST_SPEEDS = 3
DEFAULT_CELLS = 5  # spacings in a tip radius; docs/numerics.md: 0.43 % of the depth left at that
SCAN_CELLS = 8  # of scans: the map needs more than the depth does

Change = Callable[[DropSetting], DropSetting]


@dataclass(frozen=True)
class Family:
    """Drops (or scans) with one projectile, and the speeds they are simulated at. speeds : (k,) m/s, rising."""

    projectile: Projectile
    speeds: tuple[float, ...]
    is_scan: bool


def speed_nodes(slowest: float, fastest: float) -> tuple[float, ...]:
    """Nodes of the fixed grid that enclose [slowest, fastest], at least FEWEST_SPEEDS of them."""
    first = math.floor(math.log(slowest / SPEED_ANCHOR) / math.log(SPEED_RATIO) + 1e-9)
    last = math.ceil(math.log(fastest / SPEED_ANCHOR) / math.log(SPEED_RATIO) - 1e-9)
    while last - first + 1 < FEWEST_SPEEDS:
        middle = math.log(math.sqrt(slowest * fastest) / SPEED_ANCHOR) / math.log(SPEED_RATIO)
        if middle - first < last - middle:
            first -= 1
        else:
            last += 1
    return tuple(SPEED_ANCHOR * SPEED_RATIO**k for k in range(first, last + 1))


def strength_node(index: int) -> float:
    return STRENGTH_ANCHOR * STRENGTH_RATIO**index


def interpolation_weights(nodes: FloatArray, at: float) -> FloatArray:
    """Lagrange weights (k,) of the polynomial through all nodes."""
    weights = np.ones(len(nodes))
    for k, node in enumerate(nodes):
        others = np.delete(nodes, k)
        weights[k] = np.prod((at - others) / (node - others))
    return weights


@dataclass
class RunGrid:
    """Access to runs by (variant, family, speed, p_m node); a variant is a named change of the setting."""

    campaign: Campaign
    store: RunStore
    families: Sequence[Family]
    cells: int = DEFAULT_CELLS
    workers: int | None = None
    scheduler: str | None = None
    progress: Progress | None = None
    runs: dict[tuple[str, int, int], list[DropRun | FailedRun]] = field(default_factory=dict)

    def setting(self, family: Family, speed: float, p_m: float) -> DropSetting:
        """The nominal model of the campaign for one node."""
        campaign, radius = self.campaign, family.projectile.tip_radius
        return DropSetting(
            projectile=family.projectile,
            impact_speed=speed,
            material=campaign.material.replace(p_m=p_m),
            filling_factor=campaign.sample.filling_factor,
            monomer_density=campaign.sample.monomer_density,
            gravity=campaign.gravity,
            geometry=campaign.geometry,
            spacing=radius / (SCAN_CELLS if family.is_scan else self.cells),
            after_stop=0.16,
        )

    def require(self, wanted: Sequence[tuple[str, Change | None, int]], text: str) -> None:
        """Make sure the runs of (variant, change, p_m index) are there for every family and speed."""
        missing = [
            (name, change, index, number)
            for name, change, index in dict.fromkeys(wanted)
            for number in range(len(self.families))
            if (name, index, number) not in self.runs
        ]
        settings, places = [], []
        for name, change, index, number in missing:
            family = self.families[number]
            for speed in family.speeds:
                setting = self.setting(family, speed, strength_node(index))
                settings.append(change(setting) if change is not None else setting)
            places.append((name, index, number, len(family.speeds)))
        if not settings:
            return
        runs = self.store.get_many(
            settings, workers=self.workers, scheduler=self.scheduler, progress=self.progress, text=text
        )
        at = 0
        for name, index, number, count in places:
            self.runs[name, index, number] = runs[at : at + count]
            at += count

    def stopped_runs(self, variant: str, index: int, number: int) -> list[DropRun] | None:
        """Runs of one family, in the order of its speeds, or None where one failed or never stopped."""
        runs = self.runs[variant, index, number]
        good = [run for run in runs if isinstance(run, DropRun) and run.stopped]
        return good if len(good) == len(runs) else None
