"""What the simulation says a drop's camera should have recorded, for any p_m, speed and amplitudes of effects near the runs.

Codes of runs (curves.py) are interpolated in ln v over all speed nodes and in ln p_m over all strength nodes; an effect adds the
difference its own runs made, a polynomial in its amplitude that vanishes at null, linear between strength nodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..errors import ExtrapolationError
from ..records import FloatArray
from .curves import decode_depth, decode_rate
from .grid import interpolation_weights, strength_node

STANDARD_GRAVITY = 9.81


Changes = dict[int, dict[float, FloatArray]]


@dataclass
class ResponseTable:
    """Codes of one family. base : {strength index: (speeds, m)}; changes : {effect: {strength index: {amplitude: (few, m)}}}
    where the amplitude is the parameter minus its null and the arrays are differences from the base at the few speeds.
    fingerprints : the same from coarser runs, taken where there are no changes."""

    log_speeds: FloatArray
    few: tuple[int, ...]
    base: dict[int, FloatArray] = field(default_factory=dict)
    changes: dict[str, Changes] = field(default_factory=dict)
    fingerprints: dict[str, Changes] = field(default_factory=dict)

    def code(self, log_p_m: float, log_speed: float, amplitudes: Mapping[str, float]) -> FloatArray:
        """Interpolated code (m,)."""
        across = interpolation_weights(self.log_speeds, log_speed)
        nearest = sorted(self.base, key=lambda index: abs(math.log(strength_node(index)) - log_p_m))[:4]
        if not nearest:
            raise ExtrapolationError("simulation", "runs", "every run of one projectile failed; see labsim runs")
        nodes = np.array([math.log(strength_node(index)) for index in nearest])
        code = sum(
            weight * (across @ self.base[index])
            for index, weight in zip(nearest, interpolation_weights(nodes, log_p_m), strict=True)
        )
        for name, amplitude in amplitudes.items():
            if amplitude != 0.0 and (name in self.changes or name in self.fingerprints):
                code = code + self.change(name, log_p_m, amplitude, log_speed)
        return np.asarray(code)

    def change(self, name: str, log_p_m: float, amplitude: float, log_speed: float) -> FloatArray:
        """What an effect adds to the code, (m,)."""
        table = self.changes[name] if name in self.changes else self.fingerprints[name]
        across = interpolation_weights(self.log_speeds[list(self.few)], log_speed)
        available = sorted((index for index in table if table[index]), key=lambda index: strength_node(index))
        nodes = np.array([math.log(strength_node(index)) for index in available])
        values = []
        for index in available:
            known = sorted(table[index], key=lambda a: abs(a - amplitude))[:3]
            at = np.array([0.0, *known])
            weights = interpolation_weights(at, amplitude)[1:]
            values.append(sum(w * (across @ table[index][a]) for a, w in zip(known, weights, strict=True)))
        if len(values) == 1:
            return values[0]
        below = int(np.clip(np.searchsorted(nodes, log_p_m) - 1, 0, len(nodes) - 2))
        part = float(np.clip((log_p_m - nodes[below]) / (nodes[below + 1] - nodes[below]), -0.5, 1.5))
        return (1 - part) * values[below] + part * values[below + 1]


@dataclass(frozen=True)
class Instant:
    """Nuisances of one drop: contact on the true clock (s), ln of the true speed, offset of the surface row (m, stated scale)."""

    contact_time: float
    log_speed: float
    surface: float


def predict_depth(
    code: FloatArray,
    time: FloatArray,
    instant: Instant,
    pixel_factor: float,
    rate_factor: float,
    offset: float,
) -> FloatArray:
    """Stated depth (m) at stated times (s). offset: row offset of the surface, m on the stated scale."""
    clock = time / rate_factor - instant.contact_time
    speed = math.exp(instant.log_speed)
    fall = clock * (speed + 0.5 * STANDARD_GRAVITY * clock)
    depth = np.where(clock < 0.0, fall, decode_depth(code, np.maximum(clock, 0.0)))
    return depth / pixel_factor + offset + instant.surface


def predict_speed(
    code: FloatArray, time: FloatArray, instant: Instant, pixel_factor: float, rate_factor: float
) -> FloatArray:
    """Stated speed (m/s), derivative of predict_depth with respect to minus the contact time."""
    clock = time / rate_factor - instant.contact_time
    speed = math.exp(instant.log_speed)
    rate = np.where(clock < 0.0, speed + STANDARD_GRAVITY * clock, decode_rate(code, np.maximum(clock, 0.0)))
    return rate / pixel_factor
