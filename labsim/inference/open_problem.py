"""From a campaign to its problem: groups of drops and scans, their speeds of simulation, effects that can be at work."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import TypeVar

import numpy as np

from ..effects import Effect, list_effects, list_places
from ..effects.model import Model, apply_effects, check_model
from ..effects.terms import apply_law
from ..errors import InferenceError
from ..records import Campaign, Projectile
from ..runs.store import Progress, RunStore
from ..sph import DropSetting
from .emulation.curves import extract_curve, extract_speeds
from .emulation.forward import ResponseTable
from .emulation.grid import (
    FELT_STEPS,
    PUSH_RATIO,
    SPEED_RATIO,
    ProjectileGroup,
    RunGrid,
    own_speeds,
    sparse_positions,
    speed_nodes,
)
from .observations import Observation, RunFeatures, observe_further
from .observations.acceleration_model import make_acceleration_model
from .observations.compacted_zone import CompactedZone, CompactedZones, ObservedScan, extract_map
from .observations.drop_model import make_drop_model
from .observations.linearised_drop import ErrorBudget, RecordModel
from .observations.observe import Observed, ObservedDrop, observe_drops
from .observations.observe_acceleration import ObservedImpact
from .observations.observe_push import ObservedPush, measure_ground
from .observations.push_model import PushModel, extract_push
from .observations.rebounds import Rebound, Rebounds, extract_rebound, measure_rebound
from .observations.sleeve_friction import SleeveFriction, TipSleeves, extract_sleeve, measure_spread
from .observations.tracks import Tracks
from .observations.undisturbed import Layering, UndisturbedDust
from .problem import Problem
from .supported import refuse_others

Seen = TypeVar("Seen")
SPEED_MARGIN = 1.05  # the true speed may differ from the one on the stated scales


def open_problem(
    campaign: Campaign,
    store: RunStore,
    effects: Mapping[str, Effect],
    *,
    budget: ErrorBudget | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    cells: int | None = None,
    drops: list[Observed] | None = None,
    scans: Sequence[ObservedScan] = (),
    undisturbed: Sequence[UndisturbedDust] = (),
    model: Model | None = None,
) -> Problem:
    """Measure the campaign and lay out the grid of runs; nothing is simulated yet."""
    refuse_others(campaign)
    drops = drops if drops is not None else observe_drops(campaign)[0]
    if not drops:
        raise InferenceError(campaign.folder, "drops", "no tracks to compare with; give tracks or videos")
    felt = any(isinstance(drop, ObservedImpact) for drop in drops)
    resolved, numerics, reasons = resolve_effects(campaign, effects, felt=felt)
    filmed = [drop for drop in drops if isinstance(drop, ObservedDrop)]
    reached = np.array([(drop.depth.max(), drop.drop.projectile.tip_radius) for drop in filmed])
    resolved = {name: effect.for_drops(reached) for name, effect in resolved.items()}
    errors = {name: (each.amplitudes[0].step, each.amplitudes[0].prior.sd) for name, each in numerics.items()}
    groups: list[ProjectileGroup] = []
    observations: list[Observation] = []
    models: list[RecordModel] = []
    features: list[RunFeatures] = []
    of_speeds: list[RunFeatures] = []
    sleeves: list[TipSleeves] = []
    rebounds: list[Rebound] = []
    dropped = [drop for drop in drops if not isinstance(drop, ObservedPush)]
    pushed = [drop for drop in drops if isinstance(drop, ObservedPush)]
    of_tips = [push for push in pushed if not push.feels_shaft]
    of_rods = [push for push in pushed if push.feels_shaft]
    grouped = [
        each
        for seen in (dropped, of_tips, of_rods)
        for each in group_alike((drop.drop.projectile, drop) for drop in seen).items()
    ]
    for projectile, group in grouped:
        pushes = [drop for drop in group if isinstance(drop, ObservedPush)]
        felt = any(isinstance(drop, ObservedImpact) for drop in group)
        speeds_seen = [drop.impact_speed for drop in group]
        if felt:
            nodes = own_speeds(speeds_seen)
        else:
            ends = min(speeds_seen) / SPEED_MARGIN, max(speeds_seen) * SPEED_MARGIN
            nodes = speed_nodes(*ends, PUSH_RATIO if pushes else SPEED_RATIO)
        sparse = sparse_positions(nodes, felt)
        table = ResponseTable(np.log(nodes), sparse)
        if pushes:
            ground = measure_ground(pushes)
            numbers = sorted({int(n) for push in pushes for n in push.windows})
            reference = numbers[len(numbers) // 2]
            extract = partial(extract_push, whole=pushes[0].feels_shaft)
            features.append(RunFeatures(len(groups), table, extract))
            groups.append(ProjectileGroup(projectile, nodes, False, sparse, pushed=True))
            models += [PushModel(push, table, ground, reference) for push in pushes]
            with_sleeve = [push for push in pushes if push.compares_sleeve]
            if with_sleeve:
                ratios = RunFeatures(len(groups) - 1, ResponseTable(np.log(nodes), sparse), extract_sleeve)
                sleeves.append(TipSleeves(tuple(with_sleeve), ratios, measure_spread(with_sleeve)))
            continue
        features.append(RunFeatures(len(groups), table, extract_curve))
        groups.append(ProjectileGroup(projectile, nodes, False, sparse, felt=felt))
        speeds = ResponseTable(np.log(nodes), sparse)
        if felt:
            of_speeds.append(RunFeatures(len(groups) - 1, speeds, extract_speeds))
        else:
            lifts = RunFeatures(len(groups) - 1, ResponseTable(np.log(nodes), sparse), extract_rebound)
            rebounds += [
                Rebound(drop, *way, lifts)
                for drop in group
                if isinstance(drop, ObservedDrop) and (way := measure_rebound(drop)) is not None
            ]
        models += [
            make_acceleration_model(drop, speeds, errors)
            if isinstance(drop, ObservedImpact)
            else make_drop_model(drop, table)
            for drop in group
            if not isinstance(drop, ObservedPush)
        ]
    observations.append(Tracks(tuple(models), (*features, *of_speeds), name="drops" if dropped else "pushes"))
    if rebounds:
        observations.append(Rebounds(tuple(rebounds)))
    if sleeves:
        observations.append(SleeveFriction(tuple(sleeves)))
    zones = []
    for projectile, scanned in group_alike((scan.scan.projectile, scan) for scan in scans).items():
        nodes = own_speeds([scan.scan.speed.value for scan in scanned])
        sparse = tuple(range(len(nodes)))
        for scan in scanned:
            extract = partial(extract_map, observed=scan)
            own = RunFeatures(len(groups), ResponseTable(np.log(nodes), sparse), extract)
            zones.append(CompactedZone(scan, own))
        groups.append(ProjectileGroup(projectile, nodes, True, sparse))
    if zones:
        observations.append(CompactedZones(tuple(zones)))
    if undisturbed:
        observations.append(Layering(tuple(undisturbed), campaign.sample.filling_factor_sigma))
    observations += observe_further(campaign)
    grid = RunGrid(campaign, store, groups, workers=workers, scheduler=scheduler, progress=progress)
    if cells:
        grid.cells = cells
    places = list_places(campaign)
    problem = Problem(
        campaign,
        drops,
        grid,
        groups,
        places,
        resolved,
        numerics,
        budget or ErrorBudget(),
        tuple(observations),
        reasons,
    )
    if model is not None:
        extend(problem, model)
    return problem


def resolve_effects(
    campaign: Campaign, effects: Mapping[str, Effect], *, felt: bool
) -> tuple[dict[str, Effect], dict[str, Effect], dict[str, str]]:
    """Effects that may be at work; the solver's settings that are among the errors; why others are not tried, by name.

    felt : an accelerometer is on some drops.
    """
    causes, numerics, reasons = {}, {}, {}
    for name, effect in effects.items():
        reason = effect.applies(campaign)
        if reason:
            reasons[name] = reason
            continue
        known = effect.for_campaign(campaign)
        if felt and known.kind == "numerics" and known.amplitudes:
            numerics[name] = known
            reasons[name] = "is among the errors of what an accelerometer feels, not among the causes"
        else:
            causes[name] = known.stretch(FELT_STEPS) if felt and known.kind != "numerics" else known
    return causes, numerics, reasons


def extend(problem: Problem, model: Model) -> None:
    """Take a model's effects and material into the nominal model; its p_m stays what is looked for.

    Raises EffectError where one of its effects cannot be at work in this campaign.
    """
    check_model(model, problem.campaign, list_effects(problem.campaign), problem.campaign.folder)
    held = [(name, values) for name, values in model.effects if not problem.rescales_p_m(name)]

    def apply(setting: DropSetting) -> DropSetting:
        setting = setting.replace(material=setting.material.replace(**dict(model.material)))
        setting = apply_effects(setting, held, problem.place_of(setting.projectile.tip), problem.effects)
        return apply_law(setting, model.law)

    problem.model = model
    problem.grid.extension = apply


def group_alike(
    measured: Iterable[tuple[Projectile, Seen]],
) -> dict[Projectile, list[Seen]]:
    """What was seen of projectiles that a simulation cannot tell apart, by all of them that it takes."""
    groups: dict[Projectile, list[Seen]] = {}
    for projectile, seen in measured:
        groups.setdefault(projectile.simulated, []).append(seen)
    return groups
