"""CT scans that nobody has made yet: what each hypothesis predicts of the dust about the tip, and of that beside it.

A planned scan is one more scan in the likelihood, without data (planned_drops.py). Where a campaign has scans, it is one of them
made again, which costs no run; else the usual projectile is scanned at its middle speed, by a scanner such as a laboratory has.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.linalg import block_diag

from ..inference.emulation.forward import ResponseTable
from ..inference.emulation.grid import ProjectileGroup, own_speeds
from ..inference.fits.fitting import Fit, require_runs
from ..inference.fits.tangents import linearise_at
from ..inference.observations import Observation, RunFeatures
from ..inference.observations.compacted_zone import CompactedZone, CompactedZones, ObservedScan, extract_map
from ..inference.observations.undisturbed import Layering, UndisturbedDust
from ..inference.problem import Problem
from ..inference.supported import compares_scans
from ..records import FillingMap, FloatArray, GreyCalibration, Measured, Projectile, Scan
from .planned_drops import Prediction, find_usual, name_tip, predict_rows

# of a scanner where the campaign has none, as those that it has scans of (data/README.md): voxels in a tip radius, standard
# deviation of the filling factor in a cell of two voxels, relative uncertainty of the speed
USUAL_VOXELS, USUAL_NOISE, USUAL_SPEED = 12.0, 5e-4, 0.03
GUARD = 3.0  # voxels about the tip that are not compared
WIDTH, BELOW, ABOVE = (
    3.0,
    2.0,
    0.3,
)  # tip radii of the map: from the axis, below the tip, above its lowest point
# whose mean filling factor is told, in tip radii: below the lowest point of the tip and from the axis, from where to where
REGIONS = {
    "under the tip": ((0.0, 0.5), (0.0, 0.5)),
    "a radius deeper": ((0.75, 1.25), (0.0, 0.5)),
    "beside the tip": ((-0.3, 0.3), (1.2, 1.8)),
}
UNREACHED = "in dust that was not reached"


@dataclass(frozen=True)
class ScanPrediction(Prediction):
    """Of one scan: its cells, the tip's depth (m) and the undisturbed dust beside it. levels : mean filling factor of the REGIONS
    and of the undisturbed dust, each with its standard deviation."""

    levels: Mapping[str, tuple[float, float]]

    @property
    def text(self) -> str:
        said = ", ".join(
            f"{level:.4f} ± {sigma:.4f} {place}" for place, (level, sigma) in self.levels.items()
        )
        return f"filling factor {said}"

    def summarise(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for place, (level, sigma) in self.levels.items():
            name = f"filling_factor_{place.replace(' ', '_')}"
            found |= {name: level, f"{name}_sd": sigma}
        return found


def plan_scans(
    problem: Problem, standing: Sequence[Fit], *, new: bool
) -> tuple[Problem, list[tuple[str, str]]]:
    """The problem with nothing but its scans and further ones, and what each of those would be, in words, and how fast.

    standing : hypotheses, the first of which says how deep the tip is. new : where there are no scans, plan one, which needs
    runs. Nothing of ``problem`` is changed.
    """
    fit = standing[0]
    zones: list[CompactedZone] = copy.deepcopy(problem.scans)
    dust, groups = list(problem.undisturbed), list(problem.groups)
    measured = len(zones)
    of_dust = {each.name: each for each in dust}
    for zone in zones[:measured]:
        again = replace(zone.observed.scan, name=f"planned {zone.name}")
        zones.append(replace(zone, observed=replace(zone.observed, scan=again)))
        if zone.name in of_dust:
            dust.append(replace(of_dust[zone.name], scan=again))
    usual = find_usual(problem)
    if new and not zones and usual is not None and compares_scans(problem.campaign):
        speed = usual.speeds[len(usual.speeds) // 2]
        drops = next(each.table for each in problem.tracks.features if groups[each.group] is usual)
        depth = math.exp(drops.features(fit.log_p_m, math.log(speed), fit.values)[0])
        observed, beside = _plan_map(problem, usual.projectile, speed, depth)
        nodes = own_speeds([speed])
        sparse = tuple(range(len(nodes)))
        features = RunFeatures(
            len(groups), ResponseTable(np.log(nodes), sparse), partial(extract_map, observed=observed)
        )
        zones.append(CompactedZone(observed, features))
        dust.append(beside)
        groups.append(ProjectileGroup(usual.projectile, nodes, True, sparse))
    scans = [zone.observed.scan for zone in zones[measured:]]
    places = dict(problem.places)
    for scan in scans:
        like = places.get(scan.name.removeprefix("planned "), next(iter(places.values())))
        places[scan.name] = replace(
            like, name=scan.name, sequence_fraction=0.0, is_scan=True, tip=scan.projectile.tip
        )
    observations: list[Observation] = []
    if zones:
        observations.append(CompactedZones(tuple(zones)))
    if dust:
        observations.append(Layering(tuple(dust), problem.campaign.sample.filling_factor_sigma))
    campaign = replace(problem.campaign, scans=(*problem.campaign.scans, *scans))
    extended = problem.observe_by(observations, groups, campaign, places)
    return extended, [
        (f"a CT scan of {name_tip(scan.projectile)} dropped", f"at {scan.speed.value:.2f} m/s")
        for scan in scans
    ]


def predict_scans(problem: Problem, extended: Problem, standing: Sequence[Fit]) -> list[list[Prediction]]:
    """What each fit predicts of every planned scan of ``extended``, given the data that it was fitted to."""
    measured = {each.name for each in problem.scans} | {each.name for each in problem.undisturbed}
    parts = [part for each in extended.observations for part in _list_parts(each)]
    of_scan = np.repeat([name for name, _ in parts], [len(numbers) for _, numbers in parts])
    data = np.concatenate([numbers for _, numbers in parts])
    seen = np.isin(of_scan, sorted(measured))
    places, begin = [], []
    for k, each in enumerate(extended.observations):
        found = problem.find(type(each))
        places.append(found[0] if found else len(problem.observations) + k)
        begin.append(each.begin())
    linear = []
    for fit in standing:
        require_runs(extended, fit)
        known = [fit.nuisances[place] if place < len(fit.nuisances) else np.empty(0) for place in places]
        nuisances = [np.append(own, start[own.size :]) for own, start in zip(known, begin, strict=True)]
        linear.append(linearise_at(extended, nuisances, fit.log_p_m, fit.values))
    covariance = block_diag(*(block.covariance for block in linear[0]))
    predictions: list[list[Prediction]] = []
    for fit, blocks in zip(standing, linear, strict=True):
        mean, spread = predict_rows(problem, fit, dict(zip(places, blocks, strict=True)), seen, covariance)
        mean = mean + data[~seen]  # planned scans hold numbers too
        predictions.append(
            [
                _state_levels(zone, mean[rows], spread[np.ix_(rows, rows)])
                for zone in extended.scans[len(problem.scans) :]
                for rows in [np.nonzero(of_scan[~seen] == zone.name)[0]]
            ]
        )
    return predictions


def _state_levels(zone: CompactedZone, mean: FloatArray, spread: FloatArray) -> ScanPrediction:
    """mean (n,), spread (n, n): of a scan's cells, then the tip's depth, then its undisturbed dust with the point spread."""
    r, below = zone.observed.about_tip[:, 0], -zone.observed.about_tip[:, 1]
    weights = {place: np.zeros(mean.size) for place in (*REGIONS, UNREACHED)}
    for place, ((above, under), (inner, outer)) in REGIONS.items():
        inside = (below > above) & (below < under) & (r > inner) & (r < outer)
        weights[place][: r.size] = np.where(inside, r, 0.0)
    weights[UNREACHED][r.size + 1 : -1] = 1.0
    return ScanPrediction(
        mean,
        spread,
        {
            place: (float(each @ mean) / each.sum(), math.sqrt(each @ spread @ each) / each.sum())
            for place, each in weights.items()
            if each.any()
        },
    )


def _list_parts(observation: Observation) -> Sequence[tuple[str, FloatArray]]:
    """Names of scans and the numbers that are compared of each, in the order of an observation's rows."""
    if isinstance(observation, CompactedZones):
        return [
            (each.name, np.append(each.observed.filling_factor, each.observed.map.tip_depth))
            for each in observation.zones
        ]
    assert isinstance(observation, Layering)
    return [
        (each.name, np.append(each.filling_factor, math.log(each.point_spread))) for each in observation.dust
    ]


