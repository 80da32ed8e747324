"""Campaigns whose truth is known: labsim's own solver at another spacing, other nodes, with every nuisance a laboratory has.

Tracks come from runs at TRUTH_CELLS spacings a radius on nodes of speed and p_m of their own; each drop gets a camera that
starts at its own instant, a height that is not quite the stated one, a sample of its own strength, a surface row that is
off within its uncertainty, noise, missing frames and outliers. Scans are given as what their undisturbed dust shows, and, where
a reduced scan is given as a template, as a map of a run of their own at TRUTH_SCAN_CELLS.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..ct.reduce import ReducedScan
from ..effects import Effect, Instrument, Place, apply_effects, list_effects, list_places
from ..errors import SimulationError
from ..records import Campaign, Drop, FloatArray, Projectile, Track
from ..sph import DropRun, DropSetting, simulate
from ..sph.particles import initial_filling_factor
from .curves import encode_run
from .forward import Instant, ResponseTable, predict_depth
from .grid import interpolation_weights, set_nominal_drop
from .measure import Measurements
from .observe import STANDARD_GRAVITY, observe_drop, sequence_fractions
from .runs import Progress, RunStore
from .scans import see_dust
from .undisturbed import UndisturbedDust

TRUTH_CELLS, TRUTH_SCAN_CELLS = 6, 10
SPEED_ANCHOR, SPEED_RATIO = 0.13, 1.6
STRENGTHS = (850.0, 1300.0, 2000.0)  # Pa, nodes of the truth
SCATTER = 0.02  # of ln p_m from sample to sample
OUTLIERS, MISSING = 0.01, 0.01  # shares of frames
AFTER_STOP = 1.1  # frames kept, in stopping times
ROW_NOISE = 1.5e-4  # of the filling factor of a row of undisturbed dust
ROW_STEP, ROW_DEPTH = 8e-5, 3.3e-3  # m
DRIFT = "sample_drift"  # the effect that is a p_m of each drop
LIFT = 40e-6  # m, of a bead at rest over where its run ends: scale of an exponential law


Effects = Mapping[str, Mapping[str, float]]  # values of the parameters, by name of the effect


@dataclass(frozen=True)
class Hidden:
    """What is put into a campaign. effects : all that are at work, by name, with the values of their parameters."""

    effects: Effects = field(default_factory=dict)
    p_m: float = 1300.0

    @property
    def cause(self) -> str:
        return " + ".join(sorted(self.effects)) or "none"


@dataclass
class TruthTable:
    """Runs that truths are made of: nominal ones on all nodes, and those with what is hidden at the middle strength."""

    campaign: Campaign
    store: RunStore
    workers: int | None = None
    progress: Progress | None = None
    tables: dict[Projectile, ResponseTable] = field(default_factory=dict)

    def prepare(self, hidden: Sequence[Hidden]) -> None:
        """All runs that these truths need, in one sweep."""
        jobs: list[tuple[Projectile, str, float]] = []
        settings: list[DropSetting] = []
        for projectile, speeds in self._families().items():
            for name, effects, strength in self._variants(hidden):
                jobs.append((projectile, name, strength))
                place = next(iter(list_places(self.campaign).values()))
                settings += [
                    self.apply(effects, self.setting(projectile, speed, strength), place) for speed in speeds
                ]
        runs = self.store.get_many(settings, workers=self.workers, progress=self.progress, text="truths")
        codes: dict[tuple[Projectile, str, float], FloatArray] = {}
        at = 0
        for projectile, name, strength in jobs:
            count = len(self._families()[projectile])
            part = runs[at : at + count]
            at += count
            if all(isinstance(run, DropRun) and run.stopped for run in part):
                codes[projectile, name, strength] = np.array([encode_run(run) for run in part])
        for projectile, speeds in self._families().items():
            table = ResponseTable(np.log(speeds), tuple(range(len(speeds))))
            for k, strength in enumerate(STRENGTHS):
                table.base[k] = codes[projectile, "", strength]
            for found, name, strength in codes:
                if found == projectile and name:
                    table.changes[name] = {1: {1.0: codes[found, name, strength] - table.base[1]}}
            self.tables[projectile] = table

    def code(self, hidden: Hidden, projectile: Projectile, log_p_m: float, log_speed: float) -> FloatArray:
        """Code of one drop of a truth."""
        table = self.tables[_bare(projectile)]
        weights = interpolation_weights(np.log(STRENGTHS), log_p_m)
        across = interpolation_weights(table.log_speeds, log_speed)
        code = sum(w * (across @ table.base[k]) for k, w in enumerate(weights))
        name = _variant(self._costly(hidden))
        if name in table.changes:
            code = code + across @ table.changes[name][1][1.0]
        elif name:
            raise SimulationError("simulation", "truth", f"{name} has no runs; prepare it, or it failed")
        return np.asarray(code)

    def _families(self) -> dict[Projectile, tuple[float, ...]]:
        speeds: dict[Projectile, list[float]] = {}
        for drop in self.campaign.drops:
            assert drop.height is not None
            fall = math.sqrt(2 * STANDARD_GRAVITY * drop.height.value)
            slack = 1 + 1.5 * drop.height.sigma / drop.height.value
            speeds.setdefault(_bare(drop.projectile), []).extend([fall * slack, fall / slack])
        return {p: _own_nodes(min(v), max(v)) for p, v in speeds.items()}

    def _variants(self, hidden: Sequence[Hidden]) -> list[tuple[str, Effects, float]]:
        plain: list[tuple[str, Effects, float]] = [("", {}, strength) for strength in STRENGTHS]
        named = {_variant(effects): effects for effects in map(self._costly, hidden) if effects}
        return plain + [(name, effects, STRENGTHS[1]) for name, effects in named.items()]

    def _costly(self, hidden: Hidden) -> Effects:
        """Those of the hidden effects that need runs of their own; a drift is a p_m of each drop, which the nodes hold."""
        return {
            name: values
            for name, values in hidden.effects.items()
            if name != DRIFT and self.effect(name).costs_runs
        }

    def effect(self, name: str) -> Effect:
        return list_effects(self.campaign.folder)[name].for_campaign(self.campaign)

    def setting(self, projectile: Projectile, speed: float, p_m: float) -> DropSetting:
        return set_nominal_drop(self.campaign, projectile, speed, p_m, TRUTH_CELLS)

    def apply(self, effects: Effects, setting: DropSetting, place: Place) -> DropSetting:
        """The drop with all these effects."""
        return apply_effects(setting, effects.items(), place, {name: self.effect(name) for name in effects})

    def instrument(self, hidden: Hidden, place: Place) -> Instrument:
        """What the hidden effects do to the measurement."""
        instrument = Instrument()
        for name, values in hidden.effects.items():
            instrument = self.effect(name).apply_to_instrument(instrument, values, place)
        return instrument


def _variant(effects: Effects) -> str:
    return " + ".join(
        " ".join([name, *(f"{key}={value:.6g}" for key, value in sorted(effects[name].items()))])
        for name in sorted(effects)
    )


def _bare(projectile: Projectile) -> Projectile:
    return Projectile(projectile.tip, projectile.tip_radius, projectile.mass)


def _own_nodes(slowest: float, fastest: float) -> tuple[float, ...]:
    first = math.floor(math.log(slowest / SPEED_ANCHOR) / math.log(SPEED_RATIO))
    last = max(math.ceil(math.log(fastest / SPEED_ANCHOR) / math.log(SPEED_RATIO)), first + 2)
    return tuple(SPEED_ANCHOR * SPEED_RATIO**k for k in range(first, last + 1))


def measure_hidden(
    truth: TruthTable,
    hidden: Hidden,
    rng: np.random.Generator,
    scans: int = 2,
    templates: Sequence[ReducedScan] = (),
) -> Measurements:
    """What the cameras and the scanner would have recorded of a truth. Raises SimulationError where its runs are missing.

    templates : reduced scans of the campaign whose frame, mask and errors the maps of this truth take; none, no maps.
    """
    campaign = truth.campaign
    places, fractions = list_places(campaign), sequence_fractions(campaign.drops)
    drops = []
    for drop in campaign.drops:
        place, shift = places[drop.name], SCATTER * rng.standard_normal()
        if DRIFT in hidden.effects:
            plain = truth.setting(_bare(drop.projectile), 0.5, hidden.p_m)
            changed = truth.apply({DRIFT: hidden.effects[DRIFT]}, plain, place)
            shift += math.log(changed.material.p_m / hidden.p_m)
        instrument = truth.instrument(hidden, place)
        track = _film(truth, hidden, drop, instrument, math.log(hidden.p_m) + shift, rng)
        drops.append(observe_drop(drop, track, fractions[drop.name]))
    dust = []
    for scan in campaign.scans[:scans]:
        depth = np.arange(2 * ROW_STEP, ROW_DEPTH, ROW_STEP)
        setting, place = truth.setting(_bare(scan.projectile), 0.5, hidden.p_m), places[scan.name]
        setting, instrument = truth.apply(hidden.effects, setting, place), truth.instrument(hidden, place)
        level = instrument.stated_filling_factor(initial_filling_factor(setting, depth))
        seen = level + ROW_NOISE * rng.standard_normal(depth.size)
        spread = math.hypot(scan.voxel * math.exp(0.1 * rng.standard_normal()), instrument.ct_blur)
        dust.append(UndisturbedDust(scan, depth, seen, np.full(depth.size, ROW_NOISE), spread))
    maps = [_scan(truth, hidden, template, rng) for template in templates]
    return Measurements(drops, maps, dust)


def _scan(truth: TruthTable, hidden: Hidden, template: ReducedScan, rng: np.random.Generator) -> ReducedScan:
    """The map of one bead of this truth: its speed, sample, lift and noise drawn anew, in the frame of the template's bead."""
    scan, place = template.scan, list_places(truth.campaign)[template.scan.name]
    speed = scan.speed.value + scan.speed.sigma * rng.standard_normal()
    p_m = hidden.p_m * math.exp(SCATTER * rng.standard_normal())
    setting = set_nominal_drop(truth.campaign, _bare(scan.projectile), speed, p_m, TRUTH_SCAN_CELLS)
    instrument = truth.instrument(hidden, place)
    run = simulate(truth.apply(hidden.effects, setting, place))
    tip = run.penetration_depth - LIFT * rng.exponential()
    frame = replace(template.map, z=template.map.z - (tip - template.map.tip_depth), tip_depth=tip)
    blur = math.hypot(template.point_spread, instrument.ct_blur)
    seen = see_dust(run, frame, blur, scale=instrument.ct_scale)
    noise = np.nan_to_num(frame.sigma) * rng.standard_normal(seen.shape)
    return replace(template, map=replace(frame, filling_factor=seen + noise))


