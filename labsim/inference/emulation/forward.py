"""What the simulation says a drop's camera should have recorded, for any p_m, speed and amplitudes of effects near the runs.

Features of runs (curves.py) are interpolated in ln v over all speed nodes and in ln p_m between the nodes that enclose it: all
hypotheses rest on the same runs there, whichever others were asked for. An effect adds the difference its own runs made, a
smooth curve in its amplitude that vanishes at null, and one through all its strength nodes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...effects import Instrument, Parameter
from ...errors import ExtrapolationError
from ...records import STANDARD_GRAVITY, FloatArray
from .curves import interpolate_depth, interpolate_rate
from .grid import (
    SPEED_RATIO,
    STRENGTH_RATIO,
    enclosing_weights,
    interpolation_weights,
    smooth_weights,
    strength_node,
)

EXPOSED = 8  # times that an instant is put right by the tip's depth: each leaves speed times delay of the last change

Changes = dict[float, dict[float, FloatArray]]


class Layout(NamedTuple):
    """strengths : ln p_m of its nodes; grades : of the amplitudes at each, a null first; stacked : (amplitudes of all strengths
    times speeds, m)."""

    strengths: tuple[float, ...]
    grades: tuple[tuple[float, ...], ...]
    stacked: FloatArray


@dataclass
class ResponseTable:
    """Features of one group. base : {strength index: (speeds, m)}; changes : {effect: {strength index: {amplitude: (speeds, m)}}}
    where the amplitude is the parameter minus its null and the arrays are differences from the nominal model at all speeds.
    integrated : the same of laws on the projectile, from the nominal runs (deflection.py), taken where there are no changes;
    fingerprints : at the few speeds, taken where there are neither. trends : like ``integrated``, close about an estimate, and
    corrections : what changes say more, of laws on the projectile; both together are taken before all. parameters : of effects
    whose amplitudes have a grade of their own. absent : effects that are not at work in what the table stands for."""

    log_speeds: FloatArray
    sparse: tuple[int, ...]
    base: dict[float, FloatArray] = field(default_factory=dict)
    changes: dict[str, Changes] = field(default_factory=dict)
    integrated: dict[str, Changes] = field(default_factory=dict)
    fingerprints: dict[str, Changes] = field(default_factory=dict)
    trends: dict[str, Changes] = field(default_factory=dict)
    corrections: dict[str, Changes] = field(default_factory=dict)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    absent: frozenset[str] = frozenset()
    _stacks: dict[int, tuple[Mapping[float, FloatArray], FloatArray]] = field(
        default_factory=dict, repr=False, compare=False
    )
    _layouts: dict[tuple[str, int], tuple[Changes, tuple[int, Parameter | None], Layout]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def features(self, log_p_m: float, log_speed: float, amplitudes: Mapping[str, float]) -> FloatArray:
        """Interpolated features (m,)."""
        return self.at(log_p_m, log_speed).features(amplitudes)

    def at(self, log_p_m: float, log_speed: float) -> Response:
        """What the runs say at one strength and speed, as at half a node beyond them where a fit that leads nowhere asks for a
        speed farther off. Raises ExtrapolationError where no run says anything."""
        if not self.base:
            raise ExtrapolationError(
                "simulation", "runs", "every run of one projectile failed; see labsim runs"
            )
        beyond = 0.5 * math.log(SPEED_RATIO)
        log_speed = min(max(log_speed, self.log_speeds[0] - beyond), self.log_speeds[-1] + beyond)
        across = interpolation_weights(self.log_speeds, log_speed)
        weights = enclosing_weights(_log_strengths(self.base), log_p_m)
        plain = np.outer(weights, across).ravel() @ self.stack(self.base)
        return Response(self, log_p_m, log_speed, across, plain)

    def knows(self, name: str) -> bool:
        """Whether some run says what an effect changes, fingerprints where there are no others."""
        return any(next((kept[name] for kept in self.kinds if kept.get(name)), {}).values())

    @property
    def kinds(self) -> tuple[dict[str, Changes], ...]:
        """What effects change, the kind that is taken first in front."""
        return self.changes, self.integrated, self.fingerprints

    def correct(self, name: str) -> None:
        """Say what runs of a law say more than its trend, wherever there are both."""
        known = self.trends[name]
        more: Changes = {
            index: {a: change - known[index][a] for a, change in by_amplitude.items() if a in known[index]}
            for index, by_amplitude in self.changes.get(name, {}).items()
            if index in known
        }
        if any(more.values()):
            self.corrections[name] = more

    def grade(self, name: str, amplitude: float) -> float:
        """Where an amplitude of an effect lies on the scale on which features are interpolated."""
        return self.parameters[name].grade(amplitude) if name in self.parameters else amplitude

    def lay_out(self, name: str, runs: Changes) -> Layout:
        """What an effect changes, laid out for interpolation; kept, since mappings only grow."""
        state = sum(map(len, runs.values())), self.parameters.get(name)
        known, before, laid = self._layouts.get((name, id(runs)), (None, None, None))
        if laid is None or known is not runs or before != state:
            by_strength = {index: runs[index] for index in runs if runs[index]}
            grades = [
                (0.0, *(self.grade(name, amplitude) for amplitude in each)) for each in by_strength.values()
            ]
            arrays = [array for each in by_strength.values() for array in each.values()]
            stacked = np.concatenate(arrays) if arrays else np.empty((0, 0))
            laid = Layout(tuple(_log_strengths(by_strength)), tuple(grades), stacked)
            self._layouts[name, id(runs)] = runs, state, laid
        return laid

    def stack(self, features: Mapping[float, FloatArray]) -> FloatArray:
        """The features of one mapping of this table as (its entries times speeds, m); kept, since mappings only grow."""
        # ids of a table that came from another process mean nothing: the mapping itself is compared
        known, stacked = self._stacks.get(id(features), (None, None))
        if stacked is None or known is not features or len(stacked) != sum(map(len, features.values())):
            stacked = np.concatenate(list(features.values()))
            self._stacks[id(features)] = features, stacked
        return stacked


@dataclass(frozen=True)
class Response:
    """A table at one strength and speed. across : (speeds,) weights of its speeds; plain : (m,) features without any effect."""

    table: ResponseTable
    log_p_m: float
    log_speed: float
    across: Float[np.ndarray, " speeds"]
    plain: Float[np.ndarray, " m"]

    def features(self, amplitudes: Mapping[str, float]) -> FloatArray:
        """The features (m,) with effects; that of ``plain`` itself where none of them has runs in the table."""
        features = self.plain
        for name, amplitude in amplitudes.items():
            known = any(name in kept for kept in self.table.kinds)
            if amplitude != 0.0 and known and name not in self.table.absent:
                features = features + self.change(name, amplitude)
        return features

    def change(self, name: str, amplitude: float) -> FloatArray:
        """What an effect adds to the features, (m,)."""
        if name in self.table.corrections:
            trend, more = self.table.trends[name], self.table.corrections[name]
            return self._interpolate(name, trend, amplitude) + self._interpolate(name, more, amplitude)
        kept = next(kept for kept in self.table.kinds if name in kept)
        if kept is self.table.fingerprints:
            sparse = self.table.log_speeds[list(self.table.sparse)]
            across = interpolation_weights(sparse, self.log_speed)
            return self._interpolate(name, kept[name], amplitude, across)
        return self._interpolate(name, kept[name], amplitude)

    def _interpolate(
        self, name: str, runs: Changes, amplitude: float, across: FloatArray | None = None
    ) -> FloatArray:
        """Changes at this strength and an amplitude. across : weights of the speeds, if not those of the table."""
        across = self.across if across is None else across
        laid = self.table.lay_out(name, runs)
        if not laid.strengths:
            raise ExtrapolationError("simulation", name, "every run with it failed; see labsim runs")
        margin = 0.5 * math.log(STRENGTH_RATIO)
        inside = min(max(self.log_p_m, min(laid.strengths) - margin), max(laid.strengths) + margin)
        grade = self.table.grade(name, amplitude)
        along = smooth_weights(laid.strengths, inside)
        shares = [
            weight * smooth_weights(grades, grade)[1:]
            for weight, grades in zip(along, laid.grades, strict=True)
        ]
        change: FloatArray = np.multiply.outer(np.concatenate(shares), across).ravel() @ laid.stacked
        return change


def _log_strengths(indices: Iterable[float]) -> list[float]:
    """ln of p_m at strength nodes."""
    return [math.log(strength_node(index)) for index in indices]


class Instant(NamedTuple):
    """Nuisances of one drop: contact on the true clock (s), ln of the true speed, offset of the surface row (m, stated scale)."""

    contact_time: float
    log_speed: float
    surface: float
    strength: float = 0.0


def predict_depth(
    features: FloatArray, time: FloatArray, instant: Instant, instrument: Instrument, offset: float
) -> FloatArray:
    """Stated depth (m) at stated times (s). offset: row offset of the surface, m on the stated scale."""
    depth = _fall(features, _read_clock(features, time, instant, instrument), instant)
    return depth / instrument.pixel_factor + offset + instant.surface


def predict_speed(
    features: FloatArray, time: FloatArray, instant: Instant, instrument: Instrument
) -> FloatArray:
    """Stated speed (m/s), derivative of predict_depth with respect to minus the contact time."""
    clock = _read_clock(features, time, instant, instrument)
    speed = math.exp(instant.log_speed)
    rate = np.where(
        clock < 0.0, speed + STANDARD_GRAVITY * clock, interpolate_rate(features, np.maximum(clock, 0.0))
    )
    return rate / instrument.pixel_factor


def _read_clock(
    features: FloatArray, time: FloatArray, instant: Instant, instrument: Instrument
) -> FloatArray:
    """True times from contact (s) at which the tip was seen where frames of these stated times (s) show it."""
    clock = instrument.true_time(time) - instant.contact_time
    clock = clock * (1.0 + 0.5 * instrument.clock_drift * clock)
    if instrument.row_delay == 0.0:
        return clock
    released = -math.exp(instant.log_speed) / STANDARD_GRAVITY  # before that the tip hangs still
    exposed = clock
    for _ in range(EXPOSED):  # where it is says when its row is read
        exposed = clock + instrument.row_delay * _fall(features, np.maximum(exposed, released), instant)
    return exposed


def _fall(features: FloatArray, clock: FloatArray, instant: Instant) -> FloatArray:
    """True depth (m) at true times from contact (s)."""
    fall = clock * (math.exp(instant.log_speed) + 0.5 * STANDARD_GRAVITY * clock)
    return np.where(clock < 0.0, fall, interpolate_depth(features, np.maximum(clock, 0.0)))
