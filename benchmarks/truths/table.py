"""Runs that truths are made of: labsim's own solver at TRUTH_CELLS and TRUTH_SCAN_CELLS, on nodes of speed and p_m of their own.

What a hidden effect changes is simulated at strengths CHANGED and at a few amplitudes, and interpolated between them; at an
amplitude that was simulated nothing of the amplitude is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from labsim.ct.reduce import ReducedScan
from labsim.effects import Effect, Instrument, Place, apply_effects, list_effects, list_places
from labsim.errors import SimulationError
from labsim.inference.emulation.curves import extract_curve
from labsim.inference.emulation.forward import ResponseTable
from labsim.inference.emulation.grid import set_nominal_drop
from labsim.inference.emulation.nodes import place_strength
from labsim.inference.observations.compacted_zone import see_dust
from labsim.records import STANDARD_GRAVITY, Campaign, FloatArray, Projectile, Scan
from labsim.runs.store import Progress, RunStore
from labsim.sph import DropRun, DropSetting

TRUTH_CELLS, TRUTH_SCAN_CELLS = 6, 10
SPEED_ANCHOR, SPEED_RATIO = 0.13, 1.6
STRENGTHS = (850.0, 1300.0, 2000.0)  # Pa, nodes of the truth
PLACES = tuple(place_strength(math.log(p_m)) for p_m in STRENGTHS)  # among the strengths of tables
CHANGED = (0, 2)  # of STRENGTHS, at which what effects change is simulated
BEYOND = 1.02  # of the largest amplitude simulated
DRIFT = "sample_drift"  # the effect that is a p_m of each drop
Effects = Mapping[str, Mapping[str, float]]  # values of the parameters, by name of the effect
Variant = tuple[str, float]  # what is simulated, and its amplitude
NOMINAL: Variant = ("", 0.0)
Encode = Callable[[DropRun], FloatArray]


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
    """Runs that truths are made of: nominal ones on all nodes, and those with what is hidden at strengths CHANGED.

    templates : reduced scans of the campaign whose frame, mask and errors the maps of truths take; none, no maps.
    tables : features of drops; maps : features of a scan, (ln D, all cells of its frame), by its name and the blur (m) that an
    effect adds. Amplitudes are an effect's parameter minus its null; effects together have one, of 1.
    """

    campaign: Campaign
    store: RunStore
    workers: int | None = None
    progress: Progress | None = None
    templates: tuple[ReducedScan, ...] = ()
    cells: tuple[int, int] = (
        TRUTH_CELLS,
        TRUTH_SCAN_CELLS,
    )  # spacings in a tip radius, of drops and of scans
    tables: dict[Projectile, ResponseTable] = field(default_factory=dict)
    maps: dict[tuple[str, float], ResponseTable] = field(default_factory=dict)

    def prepare(self, hidden: Sequence[Hidden]) -> None:
        """All runs that these truths need and the table lacks, in one sweep; an amplitude at which one fails is left out."""
        place = next(iter(list_places(self.campaign).values()))
        variants: dict[Variant, Effects] = {NOMINAL: {}}
        variants |= {self._name(effects): effects for effects in map(self._costly, hidden) if effects}
        blurs = sorted({0.0, *(self._blur(each) for each in hidden)})
        jobs = [
            (family, variant, k)
            for family in self._list_families(blurs)
            for variant in variants
            for k in (range(len(STRENGTHS)) if variant == NOMINAL else CHANGED)
            if any(_lacks(table, variant, k) for table, _ in family.tables)
        ]
        settings = [
            self.apply(
                variants[variant],
                self.setting(family.projectile, speed, STRENGTHS[k], is_scan=family.is_scan),
                place,
            )
            for family, variant, k in jobs
            for speed in family.speeds
        ]
        if not settings:
            return
        runs = self.store.get_many(settings, workers=self.workers, progress=self.progress, text="truths")
        parts: list[list[DropRun]] = []
        at = 0
        for family, _, _ in jobs:
            part = runs[at : at + len(family.speeds)]
            parts.append([run for run in part if isinstance(run, DropRun) and run.stopped])
            at += len(family.speeds)
        failed = {
            variant
            for (family, variant, _), part in zip(jobs, parts, strict=True)
            if len(part) < len(family.speeds)
        }
        if NOMINAL in failed:
            raise SimulationError("simulation", "truth", "a nominal run failed; nothing can be hidden")
        # nominal ones come first: changes are differences from them
        for (family, variant, k), found in sorted(
            zip(jobs, parts, strict=True), key=lambda job: job[0][1] != NOMINAL
        ):
            for table, extract in family.tables if variant not in failed else ():
                features = np.array([extract(run) for run in found])
                index = PLACES[k]
                if variant == NOMINAL:
                    table.base[index] = features
                else:
                    name, amplitude = variant
                    entry = table.changes.setdefault(name, {}).setdefault(index, {})
                    if len(alone := list(variants[variant])) == 1:
                        table.parameters[name] = self.effect(alone[0]).amplitudes[0]
                    entry[amplitude] = features - table.base[index]

    def _list_families(self, blurs: Sequence[float]) -> list[Family]:
        """All that is simulated with one projectile, with the tables that it fills; those of scans for these blurs."""
        families = []
        for projectile, speeds in self._families().items():
            table = self.tables.setdefault(projectile, _table(speeds))
            families.append(Family(projectile, speeds, False, [(table, extract_curve)]))
        for projectile, speeds in self._scan_families().items():
            seen: list[tuple[ResponseTable, Encode]] = [
                (
                    self.maps.setdefault((each.scan.name, blur), _table(speeds)),
                    partial(_extract_map, each, blur),
                )
                for each in self.templates
                if each.scan.projectile.simulated == projectile
                for blur in blurs
            ]
            families.append(Family(projectile, speeds, True, seen))
        return families

    def features(
        self, hidden: Hidden, projectile: Projectile, log_p_m: float, log_speed: float
    ) -> FloatArray:
        """Code of one drop of a truth."""
        return self._interpolate(self.tables[projectile.simulated], hidden, log_p_m, log_speed)

    def map_features(self, hidden: Hidden, scan: Scan, log_p_m: float, log_speed: float) -> FloatArray:
        """(ln D, filling factor on all cells) of one scan of a truth, its dust in the frame of the template."""
        key = (scan.name, self._blur(hidden))
        if key not in self.maps:
            raise SimulationError("simulation", "truth", f"{hidden.cause} has no map; prepare it")
        return self._interpolate(self.maps[key], hidden, log_p_m, log_speed)

    def holding(self, hidden: Hidden) -> TruthTable:
        """What one truth needs, and no store: little to send to another process."""
        name = self._name(self._costly(hidden))[0]

        def keep(table: ResponseTable) -> ResponseTable:
            return replace(table, changes={n: c for n, c in table.changes.items() if n == name})

        blur = self._blur(hidden)
        maps = {key: keep(table) for key, table in self.maps.items() if key[1] == blur}
        tables = {key: keep(table) for key, table in self.tables.items()}
        return replace(self, store=None, progress=None, tables=tables, maps=maps)  # type: ignore[arg-type]

    def _interpolate(
        self, table: ResponseTable, hidden: Hidden, log_p_m: float, log_speed: float
    ) -> FloatArray:
        name, amplitude = self._name(self._costly(hidden))
        known = [a for a in table.changes.get(name, {}).get(PLACES[CHANGED[0]], {}) if a * amplitude > 0]
        if amplitude != 0.0 and (not known or abs(amplitude) > BEYOND * max(map(abs, known))):
            raise SimulationError(
                "simulation", "truth", f"{hidden.cause} has no runs that far; prepare it, or they failed"
            )
        return table.features(log_p_m, log_speed, {name: amplitude})

    def _name(self, effects: Effects) -> Variant:
        """What is simulated together, and its amplitude."""
        if len(effects) != 1:
            return (_say(effects), 1.0) if effects else NOMINAL
        ((name, values),) = effects.items()
        parameter = self.effect(name).amplitudes[0]
        rest = {key: value for key, value in values.items() if key != parameter.name}
        return _say({name: rest}), float(values[parameter.name]) - parameter.null

    def _blur(self, hidden: Hidden) -> float:
        """m, what the hidden effects add to the point spread of scans."""
        place = next(iter(list_places(self.campaign).values()))
        return float(self.instrument(hidden, place).ct_blur)

    def _families(self) -> dict[Projectile, tuple[float, ...]]:
        speeds: dict[Projectile, list[float]] = {}
        for drop in self.campaign.drops:
            assert drop.height is not None
            fall = math.sqrt(2 * STANDARD_GRAVITY * drop.height.value)
            slack = 1 + 1.5 * drop.height.sigma / drop.height.value
            speeds.setdefault(drop.projectile.simulated, []).extend([fall * slack, fall / slack])
        return {p: _own_nodes(min(v), max(v)) for p, v in speeds.items()}

    def _scan_families(self) -> dict[Projectile, tuple[float, ...]]:
        speeds: dict[Projectile, list[float]] = {}
        for template in self.templates:
            speed = template.scan.speed
            reach = (speed.value - 1.5 * speed.sigma, speed.value + 1.5 * speed.sigma)
            speeds.setdefault(template.scan.projectile.simulated, []).extend(reach)
        return {p: _own_nodes(min(v), max(v)) for p, v in speeds.items()}

    def _costly(self, hidden: Hidden) -> Effects:
        """Those of the hidden effects that need runs of their own; a drift is a p_m of each drop, which the nodes hold."""
        return {
            name: values
            for name, values in hidden.effects.items()
            if name != DRIFT and self.effect(name).affects_simulation
        }

    def effect(self, name: str) -> Effect:
        return list_effects(self.campaign.folder)[name].for_campaign(self.campaign)

    def setting(
        self, projectile: Projectile, speed: float, p_m: float, *, is_scan: bool = False
    ) -> DropSetting:
        return set_nominal_drop(self.campaign, projectile, speed, p_m, self.cells[is_scan])

    def apply(self, effects: Effects, setting: DropSetting, place: Place) -> DropSetting:
        """The drop with all these effects."""
        return apply_effects(setting, effects.items(), place, {name: self.effect(name) for name in effects})

    def instrument(self, hidden: Hidden, place: Place) -> Instrument:
        """What the hidden effects do to the measurement."""
        instrument = Instrument()
        for name, values in hidden.effects.items():
            instrument = self.effect(name).apply_to_instrument(instrument, values, place)
        return instrument


@dataclass(frozen=True)
class Family:
    """Runs with one projectile, at these speeds (m/s), and the tables that their codes go to."""

    projectile: Projectile
    speeds: tuple[float, ...]
    is_scan: bool
    tables: list[tuple[ResponseTable, Encode]]


def _lacks(table: ResponseTable, variant: Variant, k: int) -> bool:
    if variant == NOMINAL:
        return PLACES[k] not in table.base
    return variant[1] not in table.changes.get(variant[0], {}).get(PLACES[k], {})


def _table(speeds: Sequence[float]) -> ResponseTable:
    return ResponseTable(np.log(speeds), tuple(range(len(speeds))))


def _extract_map(template: ReducedScan, blur: float, run: DropRun) -> FloatArray:
    """(1 + cells,): ln D and the filling factor on the template's cells, the deepest tip where the template's bead ends."""
    seen = see_dust(run, template.map, template.point_spread + blur)
    return np.concatenate([[math.log(run.penetration_depth)], seen.ravel()])


def _say(effects: Effects) -> str:
    return " + ".join(
        " ".join([name, *(f"{key}={value:.6g}" for key, value in sorted(effects[name].items()))])
        for name in sorted(effects)
    )


def _own_nodes(slowest: float, fastest: float) -> tuple[float, ...]:
    first = math.floor(math.log(slowest / SPEED_ANCHOR) / math.log(SPEED_RATIO))
    last = max(math.ceil(math.log(fastest / SPEED_ANCHOR) / math.log(SPEED_RATIO)), first + 2)
    return tuple(SPEED_ANCHOR * SPEED_RATIO**k for k in range(first, last + 1))