def _film(
    truth: TruthTable,
    hidden: Hidden,
    drop: Drop,
    instrument: Instrument,
    log_p_m: float,
    rng: np.random.Generator,
) -> Track:
    camera, height = drop.camera, drop.height
    assert camera is not None and height is not None
    true_height = max(height.value + height.sigma * rng.standard_normal(), 0.4 * height.value)
    speed = math.sqrt(2 * STANDARD_GRAVITY * true_height) * (1 + 0.002 * rng.standard_normal())
    code = truth.code(hidden, drop.projectile, log_p_m, math.log(speed))
    contact = rng.uniform(3e-3, 4e-3)
    end = (contact + AFTER_STOP * math.exp(code[1])) * instrument.rate_factor
    frames = np.arange(int(end * camera.frame_rate))
    time = frames / camera.frame_rate
    row_error = camera.surface_row_sigma * rng.standard_normal()
    instant = Instant(contact, math.log(speed), row_error * camera.pixel_size)
    offset = instrument.row_offset_px * camera.pixel_size
    depth = predict_depth(code, time, instant, instrument.pixel_factor, instrument.rate_factor, offset)
    sigma = drop.record.row_sigma or 0.08
    row = camera.surface_row + depth / camera.pixel_size + sigma * rng.standard_normal(frames.size)
    row = np.where(rng.random(frames.size) < OUTLIERS, row + rng.uniform(-20, 20, frames.size), row)
    keep = rng.random(frames.size) >= MISSING
    frames, time, row = frames[keep], time[keep], row[keep]
    n = frames.size
    return Track(frames, time, row, np.full(n, sigma), np.ones(n, dtype=bool), ("",) * n)
