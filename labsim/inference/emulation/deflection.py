"""Motions with a further force on the projectile, from runs without it: no run is made.

A law that acts on the projectile alone changes the dust only by how the tip comes through it. At a depth z and a speed v the dust
is taken to be as in the drop without the law that passes there as fast, whatever way led to it. Runs at several impact speeds v0
are such drops: z = Z(τ, l), v = V(τ, l) with τ the time over their stopping time T and l = ln v0. The law changes v, not z:

    Z_τ dτ + Z_l dl = 0,  V_τ dτ + V_l dl = a dt,  and dτ = dt/T as without it

where a is the acceleration more than without it. The drop stops where τ = 1 and springs back as the one it has come to be.
How near that comes to simulations: docs/deflection.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
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
    n, k = len(flat), len(runs)
    start = np.tile(paths.log_speeds, len(changed))
    at, log_speed, time = np.zeros(n), start.copy(), np.zeros(n)
    step = np.exp(paths.at(start)[0][:, 1]) / STEPS
    going = np.ones(n, dtype=bool)
    logs: list[tuple[FloatArray, FloatArray, FloatArray]] = [(time.copy(), np.zeros(n), np.exp(start))]
    low, high = paths.log_speeds[0] - BEYOND, paths.log_speeds[-1] + BEYOND

    def move(
        at: FloatArray, log_speed: FloatArray, time: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Rates of τ and l, depths and speeds."""
        inside, known = np.minimum(at, 1.0), np.clip(log_speed, low, high)
        stop, (z, z_at, z_l), (v, v_at, v_l) = paths.find_derivatives(inside, known)
        push = law.accelerate(z, np.maximum(v, 0.0), time, v_at / stop)
        rigid = z_at * v_l - z_l * v_at
        return 1.0 / stop - z_l * push / rigid, z_at * push / rigid, z, v

    rate_at, rate_l, _, _ = move(at, log_speed, time)
    for _ in range(LONGEST * STEPS):
        rate_at, rate_l, _, _ = move(
            at + 0.5 * step * rate_at, log_speed + 0.5 * step * rate_l, time + 0.5 * step
        )
        ends = at + step * rate_at >= 1.0
        own = np.where(ends, (1.0 - at) / np.maximum(rate_at, 1e-300), step) * going
        at, log_speed, time = at + own * rate_at, log_speed + own * rate_l, time + own
        rate_at, rate_l, z, v = move(at, log_speed, time)
        logs.append((time.copy(), z, v))
        going &= ~ends & (log_speed > low) & (log_speed < high) & (at > -1.0)
        if not going.any():
            break
    good = (at > 1.0 - 1e-9) & (log_speed > low) & (log_speed < high)
    times, depths, speeds = (np.stack(each, axis=1) for each in zip(*logs, strict=True))
    motions = [
        _describe(flat[i], times[i], depths[i], speeds[i], paths, log_speed[i]) if good[i] else None
        for i in range(n)
    ]
    return [motions[i : i + k] for i in range(0, n, k)]


def _describe(
    setting: DropSetting,
    time: FloatArray,
    depth: FloatArray,
    speed: FloatArray,
    paths: _Paths,
    log_speed: float,
) -> Motion:
    """The way down as integrated, the way back up of the drop without the law that this one has come to be."""
    last = int(np.argmax(time))
    after = paths.fractions[paths.fractions > 1.0]
    stop, (z, _, _), (v, _, _) = paths.find_derivatives(after, np.full(after.size, log_speed))
    return Motion(
        setting,
        np.concatenate([time[: last + 1], time[last] + (after - 1.0) * stop]),
        np.concatenate([depth[: last + 1], z]),
        np.concatenate([speed[: last + 1], v]),
        float(depth[last]),
        float(time[last]),
        True,
    )