def _plan_map(
    problem: Problem, projectile: Projectile, speed: float, depth: float
) -> tuple[ObservedScan, UndisturbedDust]:
    """A scan of a tip ``depth`` m deep, its map about the tip and its dust beside it, by a usual scanner."""
    radius, level = projectile.tip_radius, problem.campaign.sample.filling_factor
    voxel = radius / USUAL_VOXELS
    scan = Scan(
        "planned scan",
        projectile,
        Measured(speed, USUAL_SPEED * speed),
        Path(),
        voxel,
        "top",
        16,
        GreyCalibration(0.0, 1.0, problem.campaign.sample.monomer_density),
    )
    cell = 2.0 * voxel
    r = np.arange(0.5 * cell, WIDTH * radius, cell)
    z = -np.arange(0.25 * radius, depth + BELOW * radius, cell)
    rows, columns = z[:, None], r[None, :]
    # whatever the tip's shape, none of it is farther from the axis than its radius
    tip = (columns < radius + GUARD * voxel) & (rows > -depth - GUARD * voxel)
    cells = np.broadcast_to(rows < ABOVE * radius - depth, tip.shape) & ~tip
    found = FillingMap(
        r,
        z,
        np.full(tip.shape, level),
        np.full(tip.shape, USUAL_NOISE),
        np.ones(tip.shape),
        depth,
        radius,
        (0.0, 0.0),
    )
    compared = np.full(np.count_nonzero(cells), level)
    observed = ObservedScan(
        scan,
        found,
        voxel,
        (0.0, 0.0),
        cells,
        compared,
        np.full(compared.size, USUAL_NOISE),
        level,
        compared,
    )
    beside = -z
    return observed, UndisturbedDust(
        scan,
        beside,
        np.full(beside.size, level),
        np.full(beside.size, USUAL_NOISE / math.sqrt(WIDTH * radius / cell)),
        voxel,
    )
