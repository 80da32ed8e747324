"""Motions with a further force on the projectile, from runs without it: no run is made.

A law that acts on the projectile alone changes the dust only by how the tip comes through it. At a depth z and a speed v the dust
is taken to be as in the drop without the law that passes there as fast, whatever way led to it. Runs at several impact speeds v0
are such drops: z = Z(τ, l), v = V(τ, l) with τ the time over their stopping time T and l = ln v0. The law changes v, not z:

    Z_τ dτ + Z_l dl = 0,  V_τ dτ + V_l dl = a dt,  and dτ = dt/T as without it

where a is the acceleration more than without it. The drop stops where τ = 1 and springs back as the one it has come to be.
How near that comes to simulations: docs/deflection.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from ...records import FloatArray
from ...runs.parts import Motion
from ...sph import DropSetting
from ...sph.state import REST

FORCES = (
    "force_of_depth",
    "force_of_speed",
    "force_of_time",
    "viscosity_of_depth",
    "drag_of_depth",
    "mass_of_depth",
    "gathered_of_depth",
)
STEPS, LONGEST = 150, 4  # a stopping time; stopping times without the law within which a drop has to stop
BEYOND = 0.44  # of ln v0, past the slowest and the fastest run: farther away nothing is known
SAMPLED, DEEPER = 2000, 2.0  # places at which a law is known; how far down, in depths of the deepest run
TOWARDS_STOP = np.linspace(0.0, 1.0, 41)  # stopping times
# (log_speeds, fractions, ends, shapes) of _Paths, (tables, reach, mass, gravity) of _Law
PathArrays: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
LawArrays: TypeAlias = tuple[FloatArray, FloatArray, float, float]
# tables of a law: what it adds to the forces, the mass that it adds or gathers, the same without it, how fast gathered mass grows
FORCE, VISCOSITY, DRAG, OF_SPEED, OF_TIME, STUCK, STUCK_BEFORE, GROWTH = range(8)


def acts_on_projectile(plain: DropSetting, changed: DropSetting) -> bool:
    """Whether a changed drop is the plain one, but for what acts on the projectile alone."""
    return changed.replace(**{key: getattr(plain, key) for key in FORCES}) == plain


def deflect(runs: Sequence[Motion], changed: Sequence[Sequence[DropSetting]]) -> list[list[Motion | None]]:
    """Motions of drops with laws on their projectile.

    Parameters
    ----------
    runs : (k,) of one drop without them, at rising impact speeds, all of which stopped.
    changed : for each law, the (k,) settings at the same speeds. All must pass ``acts_on_projectile``.

    Returns
    -------
    list
        For each law (k,) motions; None for one that leaves what the runs know.
    """
    paths = _Paths(runs)
    flat = [setting for settings in changed for setting in settings]
    plain = [run.setting for run in runs] * len(changed)
    law = _Law(
        flat,
        plain,
        DEEPER * max(run.penetration_depth for run in runs),
        LONGEST * max(run.stopping_time for run in runs),
    )
    motions: list[Motion | None] = []
    for i, setting in enumerate(flat):
        start = paths.log_speeds[i % len(runs)]
        way = np.zeros((LONGEST * STEPS + 1, 3))
        way[0, 2] = math.exp(start)
        length, log_speed = _fall(way, start, paths.arrays, law.of(i))
        motions.append(_describe(setting, way[:length], paths, log_speed) if length else None)
    return [motions[i : i + len(runs)] for i in range(0, len(flat), len(runs))]


@njit(cache=True)
def _fall(way: FloatArray, log_speed: float, paths: PathArrays, law: LawArrays) -> tuple[int, float]:
    """Go one drop's way by steps to their middle; number of rows, none where it leaves what the runs know, and its ln v0 then.

    way : (steps + 1, 3) time, depth and speed, written to from the second row on.
    """
    low, high = paths[0][0] - BEYOND, paths[0][-1] + BEYOND
    at, time = 0.0, 0.0
    stop, z, v, rate_at, rate_l = _move(at, log_speed, time, paths, law)
    step = stop / STEPS
    for row in range(1, len(way)):
        half = 0.5 * step
        _, _, _, rate_at, rate_l = _move(
            at + half * rate_at, log_speed + half * rate_l, time + half, paths, law
        )
        last = at + step * rate_at >= 1.0
        own = (1.0 - at) / max(rate_at, 1e-300) if last else step
        at, log_speed, time = at + own * rate_at, log_speed + own * rate_l, time + own
        _, z, v, rate_at, rate_l = _move(at, log_speed, time, paths, law)
        way[row, 0], way[row, 1], way[row, 2] = time, z, v
        if not (low < log_speed < high) or at <= -1.0:
            return 0, log_speed
        if last:
            return row + 1, log_speed
    return 0, log_speed


@njit(cache=True)
def _move(
    at: float, log_speed: float, time: float, paths: PathArrays, law: LawArrays
) -> tuple[float, float, float, float, float]:
    """Stopping time, depth, speed, and the rates of τ and ln v0."""
    log_speed = min(max(log_speed, paths[0][0] - BEYOND), paths[0][-1] + BEYOND)
    stop, z, z_at, z_l, v, v_at, v_l = _locate(min(at, 1.0), log_speed, paths)
    more = _accelerate(z, max(v, 0.0), time, v_at / stop, law)
    rigid = z_at * v_l - z_l * v_at
    return stop, z, v, 1.0 / stop - z_l * more / rigid, z_at * more / rigid


@njit(cache=True)
def _locate(
    at: float, log_speed: float, paths: PathArrays
) -> tuple[float, float, float, float, float, float, float]:
    """Stopping time (s); depth (m) and speed (m/s), each with its derivatives by τ and ln v0."""
    log_speeds, fractions, ends, shapes = paths
    j = min(max(int(np.searchsorted(log_speeds, log_speed, "right")) - 1, 0), len(log_speeds) - 2)
    i = min(max(int(np.searchsorted(fractions, at, "right")) - 1, 0), len(fractions) - 2)
    dl, dt = log_speed - log_speeds[j], at - fractions[i]
    log_depth, log_stop, d_depth, d_stop = 0.0, 0.0, 0.0, 0.0
    for q in range(4):  # powers of dl, the highest first, by Horner's rule for the value and its derivative
        d_depth, log_depth = d_depth * dl + log_depth, log_depth * dl + ends[q, j, 0]
        d_stop, log_stop = d_stop * dl + log_stop, log_stop * dl + ends[q, j, 1]
    shape, shape_1, shape_2, shape_l, shape_1l = 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(4):
        value, by_l = 0.0, 0.0
        for q in range(4):
            by_l, value = by_l * dl + value, value * dl + shapes[p, i, q, j]
        shape_2 = shape_2 * dt + 2.0 * shape_1
        shape_1, shape = shape_1 * dt + shape, shape * dt + value
        shape_1l, shape_l = shape_1l * dt + shape_l, shape_l * dt + by_l
    depth, stop = math.exp(log_depth), math.exp(log_stop)
    rate = depth / stop
    return (
        stop,
        depth * shape,
        depth * shape_1,
        depth * (d_depth * shape + shape_l),
        rate * shape_1,
        rate * shape_2,
        rate * ((d_depth - d_stop) * shape_1 + shape_1l),
    )


@njit(cache=True)
def _accelerate(depth: float, speed: float, time: float, before: float, law: LawArrays) -> float:
    """Acceleration (m/s²) more than ``before``, of the plain drop there."""
    tables, reach, mass, gravity = law
    down, fast, long = depth / reach[0], speed / reach[1], time / reach[2]
    force = _read(tables[OF_SPEED], fast) + _read(tables[OF_TIME], long)
    force *= speed / (speed + REST)
    force += _read(tables[FORCE], down) + _read(tables[VISCOSITY], down) * speed
    force += (_read(tables[DRAG], down) + _read(tables[GROWTH], down)) * speed**2
    resisted = (mass + _read(tables[STUCK_BEFORE], down)) * (gravity - before) + force
    return gravity - before - resisted / (mass + _read(tables[STUCK], down))


@njit(cache=True)
def _read(table: FloatArray, share: float) -> float:
    """An evenly sampled table at a share of its length; constant beyond its ends."""
    place = min(max(share, 0.0), 1.0) * (len(table) - 1)
    cell = min(int(place), len(table) - 2)
    return table[cell] + (place - cell) * (table[cell + 1] - table[cell])


def _describe(setting: DropSetting, way: FloatArray, paths: _Paths, log_speed: float) -> Motion:
    """The way down as integrated, the way back up of the drop without the law that this one has come to be."""
    time, depth, speed = way.T
    after = paths.fractions[paths.fractions > 1.0]
    stop, z, v = paths.at(after, log_speed)
    return Motion(
        setting,
        np.concatenate([time, time[-1] + (after - 1.0) * stop]),
        np.concatenate([depth, z]),
        np.concatenate([speed, v]),
        float(depth[-1]),
        float(time[-1]),
        True,
    )


class _Paths:
    """Runs of one drop at rising impact speeds: ln D, ln T and depth over D at ``fractions`` of T, cubic in ln v0 and in those.

    arrays : ln v0 (k,); fractions (f,); of ln D and ln T (4, k - 1, 2) and of shapes (4, f - 1, 4, k - 1) the coefficients of
    powers, the highest first.
    """

    def __init__(self, runs: Sequence[Motion]) -> None:
        self.log_speeds = np.log([run.setting.impact_speed for run in runs])
        end = 1.0 + min(run.setting.after_stop for run in runs)
        self.fractions = np.concatenate([TOWARDS_STOP, np.arange(1.025, end, 0.025)])
        ends = [[math.log(run.penetration_depth), math.log(run.stopping_time)] for run in runs]
        shapes = [run.depth_at(self.fractions * run.stopping_time) / run.penetration_depth for run in runs]
        across = CubicSpline(self.log_speeds, np.array(shapes)).c
        along = CubicSpline(self.fractions, np.moveaxis(across, 2, 0)).c
        of_ends = CubicSpline(self.log_speeds, np.array(ends)).c
        self.arrays: PathArrays = self.log_speeds, self.fractions, of_ends, np.ascontiguousarray(along)

    def at(self, fractions: FloatArray, log_speed: float) -> tuple[float, FloatArray, FloatArray]:
        """Stopping time (s), depths (m) and speeds (m/s) at fractions of it."""
        found = np.array([_locate(each, log_speed, self.arrays) for each in fractions])
        return found[0, 0], found[:, 1], found[:, 4]


class _Law:
    """What changed settings add to the plain ones' acceleration, of many drops: (drops, 8, SAMPLED) tables, sampled evenly."""

    def __init__(
        self, changed: Sequence[DropSetting], plain: Sequence[DropSetting], deepest: float, longest: float
    ) -> None:
        self.mass = [setting.projectile.mass for setting in changed]
        self.gravity = [setting.gravity for setting in changed]
        self.reach = np.array([deepest, 2.0 * max(setting.impact_speed for setting in changed), longest])
        depths, speeds, times = (np.linspace(0.0, end, SAMPLED) for end in self.reach)
        self.tables = np.zeros((len(changed), 8, SAMPLED))

        def more(key: str, places: FloatArray) -> FloatArray:
            return _tabulate(changed, key, places) - _tabulate(plain, key, places)

        self.tables[:, FORCE] = more("force_of_depth", depths)
        self.tables[:, VISCOSITY] = more("viscosity_of_depth", depths)
        self.tables[:, DRAG] = more("drag_of_depth", depths)
        self.tables[:, OF_SPEED] = more("force_of_speed", speeds)
        self.tables[:, OF_TIME] = more("force_of_time", times)
        gathered, gathered_before = (
            _tabulate(settings, "gathered_of_depth", depths) for settings in (changed, plain)
        )
        self.tables[:, STUCK] = gathered + _tabulate(changed, "mass_of_depth", depths)
        self.tables[:, STUCK_BEFORE] = gathered_before + _tabulate(plain, "mass_of_depth", depths)
        self.tables[:, GROWTH] = np.gradient(gathered - gathered_before, depths, axis=1)

    def of(self, number: int) -> LawArrays:
        """Of one drop: its tables, where they end (depth m, speed m/s, time s), its mass and gravity."""
        return self.tables[number], self.reach, self.mass[number], self.gravity[number]


def _tabulate(settings: Sequence[DropSetting], key: str, places: FloatArray) -> FloatArray:
    """(settings, places) values of a table of knots; nought where there is none."""
    known: dict[tuple[tuple[float, float], ...], FloatArray] = {(): np.zeros(places.size)}
    for setting in settings:
        table = getattr(setting, key)
        if table not in known:
            known[table] = np.interp(places, *np.transpose(table))
    return np.stack([known[getattr(setting, key)] for setting in settings])
