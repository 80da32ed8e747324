"""Runs on a grid of impact speeds and p_m, shared by campaigns with the same projectiles and dust and like speeds.

Drops differ in speed by a continuum, runs need not: features of runs (curves.py) are smooth in ln v and ln p_m. Speeds are
about SPEED_RATIO apart or less, from the slowest drop to the fastest; strengths are fixed numbers, STRENGTH_RATIO apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice
from typing import cast

import numpy as np
from scipy.interpolate import CubicSpline

from ...calibrated import read_constant, set_value
from ...records import Campaign, FloatArray, Projectile
from ...records import Motion as Led
from ...runs.parts import AnyPart, Compaction, Motion, Part, Push
from ...runs.run_file import FailedRun
from ...runs.store import Progress, RunStore
from ...sph import DropSetting
from ...sph.materials import find_law
from .deflection import acts_on_projectile, deflect

SPEED_ANCHOR, SPEED_RATIO = 0.1, 1.55  # m/s
STRENGTH_ANCHOR, STRENGTH_RATIO = 1000.0, 2.0  # Pa
PUSH_RATIO = 4.0  # of a push speed enters by rates alone, and strengths go with their logarithms
# the outer nodes lie on a ladder with this ratio, so that campaigns with like drops share runs, at least so many rungs apart, or
# the roughness of runs would be taken for what speed changes
END_RATIO, LEAST_RUNGS = 1.07, 8
FEWEST_SPEEDS = 3
SLACK = 0.25  # of one ratio, which all together may be longer: a node more for less is not worth its runs
# of scans and of drops with an accelerometer, which are simulated at their own speeds: through nodes 1.7 apart the stopping time
# is off by up to half a per cent and the force by one (benchmarks/acceleration/emulator.py). Those nearer than SAME_SPEED share a
# node, one alone lies amid two; more than MOST_SPEEDS are cheaper from nodes FELT_RATIO apart
SAME_SPEED, MOST_SPEEDS, FELT_RATIO = 1.08, 5, 1.3
# of the stopping time: what runs of filmed drops need for the way back up (observations/rebounds.py), and all others
LIFTING, SETTLING = 0.34, 0.16
DEFAULT_CELLS = 5  # spacings in a tip radius; docs/other-methods.md: 0.33 % of the depth left at that
# of a first look at what effects change: it needs less than what it is added to (docs/discretisation.md). More where fits have
# more than the usual, in proportion
COARSE_CELLS = 4
PUSH_CELLS = 4  # of pushes: what is calibrated takes up the rest (docs/force-records.md)
PUSHED = (4.0, 8.0)  # tip radii, between which a push is simulated; resistance still rises there
INERTIA = 0.005  # ρ v² of a push over its resistance
# of drops with an accelerometer: the force needs more than the depth does (benchmarks/acceleration/error.py). Of fingerprints
# too: with 6 spacings those of weak causes point elsewhere (benchmarks/acceleration/fingerprint_spacing.py)
FELT_CELLS = 8
# a run's force is rough where its particles happen to lie: the mean over these factors on the spacing is compared. What a cause
# changes is taken with one of them, in turn from speed to speed: two codes differ in it by more than two lattices do
# (benchmarks/acceleration/effect_roughness.py)
FELT_SPACINGS = (0.975, 1.025)
# longer steps of effects there: what a usual step changes of the force is no more than two runs differ by in their roughness
# (benchmarks/acceleration/effect_roughness.py)
FELT_STEPS = 4.0
# of scans, and of a first look at what effects change of them: the map needs more than the depth does
SCAN_CELLS, COARSE_SCAN_CELLS = 8, 6

Change = Callable[[DropSetting], DropSetting]
RunKey = tuple[str, float, bool, bool, int]


@dataclass(frozen=True)
class ProjectileGroup:
    """Drops (or scans) with one projectile, and the speeds they are simulated at. speeds : (k,) m/s, rising.

    sparse : positions among them at which fingerprints of effects are simulated, smoother in speed than what they change.
    pushed : led through the ground at these speeds, not dropped. felt : an accelerometer is on some of them.
    """

    projectile: Projectile
    speeds: tuple[float, ...]
    is_scan: bool
    sparse: tuple[int, ...]
    pushed: bool = False
    felt: bool = False

    def spacings(self, sparse: bool, position: int, changed: bool) -> tuple[float, ...]:
        """Factors on the usual spacing of which there is a run each at one of the speeds; fingerprints (``sparse``), and what
        is changed by a cause, have one."""
        if not self.felt or sparse:
            return (1.0,)
        return (FELT_SPACINGS[position % len(FELT_SPACINGS)],) if changed else FELT_SPACINGS


@dataclass(frozen=True)
class Request:
    """Runs of all groups at one p_m node. variant : a name for ``change``, empty for the nominal model.

    sparse : of fingerprints, at few speeds. rough : for a first look, as these are, with wider spacings.
    integrated : what acts on the projectile alone is taken from the nominal model's runs (deflection.py), at all speeds, as far
    as they know it.
    """

    variant: str
    change: Change | None
    index: float
    sparse: bool = False
    rough: bool = False
    integrated: bool = False

    @property
    def plain(self) -> Request:
        """The same runs of the nominal model."""
        return replace(self, variant="", change=None, integrated=False)

    @property
    def base(self) -> Request:
        """The runs of the nominal model that changes are added to."""
        return Request("", None, self.index)

    def of(self, number: int) -> RunKey:
        """Under what the runs of one group are kept."""
        return self.variant, self.index, self.sparse, self.rough, number


def speed_nodes(slowest: float, fastest: float, ratio: float = SPEED_RATIO) -> tuple[float, ...]:
    """Nodes (m/s) evenly apart in ln v, by about ``ratio`` or less and at least FEWEST_SPEEDS of them, the outer ones just beyond
    [slowest, fastest].

    A fast run into soft dust costs as much as all others together: none is made much faster than the fastest drop.
    """
    step = math.log(END_RATIO)
    first = math.floor(math.log(slowest / SPEED_ANCHOR) / step + 1e-9)
    last = math.ceil(math.log(fastest / SPEED_ANCHOR) / step - 1e-9)
    while last - first < LEAST_RUNGS:
        first, last = first - 1, last + 1
    count = max(math.ceil((last - first) * step / math.log(ratio) - SLACK) + 1, FEWEST_SPEEDS)
    nodes = SPEED_ANCHOR * END_RATIO ** np.linspace(first, last, count)
    return tuple(float(f"{node:.4g}") for node in nodes)


def own_speeds(speeds: Sequence[float]) -> tuple[float, ...]:
    """Nodes at the speeds of drops with an accelerometer or of scans, of three digits, at least two of them."""
    alike: list[list[float]] = []
    for speed in sorted(speeds):
        if alike and speed < SAME_SPEED * alike[-1][0]:
            alike[-1].append(speed)
        else:
            alike.append([speed])
    if len(alike) > MOST_SPEEDS:
        return speed_nodes(min(speeds), max(speeds), FELT_RATIO)
    nodes = [math.sqrt(each[0] * each[-1]) for each in alike]
    if len(nodes) == 1:
        nodes = [nodes[0] / SAME_SPEED, nodes[0] * SAME_SPEED]
    return tuple(float(f"{node:.3g}") for node in nodes)


def sparse_positions(speeds: Sequence[float], felt: bool) -> tuple[int, ...]:
    """Both ends and the middle; of filmed drops with like speeds the ends alone. felt : an accelerometer is on some of them."""
    rungs = math.log(speeds[-1] / speeds[0]) / math.log(END_RATIO)
    if not felt and round(rungs) <= LEAST_RUNGS + 1:  # speed_nodes widens by two rungs at a time
        return 0, len(speeds) - 1
    return tuple(sorted({0, (len(speeds) - 1) // 2 + (len(speeds) % 2 == 0), len(speeds) - 1}))


def strength_node(index: float) -> float:
    return STRENGTH_ANCHOR * STRENGTH_RATIO**index


def interpolation_weights(nodes: Sequence[float] | FloatArray, at: float) -> FloatArray:
    """Lagrange weights (k,), not to be written to, of the polynomial through all nodes."""
    return _lagrange_weights(tuple(nodes), at)


def enclosing_weights(nodes: Sequence[float] | FloatArray, at: float) -> FloatArray:
    """Weights (k,), not to be written to, of the polynomial through the four nodes that enclose a place, two on either side where
    there are as many: nothing that is known farther off changes what is said here."""
    return _enclosing_weights(tuple(nodes), at)


def smooth_weights(nodes: Sequence[float] | FloatArray, at: float) -> FloatArray:
    """Weights (k,), not to be written to, of a curve through all nodes, smooth however many there are: the polynomial up to
    four, then a cubic spline.

    The polynomial through the nearest few jumps where their choice changes, and a slope taken across a jump leads astray.
    """
    nodes = tuple(nodes)
    return _lagrange_weights(nodes, at) if len(nodes) <= 4 else _spline_weights(nodes, at)


# every drop asks for the same weights for each of its errors and tangents
@lru_cache(maxsize=4096)
def _lagrange_weights(nodes: tuple[float, ...], at: float) -> FloatArray:
    own = np.eye(len(nodes), dtype=bool)
    apart = np.where(own, 1.0, np.subtract.outer(nodes, nodes))
    weights = np.where(own, 1.0, (at - np.array(nodes)) / apart).prod(axis=1)
    weights.flags.writeable = False
    return np.asarray(weights)


@lru_cache(maxsize=4096)
def _enclosing_weights(nodes: tuple[float, ...], at: float) -> FloatArray:
    order = np.argsort(nodes)
    below = int(np.searchsorted(np.array(nodes)[order], at)) - 2
    chosen = order[max(min(below, len(nodes) - 4), 0) :][:4]
    weights = np.zeros(len(nodes))
    weights[chosen] = _lagrange_weights(tuple(np.array(nodes)[chosen]), at)
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=4096)
def _spline_weights(nodes: tuple[float, ...], at: float) -> FloatArray:
    order = np.argsort(nodes)
    weights = np.empty(len(nodes))
    weights[order] = _unit_spline(tuple(np.array(nodes)[order]))(at)
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=256)
def _unit_spline(nodes: tuple[float, ...]) -> CubicSpline:
    return CubicSpline(nodes, np.eye(len(nodes)))


def set_nominal_drop(
    campaign: Campaign,
    projectile: Projectile,
    speed: float,
    p_m: float,
    cells: float,
    after_stop: float = SETTLING,
) -> DropSetting:
    """What the campaign states, as one drop: speed m/s, p_m Pa, cells spacings in a tip radius, after_stop of T_s."""
    return DropSetting(
        projectile=projectile,
        impact_speed=speed,
        material=set_value(campaign.material, p_m),
        filling_factor=campaign.sample.filling_factor,
        monomer_density=campaign.sample.monomer_density,
        gravity=campaign.gravity,
        geometry=campaign.geometry,
        spacing=projectile.tip_radius / cells,
        after_stop=after_stop,
    )


def set_push(setting: DropSetting, speed: float) -> DropSetting:
    """The same matter with the tip led from PUSHED[0] to PUSHED[1] tip radii at a speed (m/s), far from all walls, weightless."""
    radius = setting.projectile.tip_radius
    start, end = (each * radius for each in PUSHED)
    return setting.replace(
        motion=Led("pushed", start, (("speed", speed), ("end_depth", end))),
        impact_speed=1.0,
        gravity=0.0,
        width=10 * radius,
        depth=end + 5 * radius,
        duration=10.0 * (end - start) / speed,
    )


def hasten(setting: DropSetting) -> DropSetting:
    """A slow push as a faster one with the same answer: where ρ v² is small beside the resistance, speed enters by the rates of
    the law alone, and these are taken as slow as they are. A faster one stays as it is.

    The run's speed is where ρ v² is INERTIA of what a deep tip meets.
    """
    values = dict(setting.motion.values)
    material, slow = setting.material, values["speed"]
    law = find_law(material.law)
    density = setting.filling_factor * setting.monomer_density
    fast = math.sqrt(INERTIA * law.resistance(setting) / density)
    ratio = fast / slow
    if ratio <= 1.0:
        return setting
    constants = dict(material.constants)
    if constants.get("rate_eta", 0.0) > 0.0:
        constants["rate_eta"] *= ratio ** -read_constant(material, "rate_exponent")
    if constants.get("rate_log", 0.0) > 0.0:
        constants["rate_reference"] = read_constant(material, "rate_reference") * ratio
    return setting.replace(
        material=material.replace(constants=tuple(constants.items())),
        strength_rate=setting.strength_rate * ratio**-setting.strength_rate_exponent,
        motion=replace(setting.motion, values=tuple((values | {"speed": fast}).items())),
        duration=setting.duration / ratio,
    )


@dataclass
class RunGrid:
    """Access to runs of a request and group, each in the order of its speeds, and of the spacings at each."""

    campaign: Campaign
    store: RunStore
    groups: Sequence[ProjectileGroup]
    cells: int = DEFAULT_CELLS
    workers: int | None = None
    scheduler: str | None = None
    progress: Progress | None = None
    extension: Change | None = None  # of the nominal model, by a model.toml
    runs: dict[RunKey, list[AnyPart | FailedRun]] = field(default_factory=dict)
    integrated: set[RunKey] = field(default_factory=set)  # of these, those that are no simulations

    def setting(
        self, group: ProjectileGroup, speed: float, p_m: float, sparse: bool = False, rough: bool = False
    ) -> DropSetting:
        """The nominal model of the campaign for one node."""
        usual = self.cells
        if group.felt:
            usual = max(self.cells, FELT_CELLS)
        elif rough:
            usual = min(self.cells, max(COARSE_CELLS, self.cells * COARSE_CELLS // DEFAULT_CELLS))
        of_scan = COARSE_SCAN_CELLS if sparse or rough else SCAN_CELLS
        own = of_scan if group.is_scan else PUSH_CELLS if group.pushed else usual
        after_stop = SETTLING if group.is_scan or group.pushed or group.felt else LIFTING
        setting = set_nominal_drop(self.campaign, group.projectile, speed, p_m, own, after_stop)
        if group.pushed:
            setting = set_push(setting, speed)
        return setting if self.extension is None else self.extension(setting)

    def require(self, wanted: Sequence[Request], text: str) -> None:
        """Make sure that all runs of these requests are there."""
        missing = [
            (request, number)
            for request in dict.fromkeys(wanted)
            for number in range(len(self.groups))
            if request.of(number) not in self.runs
        ]
        # the nominal model first: laws rest on its runs
        self._simulate([each for each in missing if not each[0].integrated], text)
        self._simulate(self._integrate([each for each in missing if each[0].integrated], text), text)

    def _simulate(self, wanted: Sequence[tuple[Request, int]], text: str) -> None:
        """Run requests of groups."""
        settings: list[DropSetting] = []
        parts: list[Part] = []
        places = []
        for request, number in wanted:
            group = self.groups[number]
            asked = self._list_settings(request, number)
            settings += [hasten(setting) for setting in asked] if group.pushed else asked
            parts += [Push if group.pushed else Compaction if group.is_scan else Motion] * len(asked)
            places.append((request, number, len(asked)))
        runs = iter(self._get_parts(settings, parts, text))
        for request, number, count in places:
            self.runs[request.of(number)] = list(islice(runs, count))

    def _integrate(self, wanted: Sequence[tuple[Request, int]], text: str) -> list[tuple[Request, int]]:
        """Motions of films with laws on the projectile, from the nominal model's runs; what has to be simulated after all is
        returned: other groups, other laws."""
        rest: list[tuple[Request, int]] = []
        laws: dict[tuple[int, float], tuple[list[Motion], list[tuple[Request, list[DropSetting]]]]] = {}
        for request, number in wanted:
            plain = None if self.groups[number].is_scan else self.stopped_runs(request.base, number)
            settings = self._list_settings(replace(request, sparse=False, rough=False), number)
            if plain is not None and all(
                acts_on_projectile(run.setting, setting) for run, setting in zip(plain, settings, strict=True)
            ):
                known = laws.setdefault((number, request.index), (cast("list[Motion]", plain), []))
                known[1].append((request, settings))
            else:
                rest.append((request, number))
        for (number, _), (base, asked) in laws.items():
            found = deflect(base, [settings for _, settings in asked])
            beyond = [
                setting
                for (_, settings), motions in zip(asked, found, strict=True)
                for setting, motion in zip(settings, motions, strict=True)
                if motion is None
            ]
            runs = iter(self._get_parts(beyond, [Motion] * len(beyond), text))
            for (request, _), motions in zip(asked, found, strict=True):
                key = request.of(number)
                self.runs[key] = [next(runs) if motion is None else motion for motion in motions]
                self.integrated.add(key)
        return rest

    def deflect_runs(self, wanted: Sequence[Request], number: int) -> list[list[Motion] | None]:
        """Motions of films with laws on the projectile at one strength, from the nominal model's runs, which must be there; None
        for what leaves what these know."""
        base = self.stopped_runs(wanted[0].base, number)
        if base is None:
            return [None] * len(wanted)
        asked = [
            self._list_settings(replace(request, sparse=False, rough=False), number) for request in wanted
        ]
        found = deflect(cast("list[Motion]", base), asked)
        complete = ([run for run in motions if run is not None] for motions in found)
        return [motions if len(motions) == len(base) else None for motions in complete]

    def _list_settings(self, request: Request, number: int) -> list[DropSetting]:
        """Of one group, in the order of its speeds and spacings."""
        group, changed, settings = self.groups[number], request.variant != "", []
        for position in group.sparse if request.sparse else range(len(group.speeds)):
            strength = strength_node(request.index)
            setting = self.setting(group, group.speeds[position], strength, request.sparse, request.rough)
            setting = request.change(setting) if request.change is not None else setting
            for factor in group.spacings(request.sparse, position, changed):
                settings.append(setting.replace(spacing=factor * setting.spacing))
        return settings

    def _get_parts(
        self, settings: Sequence[DropSetting], parts: Sequence[Part], text: str
    ) -> list[AnyPart | FailedRun]:
        if not settings:
            return []
        return self.store.get_parts(
            settings,
            parts,
            workers=self.workers,
            scheduler=self.scheduler,
            progress=self.progress,
            text=text,
        )

    def stopped_runs(self, request: Request, number: int) -> list[AnyPart] | None:
        """Runs of one group, in the order of its speeds and spacings, or None where one failed or never stopped."""
        runs = self.runs[request.of(number)]
        good = [run for run in runs if not isinstance(run, FailedRun) and run.stopped]
        return good if len(good) == len(runs) else None