class _Paths:
    """Runs of one drop at rising impact speeds: ln D, ln T and depth over D at ``fractions`` of T, cubic in ln v0."""

    def __init__(self, runs: Sequence[Motion]) -> None:
        self.log_speeds = np.log([run.setting.impact_speed for run in runs])
        end = 1.0 + min(run.setting.after_stop for run in runs)
        self.fractions = np.concatenate([TOWARDS_STOP, np.arange(1.025, end, 0.025)])
        features = [
            [
                np.log(run.penetration_depth),
                np.log(run.stopping_time),
                *(run.depth_at(self.fractions * run.stopping_time) / run.penetration_depth),
            ]
            for run in runs
        ]
        self._across = CubicSpline(self.log_speeds, np.array(features))
        self._by_speed = self._across.derivative()
        along = CubicSpline(self.fractions, np.eye(self.fractions.size))
        self._along = along, along.derivative(), along.derivative(2)

    def at(self, log_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Features (n, m) and their derivative by ln v0."""
        return self._across(log_speed), self._by_speed(log_speed)

    def find_derivatives(
        self, at: FloatArray, log_speed: FloatArray
    ) -> tuple[
        FloatArray, tuple[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]
    ]:
        """Stopping times (s); depth (m) and speed (m/s), each with its derivatives by τ and ln v0."""
        features, by_speed = self.at(log_speed)
        depth, stop = np.exp(features[:, 0]), np.exp(features[:, 1])
        d_depth, d_stop = by_speed[:, 0], by_speed[:, 1]
        shape, shape_1, shape_2 = (
            np.einsum("nf,nf->n", spline(at), features[:, 2:]) for spline in self._along
        )
        shape_l, shape_1l = (np.einsum("nf,nf->n", spline(at), by_speed[:, 2:]) for spline in self._along[:2])
        rate = depth / stop
        return (
            stop,
            (depth * shape, depth * shape_1, depth * (d_depth * shape + shape_l)),
            (rate * shape_1, rate * shape_2, rate * ((d_depth - d_stop) * shape_1 + shape_1l)),
        )


class _Law:
    """What changed settings add to the plain ones' acceleration, of many drops at once; tables sampled evenly."""

    def __init__(
        self, changed: Sequence[DropSetting], plain: Sequence[DropSetting], deepest: float, longest: float
    ) -> None:
        self.mass = np.array([setting.projectile.mass for setting in changed])
        self.gravity = np.array([setting.gravity for setting in changed])
        fastest = 2.0 * max(setting.impact_speed for setting in changed)
        self.ends = deepest, fastest, longest
        depths, speeds, times = (np.linspace(0.0, end, SAMPLED) for end in self.ends)

        def more(key: str, places: FloatArray) -> FloatArray:
            return _tabulate(changed, key, places) - _tabulate(plain, key, places)

        self.force, self.viscosity, self.drag = (
            more(key, depths) for key in ("force_of_depth", "viscosity_of_depth", "drag_of_depth")
        )
        self.of_speed, self.of_time = more("force_of_speed", speeds), more("force_of_time", times)
        gathered, gathered_before = (
            _tabulate(settings, "gathered_of_depth", depths) for settings in (changed, plain)
        )
        self.stuck = gathered + _tabulate(changed, "mass_of_depth", depths)
        self.stuck_before = gathered_before + _tabulate(plain, "mass_of_depth", depths)
        self.growth = np.gradient(gathered - gathered_before, depths, axis=1)

    def accelerate(
        self, depth: FloatArray, speed: FloatArray, time: FloatArray, before: FloatArray
    ) -> FloatArray:
        """Acceleration (m/s²) more than ``before``, of the plain drop there."""
        down, fast, long = self.ends
        force = _read(self.of_speed, speed / fast) + _read(self.of_time, time / long)
        force *= speed / (speed + REST)
        force += _read(self.force, depth / down) + _read(self.viscosity, depth / down) * speed
        force += (_read(self.drag, depth / down) + _read(self.growth, depth / down)) * speed**2
        resisted = (self.mass + _read(self.stuck_before, depth / down)) * (self.gravity - before) + force
        return self.gravity - before - resisted / (self.mass + _read(self.stuck, depth / down))


def _tabulate(settings: Sequence[DropSetting], key: str, places: FloatArray) -> FloatArray:
    """(settings, places) values of a table of knots; nought where there is none."""
    known: dict[tuple[tuple[float, float], ...], FloatArray] = {(): np.zeros(places.size)}
    for setting in settings:
        table = getattr(setting, key)
        if table not in known:
            known[table] = np.interp(places, *np.transpose(table))
    return np.stack([known[getattr(setting, key)] for setting in settings])


def _read(tables: FloatArray, share: FloatArray) -> FloatArray:
    """One value of each of (n, SAMPLED) evenly sampled tables, at a share of their length; beyond the ends they are constant."""
    place = np.clip(share, 0.0, 1.0) * (SAMPLED - 1)
    cell = np.minimum(place.astype(int), SAMPLED - 2)
    rows = np.arange(len(tables))
    below, above = tables[rows, cell], tables[rows, cell + 1]
    return below + (place - cell) * (above - below)
