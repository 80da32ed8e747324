"""Where about an estimate runs are made: nodes of p_m on the fixed grid, and of an effect's amplitude."""

from __future__ import annotations

import math

from ...effects import Cauchy, Effect
from .grid import STRENGTH_ANCHOR, STRENGTH_RATIO

LADDER = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)  # steps of an effect that runs are made of
# further ones, of laws whose size nobody knows: in p12 as much dust sticks to the tip as 33 steps
FURTHER = (16.0, 24.0, 32.0, 48.0)
SPARSE_LADDER = (1.0, 3.0, 8.0)  # the same where they are few


def place_strength(log_p_m: float) -> float:
    """Where a strength lies among the nodes: an integer at a node."""
    return (log_p_m - math.log(STRENGTH_ANCHOR)) / math.log(STRENGTH_RATIO)


def enclosing_nodes(
    log_p_m: float, p_m_range: tuple[float, float] = (0.0, math.inf), step: float = 1.0
) -> list[float]:
    """The four strength nodes about a value, ``step`` apart; none beyond those that enclose the range (Pa), where soft dust costs
    most."""
    below = math.floor(place_strength(log_p_m) / step)
    low, high = p_m_range
    if math.isfinite(high):
        below = min(below, math.ceil(place_strength(math.log(high)) / step) - 2)
    if low > 0.0:
        below = max(below, math.floor(place_strength(math.log(low)) / step) + 1)
    return [step * each for each in (below - 1, below, below + 1, below + 2)]


def nearest_nodes(log_p_m: float, step: float = 1.0, share: float = 0.3) -> list[float]:
    """The nearest strength node, and the next one where the value lies well between two."""
    place = place_strength(log_p_m) / step
    near = round(place)
    if abs(place - near) <= share:
        return [step * near]
    return [step * math.floor(place), step * math.ceil(place)]


def nodes_around(log_p_m: float) -> list[float]:
    """Three strengths about an estimate, half a node apart, on a grid of their own that estimates share.

    A node apart, what a shear factor of 0.6 adds to the depth is off by 0.2 to 1.7 % of it between them.
    """
    near = round(2.0 * place_strength(log_p_m)) / 2.0
    return [near - 0.5, near, near + 0.5]


def screening_node(log_p_m: float) -> int:
    """Every second strength node: what an effect does to ln D changes little within a factor of two of p_m, and campaigns
    whose nominal p_m an effect has driven off still share their fingerprints' runs."""
    return 2 * round(0.5 * place_strength(log_p_m))


def _list_steps(effect: Effect, sparse: bool) -> tuple[float, ...]:
    """Of an effect, rising, that runs are made of."""
    if sparse:
        return SPARSE_LADDER
    return LADDER + FURTHER if isinstance(effect.amplitudes[0].prior, Cauchy) else LADDER


def hold_known(effect: Effect, amplitude: float, *, sparse: bool = False) -> float:
    """An amplitude kept within the largest that runs are made of: about a p_m that has run away tangents ask for anything."""
    parameter = effect.amplitudes[0]
    most = _list_steps(effect, sparse)[-1] * abs(parameter.grade(parameter.step))
    inside = parameter.hold(amplitude) - parameter.null
    grade = parameter.grade(inside)
    return parameter.amplitude_at(math.copysign(most, grade)) if abs(grade) > most else inside


def is_farthest(effect: Effect, amplitude: float) -> bool:
    """Whether the last runs of the ladder, not a limit of the parameter, end an amplitude."""
    parameter = effect.amplitudes[0]
    further = parameter.hold(2.0 * amplitude) - parameter.null
    return not math.isclose(further, amplitude) and math.isclose(hold_known(effect, further), amplitude)


def amplitude_nodes(
    effect: Effect,
    amplitude: float,
    *,
    sparse: bool = False,
    around: bool = False,
    bent: bool = False,
    side: float = 1.0,
) -> list[float]:
    """Amplitudes to simulate about an estimate: multiples of the effect's step by their grade, at least one, inside its limits.

    side : 1 or -1, of the step, at a null. around : one more beyond them, so that the curve between two does not depend on the
    side that the estimate came from. bent : between nodes a quarter of the step apart, half of it beyond the first. sparse :
    with few of them.
    """
    parameter = effect.amplitudes[0]
    step = parameter.step
    unit = parameter.grade(step)
    place = parameter.grade(amplitude) / unit
    sign = math.copysign(1.0, place) if place != 0.0 else side  # a null over a negative step is -0.0
    # of the numerics, much finer runs would cost more than they say
    if effect.kind == "numerics" or (abs(place) <= 1.0 and not bent):
        wanted = [sign]
    else:
        ladder = _list_steps(effect, sparse)
        if bent:
            ladder = tuple(sorted({0.5, *ladder} if sparse else {0.25, 0.5, 0.75, 1.5, *ladder}))
        above = [m for m in ladder if m >= abs(place)] or [ladder[-1]]
        below = [m for m in ladder if m < abs(place)] or above[1:2]
        wanted = [sign * below[-1], *(sign * m for m in above[: 1 + around])]
    nodes = []
    for m in wanted:
        value = parameter.hold(parameter.amplitude_at(m * unit)) - parameter.null
        if value == 0.0:  # the limit is the null on that side
            value = step
        if value not in nodes:
            nodes.append(value)
    return nodes
