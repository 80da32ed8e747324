"""A measured campaign with its runs: everything a fit needs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from ..calibrated import read_value, set_value
from ..effects import Effect, Instrument, Place
from ..effects.model import Model, make_instrument
from ..records import Campaign, FloatArray
from ..sph import DropSetting
from .emulation.deflection import acts_on_projectile
from .emulation.forward import ResponseTable
from .emulation.grid import Change, ProjectileGroup, Request, RunGrid, RunKey
from .emulation.nodes import amplitude_nodes, enclosing_nodes, nearest_nodes, screening_node
from .observations import Observation, RunFeatures
from .observations.compacted_zone import CompactedZone, CompactedZones
from .observations.linearised_drop import ErrorBudget
from .observations.observe import Observed
from .observations.tracks import Tracks
from .observations.undisturbed import Layering, UndisturbedDust

Kind = TypeVar("Kind")  # a class of observations


@dataclass
class Problem:
    """A measured campaign with its runs: everything a fit needs."""

    campaign: Campaign
    drops: list[Observed]
    grid: RunGrid
    groups: list[ProjectileGroup]
    places: dict[str, Place]
    effects: dict[str, Effect]
    # of the solver's settings: what they change is an error of drops that an accelerometer feels, and no cause
    numerics: dict[str, Effect]
    budget: ErrorBudget
    observations: tuple[Observation, ...]  # all drops first
    reasons: dict[str, str]  # why an effect does not apply
    warnings: list[str] = field(default_factory=list)
    # ln of what fitting a shape beforehand costs
    shape_evidence: dict[str, float] = field(default_factory=dict)
    renamed: dict[str, str] = field(default_factory=dict)  # effect -> the name its runs were asked for under
    model: Model | None = None  # what the nominal model is extended by
    # what the tables hold already, and features of the nominal model: extracting them means seeing it through every scan
    _filled: set[RunKey] = field(default_factory=set, repr=False)
    _plain: dict[RunKey, list[tuple[ResponseTable, FloatArray | None]]] = field(
        default_factory=dict, repr=False
    )

    def observe_by(
        self,
        observations: Sequence[Observation],
        groups: Sequence[ProjectileGroup],
        campaign: Campaign,
        places: Mapping[str, Place],
    ) -> Problem:
        """The same simulation seen by other observations, of a campaign with other records, at their places. ``groups`` of runs
        may have grown; the runs are kept apart."""
        return replace(
            self,
            observations=tuple(observations),
            groups=list(groups),
            campaign=campaign,
            places=dict(places),
            grid=replace(self.grid, groups=list(groups), runs=dict(self.grid.runs)),
            _filled=set(),
            _plain={},
        )

    @property
    def tracks(self) -> Tracks:
        """All drops."""
        first = self.observations[0]
        assert isinstance(first, Tracks)
        return first

    def find(self, kind: type[Kind]) -> tuple[int, Kind] | None:
        """Where among the observations the one of a class stands, and itself; None where there is none."""
        return next(((k, each) for k, each in enumerate(self.observations) if isinstance(each, kind)), None)

    @property
    def scans(self) -> list[CompactedZone]:
        """The compacted zones that are compared."""
        found = self.find(CompactedZones)
        return list(found[1].zones) if found else []

    @property
    def layering(self) -> Layering | None:
        """The undisturbed dust of all scans."""
        found = self.find(Layering)
        return found[1] if found else None

    @property
    def undisturbed(self) -> tuple[UndisturbedDust, ...]:
        """Scans whose undisturbed dust is compared."""
        return self.layering.dust if self.layering else ()

    @property
    def felt(self) -> bool:
        """Whether an accelerometer is on some drops: runs are rough there, and steps of effects long."""
        return any(group.felt for group in self.groups)

    @property
    def pushed(self) -> bool:
        """Whether projectiles are led through the ground, not dropped."""
        return any(group.pushed for group in self.groups)

    @property
    def node_step(self) -> float:
        """Between the strengths at which runs are made, in nodes of the grid. A depth is smooth in ln p_m; the force that an
        accelerometer feels is off by 1 to 2 % of its largest between nodes a factor of two apart."""
        return 0.5 if self.felt else 1.0

    @property
    def features(self) -> list[RunFeatures]:
        """What all observations take of runs."""
        return [each for observation in self.observations for each in observation.features]

    def _extract(self, number: int, request: Request) -> list[tuple[ResponseTable, FloatArray | None]]:
        """Features of one group, (speeds, spacings, m), for each table that rests on them; None where a run failed."""
        runs = self.grid.stopped_runs(request, number)
        alike = len(self.groups[number].spacings(request.sparse, 0, request.variant != ""))

        def extract(each: RunFeatures) -> FloatArray | None:
            if runs is None:
                return None
            features = np.array([each.extract(run) for run in runs])
            return features.reshape(-1, alike, features.shape[1])

        return [(each.table, extract(each)) for each in self.features if each.group == number]

    def _extract_plain(self, number: int, request: Request) -> list[tuple[ResponseTable, FloatArray | None]]:
        """Features of the nominal model, extracted once."""
        key = request.of(number)
        if key not in self._plain:
            self._plain[key] = self._extract(number, request)
        return self._plain[key]

    def _fill_base(self, number: int, index: float) -> None:
        for table, features in self._extract_plain(number, Request("", None, index)):
            if features is not None:
                table.base[index] = features.mean(axis=1)

    def _fill_change(self, number: int, request: Request, name: str, amplitude: float) -> None:
        if request.of(number) in self._filled:
            return
        self._filled.add(request.of(number))
        integrated = request.of(number) in self.grid.integrated
        plain = request.base if integrated else request.plain
        before, after = self._extract_plain(number, plain), self._extract(number, request)
        spacings = self.groups[number].spacings  # a change is one from the run of the same spacing
        for (table, features), (_, features_before) in zip(after, before, strict=True):
            kept = table.fingerprints if request.sparse else table.changes
            kept = table.integrated if integrated else kept
            entry = kept.setdefault(name, {}).setdefault(request.index, {})
            table.parameters[name] = self._find(name).amplitudes[0]
            if not request.rough:
                table.corrections.pop(name, None)  # until its trend is known there
            if features is not None and features_before is not None:
                own = [
                    spacings(request.sparse, k, False).index(f)
                    for k in range(len(features))
                    for f in spacings(request.sparse, k, True)
                ]
                alike = np.take_along_axis(features_before, np.reshape(own, (len(features), -1, 1)), axis=1)
                entry[amplitude] = (features - alike).mean(axis=1)

    def state(self, group: ProjectileGroup, name: str = "") -> DropSetting:
        """The nominal model of one group, or of one of its pushes at its own speed, in the middle of the range of p_m."""
        speed = group.speeds[0]
        for drop in self.campaign.drops if group.pushed else ():
            if drop.name == name:
                speed = dict(drop.motion.values)["speed"]
        return self.grid.setting(group, speed, math.sqrt(math.prod(self.campaign.p_m_range)))

    def rescales_p_m(self, name: str) -> bool:
        """Whether an effect changes nothing of a drop but p_m: then the base runs already hold it."""
        effect = self.effects[name]
        if effect.change_setting is None or not effect.amplitudes:
            return False
        return all(
            changed.replace(material=set_value(changed.material, read_value(plain.material))) == plain
            for plain, changed in self._take_step(name)
        )

    def acts_on_projectile(self, name: str) -> bool:
        """Whether an effect changes nothing of a drop but what acts on the projectile alone, so that films need no runs of it.
        Those of accelerometers and pushes are simulated in any case."""
        effect = self._find(name)
        if self.felt or self.pushed or effect.change_setting is None or not effect.amplitudes:
            return False
        return all(acts_on_projectile(plain, changed) for plain, changed in self._take_step(name))

    def _take_step(self, name: str) -> Iterator[tuple[DropSetting, DropSetting]]:
        """Of every projectile, for a floor is felt by the largest tip alone: its drop without an effect, and with one step of it
        where the order of the drops counts most."""
        effect, place = (
            self._find(name),
            max(self.places.values(), key=lambda each: abs(each.sequence_fraction)),
        )
        values = self.at(name, effect.amplitudes[0].step)
        for group in self.groups:
            plain = self.state(group)
            yield plain, effect.apply(plain, values, place)

    def at(self, name: str, amplitude: float) -> dict[str, float]:
        """Values of an effect's parameters at an amplitude, kept inside the limits."""
        parameter = self._find(name).amplitudes[0]
        return {parameter.name: parameter.hold(amplitude)}

    def _find(self, name: str) -> Effect:
        return self.effects[name] if name in self.effects else self.numerics[name]

    def change(self, name: str, amplitude: float) -> Change:
        effect, values = self._find(name), self.at(name, amplitude)

        def apply(setting):
            return effect.apply(setting, values, self.place_of(setting.projectile.tip))

        return apply

    def place_of(self, tip: str) -> Place:
        for place in self.places.values():
            if place.tip == tip:
                return place
        return next(iter(self.places.values()))

    def _variant(self, name: str, amplitude: float) -> str:
        return f"{self.renamed.get(name, name)} {amplitude:.9g}"

    def require_base(self, indices: Sequence[float]) -> None:
        self.grid.require([Request("", None, index) for index in indices], "nominal model")
        for number in range(len(self.groups)):
            for index in indices:
                self._fill_base(number, index)

    def require_base_about(self, log_p_m: float) -> None:
        self.require_base(enclosing_nodes(log_p_m, self.campaign.p_m_range, self.node_step))

    def require_changes(
        self,
        wanted: Sequence[tuple[str, float, float]],
        text: str = "effects",
        *,
        sparse: bool = False,
        rough: bool = False,
    ) -> None:
        """Runs of (effect, amplitude, strength index) and what they change against the same spacing without the effect; at few
        speeds they are fingerprints. Where ``rough``, as these are, spacings are wider and laws on the projectile alone take no
        runs."""
        rough = rough or sparse
        if sparse:  # no fingerprint is looked at where there are changes
            known = {name for each in self.features for name in each.table.changes}
            wanted = [each for each in wanted if each[0] not in known]
        names = {name for name, _, _ in wanted} if rough else set()
        laws = {name for name in names if self.acts_on_projectile(name)}
        changed = [
            Request(
                self._variant(name, a),
                self.change(name, a),
                index,
                sparse=sparse,
                rough=rough,
                integrated=name in laws,
            )
            for name, a, index in wanted
        ]
        plain = sorted({request.plain for request in changed}, key=lambda request: request.index)
        plain += [request.base for request in changed if request.integrated]
        self.grid.require([*plain, *changed], text)
        for number in range(len(self.groups)):
            for (name, amplitude, _), request in zip(wanted, changed, strict=True):
                self._fill_change(number, request, name, amplitude)

    def require_trend(self, name: str, log_p_m: float, amplitude: float) -> None:
        """What a law on the projectile alone changes of films close about an estimate, without runs (deflection.py), and what
        runs of it, wherever there are some, say more: that is small and smooth. Not where the estimate leads out of what is known
        without runs."""
        about, least = (amplitude_nodes(self._find(name), amplitude, around=more) for more in (True, False))
        nodes = enclosing_nodes(log_p_m, self.campaign.p_m_range, self.node_step)
        for number, group in enumerate(self.groups):
            own = [each for each in self.features if each.group == number]
            if group.is_scan or not own:
                continue
            changes = own[0].table.changes.get(name, {})
            trend = own[0].table.trends.setdefault(name, {})
            for index in {*nodes, *changes}:
                missing = {*(about if index in nodes else ()), *changes.get(index, ())} - {
                    *trend.get(index, ())
                }
                if missing:
                    self._fill_trend(number, own, name, index, sorted(missing))
            partly = {index for index in nodes if not {*least} <= {*trend.get(index, ())}}
            for table in (each.table for each in own):
                known = table.trends[name]
                if not partly.isdisjoint(known):  # farther amplitudes would follow from nearer ones
                    # a mapping of its own, for what is laid out of one only grows
                    table.trends[name] = {index: known[index] for index in known if index not in partly}
                table.corrections.pop(name, None)
                if partly.isdisjoint(nearest_nodes(log_p_m, self.node_step, share=0.0)):
                    table.correct(name)

    def _fill_trend(
        self, number: int, own: Sequence[RunFeatures], name: str, index: float, amplitudes: Sequence[float]
    ) -> None:
        wanted = [Request(self._variant(name, a), self.change(name, a), index) for a in amplitudes]
        found = self.grid.deflect_runs(wanted, number)
        plain = self._extract_plain(number, Request("", None, index))
        for each, (table, before) in zip(own, plain, strict=True):
            entry = table.trends.setdefault(name, {}).setdefault(index, {})
            for amplitude, motions in zip(amplitudes, found, strict=True):
                if motions is not None and before is not None:
                    features = np.array([each.extract(run) for run in motions])
                    entry[amplitude] = features - before.mean(axis=1)

    def follows_trend(self, name: str) -> bool:
        """Whether films know what an effect changes without runs, and by how much runs say more."""
        films = [each for each in self.features if not self.groups[each.group].is_scan]
        return bool(films) and all(name in each.table.corrections for each in films)

    def require_fingerprints(self, names: Sequence[str], log_p_m: float, text: str) -> None:
        """The base about a strength, and what each effect changes there by one step; by a step to the other side of its null
        where a run of the first never stopped: a heavy projectile falls through weak dust."""
        self.require_base_about(log_p_m)
        index = screening_node(log_p_m)
        for side in (1.0, -1.0):
            wanted = [
                (name, amplitude, index)
                for name in names
                if not self._has_fingerprint(name, index)
                for amplitude in amplitude_nodes(self._find(name), 0.0, side=side)
            ]
            self.require_changes(wanted, text, sparse=True)

    def _has_fingerprint(self, name: str, index: float) -> bool:
        """Whether every projectile has a run at a strength node by which an effect is known there."""
        return all(
            any(kept.get(name, {}).get(index) for kept in (each.table.integrated, each.table.fingerprints))
            for each in self.features
        )

    def initial_setting(self, amplitudes: Mapping[str, float], name: str) -> DropSetting:
        """What would be simulated at the place of a drop or scan, for data that need no run: its initial state counts.

        Any other name is a sample of its own, neither early nor late.
        """
        place = self.places.get(name) or replace(
            next(iter(self.places.values())), name=name, sequence_fraction=0.0
        )
        setting = self.state(self.groups[0])
        for effect, amplitude in amplitudes.items():
            if amplitude != 0.0:
                setting = self.effects[effect].apply(setting, self.at(effect, amplitude), place)
        return setting

    def instruments(self, amplitudes: Mapping[str, float]) -> dict[str, Instrument]:
        made = {}
        for name, place in self.places.items():
            instrument = Instrument()
            if self.model is not None:
                instrument = make_instrument(self.model, place, self.effects)
            for effect_name, amplitude in amplitudes.items():
                effect = self.effects[effect_name]
                if effect.change_instrument is not None:
                    instrument = effect.apply_to_instrument(
                        instrument, self.at(effect_name, amplitude), place
                    )
            made[name] = instrument
        return made

    def log_offsets(self, amplitudes: Mapping[str, float]) -> dict[str, float]:
        """Change of ln p_m per drop by effects that act on the strength alone."""
        offsets = {name: 0.0 for name in self.places}
        projectiles = {each.name: each.projectile.simulated for each in self.campaign.drops}
        projectiles |= {each.name: each.projectile.simulated for each in self.campaign.scans}
        changes = [
            (effect_name, self.at(effect_name, amplitude))
            for effect_name, amplitude in amplitudes.items()
            if amplitude != 0.0 and self.rescales_p_m(effect_name)
        ]
        changes += [(n, dict(v)) for n, v in self.model.effects if self.rescales_p_m(n)] if self.model else []
        for effect_name, values in changes:
            for name, place in self.places.items():
                setting = self.state(self.groups[0], name)
                if name in projectiles:
                    setting = setting.replace(projectile=projectiles[name])
                changed = self.effects[effect_name].apply(setting, values, place)
                offsets[name] += math.log(read_value(changed.material) / read_value(setting.material))
        return offsets

    def affects_simulation(self, name: str) -> bool:
        return self.effects[name].affects_simulation and not self.rescales_p_m(name)
