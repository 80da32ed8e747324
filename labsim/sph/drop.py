"""One drop from first contact to a little after the stop: ``simulate(setting) -> DropRun``.

The compiled ``advance`` makes many steps; Python looks at the time step, at NaN and at the neighbour lists between them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SimulationError
from ..records import FloatArray
from . import particles as rows
from .kernels.lines import ROOM, WIDTH, make_lines, make_rows
from .kernels.neighbours import Neighbours
from .loop import load_loop
from .materials import find_law
from .particles import WALL_LAYERS, name_rows, place_particles
from .profile import measure_distance
from .run import DropRun, make_run
from .setting import DropSetting, check_setting
from .state import LAST_STEP, LOG, SPEED, TIME, TIP, Lines, Lists, Numbers, Outside, Stretch
from .tips import make_profile

STEPS_AT_ONCE = 64
LEAST = 0.1  # of the skin: a list that allows less is made anew
SHORTEST = (
    1e-3  # of the first step: a shorter one follows a single point that has collapsed, and would never end
)


BOOK_CLOSES = (
    0.02  # energy error below which a run stands; 99 of 100 stay below 0.017, half of them below 0.0013
)
HALVINGS = 2  # of the step, where it does not close
HELPED = 0.7  # of the error may be left by a halving; where more is left, the step is not the reason
# tip radii above the bottom of the dust: nearer to it a drop is shortened by more than 0.3 % (effects/catalogue/hard_floor.py)
FELT = 1.0
DEEPER = 1.5  # times as much dust, for a drop that comes nearer


@dataclass
class Evolution:
    """What ``evolve`` made: state (rows, n) at the end and at the stop, one row of LOG a step, numbers of the run."""

    state: FloatArray
    at_stop: FloatArray
    log: FloatArray
    stop_step: int | None
    rebuilds: int


def evolve(
    setting: DropSetting,
    dust: FloatArray,
    wall: np.ndarray,
    body: FloatArray,
    watch: Callable[[float, FloatArray], None] | None = None,
    steps_at_once: int = STEPS_AT_ONCE,
    planes: tuple[float, ...] = (),
    lowest: float = math.inf,
) -> Evolution:
    """Move particles of any initial state (rows of ``fill_at_rest``, n) until ``setting.duration``, or past the stop.

    wall particles keep the velocity they have. body: height (m) and velocity (m/s, upwards) of the projectile's tip,
    then time and two zeros; far above the dust it is as good as absent. watch is called with time and state between
    compiled stretches of at most ``steps_at_once`` steps. planes: x (m) of mirrors besides the axis, walls of free slip
    with all dust on one side; their distance must exceed the reach of the kernel. lowest: depth (m) of the tip at which the run
    ends. Raises SimulationError if the run blows up.
    """
    numerics, material, projectile = setting.numerics, setting.material, setting.projectile
    axisymmetric = setting.geometry == "axisymmetric"
    n = dust.shape[1]
    profile, path = make_profile(projectile), setting.path
    led = path[0].size > 0
    mirrors = (0.0, *planes) if axisymmetric else planes
    h = numerics.smoothing * setting.spacing
    skin = numerics.skin * h
    neighbours = Neighbours(2 * h, skin)
    state = make_rows(dust.shape[0], n + WIDTH)
    nearby, beyond = make_rows(WIDTH, ROOM), make_rows(WIDTH, ROOM)
    front, back = make_lines(n + WIDTH), make_lines(n + WIDTH)
    state[:, :n] = dust
    per_unit = 2 * math.pi if axisymmetric else 1.0
    force_scale = 1 / per_unit
    law = find_law(material.law)
    constants, tables, advance = (
        law.make_constants(setting),
        law.make_tables(setting),
        load_loop(material.law),
    )
    outside = Outside(
        setting.side_friction * force_scale,
        *_split(setting.force_of_depth, force_scale),
        *_split(setting.force_of_speed, force_scale),
        *_split(setting.force_of_time, force_scale),
        *_split(setting.viscosity_of_depth, force_scale),
        *_split(setting.drag_of_depth, force_scale),
        *_split(setting.mass_of_depth, force_scale),
        *_split(setting.gathered_of_depth, force_scale),
        *path,
    )
    log = np.zeros((4096, len(LOG)))
    log[0, 1], log[0, 2] = -body[TIP], -body[SPEED]
    lost = np.zeros(3)
    fixed = np.nonzero(wall)[0].astype(np.uint32)
    part = 1 - 0.5 / numerics.smoothing
    numbers = Numbers(
        n=n,
        axisymmetric=axisymmetric,
        free_mass=float(dust[rows.MASS, ~wall].sum()),
        profile=profile,
        body_mass=projectile.mass / per_unit,
        gravity=setting.gravity,
        friction=material.contact_friction,
        spacing=setting.spacing,
        h=h,
        courant=numerics.courant,
        alpha=numerics.alpha,
        beta=numerics.beta,
        affine=numerics.affine,
        front=numerics.front,
        hold_apart=(1,) if numerics.artificial_stress > 0.0 else (),
        artificial_stress=numerics.artificial_stress,
        per_kernel=1 / (part**4 * (5 - 4 * part)),
        diffusivity=numerics.exchange * h * h,
        reference=setting.filling_factor,
    )
    made, builds, stop_step, limit = 0, 0, None, min([setting.duration, *path[0][-1:]])
    farthest = 1000 * (np.abs(dust[[rows.X, rows.Z]]).max() + setting.spacing)
    first_step = 0.0
    while body[TIME] < limit and -body[TIP] < lowest:
        if not np.abs(state[[rows.X, rows.Z], :n]).max() < farthest:
            raise _blown_up(setting, made, body[TIME])
        source, twice_plane = _find_images(state[rows.X, :n], 2 * h + 2 * skin, mirrors)
        if n + source.size + WIDTH > state.shape[1]:
            front, back = (make_lines(n + source.size + 64 + WIDTH) for _ in range(2))
            larger = make_rows(state.shape[0], n + source.size + 64 + WIDTH)
            larger[:, :n] = state[:, :n]
            state = larger
        state[rows.X, n : n + source.size] = twice_plane - state[rows.X, source]
        state[rows.Z, n : n + source.size] = state[rows.Z, source]
        neighbours.build(n, n + source.size, state[rows.X], state[rows.Z])
        builds += 1
        allowed, begun = 0.45 * skin, state[rows.X, :n].copy()
        fresh = False
        while allowed > LEAST * skin and body[TIME] < limit and -body[TIP] < lowest:
            if not fresh:
                origin = state[[rows.X, rows.Z], :n].copy()
                near, inner, body_origin = _find_near(
                    state[:, :n], profile, setting.spacing, body[TIP], skin, axisymmetric
                )
                films = np.zeros_like(near)
            if made + steps_at_once + 2 > len(log):
                log = np.concatenate([log, np.zeros_like(log)])
            left = math.ceil((limit - body[TIME]) / body[LAST_STEP]) if body[LAST_STEP] > 0.0 else 1
            steps = min(steps_at_once, max(left, 1))
            done = advance(
                *name_rows(setting, state),
                Lists(neighbours.start, neighbours.list, source, twice_plane, fixed, near, inner, films, origin),
                Lines(front, back, nearby, beyond, lost),
                numbers, outside, constants, tables, log, body,
                Stretch(steps, made + 1, allowed, body_origin, led or stop_step is not None),
            )  # fmt: skip
            if done < 0 or not np.isfinite(body).all():
                raise _blown_up(setting, made + max(done, 0), body[TIME])
            made += done
            first_step = first_step or body[LAST_STEP]
            collapsed = body[LAST_STEP] < SHORTEST * first_step
            if collapsed and stop_step is None:
                raise _blown_up(setting, made, body[TIME])
            if collapsed:  # after the stop there is nothing left to wait for
                limit = body[TIME]
            fresh = 1 < steps == done  # a single step may have been the last one allowed
            if body[SPEED] >= 0.0 and stop_step is None and not led:
                stop_step = made
                limit = min(limit, body[TIME] * (1 + setting.after_stop))
                at_stop = state[:, :n].copy()
            if not fresh:
                state[rows.X, n : n + source.size] = twice_plane - state[rows.X, source]
                state[rows.Z, n : n + source.size] = state[rows.Z, source]
                allowed = min(0.45 * skin, neighbours.spare(state[rows.X], state[rows.Z]))
                if source.size:  # no point without an image may come so near to the mirror that it needs one
                    allowed = min(allowed, 2 * skin - np.abs(state[rows.X, :n] - begun).max())
            if watch is not None:
                _fill_elastic(setting, state[:, :n])
                watch(float(body[TIME]), state[:, :n])
    end = state[:, :n]
    if stop_step is None:
        at_stop = end.copy()
    if led and body[TIME] >= path[0][-1]:
        stop_step = made
    for each in (end, at_stop):
        _fill_elastic(setting, each)
    return Evolution(
        end,
        at_stop,
        log[: made + 1],
        stop_step,
        builds,
    )


def simulate(setting: DropSetting, progress: Callable[[float], None] | None = None) -> DropRun:
    """Run one drop or push; time zero is the start, at the depth that its motion says: 0 is the first contact of the tip with
    the undisturbed surface. Where it starts deeper, there is no dust in the projectile.

    The book of energy judges the run: where it does not close, or where a point collapsed, the run is made again with half the
    step, at most ``HALVINGS`` times and as long as that helps. A drop that would feel the bottom of the dust, where no depth of
    it is stated, is made again in DEEPER times as much, if it may stop there. One that does not has not stopped.

    progress is called now and then with the time reached, in s. Raises SimulationError (setting out of range, or the
    run blew up: then the message names its parameters).
    """
    check_setting(setting)
    if setting.depth is not None or setting.path[0].size:
        return _simulate_closed(setting, progress)
    run = _simulate_closed(setting, progress, _find_lowest(setting))
    if not run.fell_through:
        return run
    deeper = setting.replace(depth=DEEPER * setting.extent[1])
    check_setting(deeper)
    if not _find_stop(run) < _find_lowest(deeper):
        return run
    return replace(_simulate_closed(deeper, progress, _find_lowest(deeper)), setting=setting)


def _find_stop(run: DropRun) -> float:
    """Depth (m) where a drop would stop if it were slowed down on as along its last tip radius."""
    begin = np.searchsorted(run.depth, run.depth[-1] - run.setting.projectile.tip_radius)
    lost = run.velocity[begin] ** 2 - run.velocity[-1] ** 2
    way = run.depth[-1] - run.depth[begin]
    return float(run.depth[-1] + way * run.velocity[-1] ** 2 / lost) if lost > 0.0 else math.inf


def _find_lowest(setting: DropSetting) -> float:
    """Depth (m) below which a tip feels the bottom."""
    bottom = setting.extent[1] - WALL_LAYERS * setting.spacing
    return bottom - FELT * setting.projectile.tip_radius


def _simulate_closed(
    setting: DropSetting, progress: Callable[[float], None] | None, lowest: float = math.inf
) -> DropRun:
    """A run whose book of energy closes, if halving the step makes it."""
    best: DropRun | None = None
    trouble: SimulationError | None = None
    for halvings in range(HALVINGS + 1):
        try:
            run = _simulate_once(setting, setting.numerics.courant / 2**halvings, progress, lowest)
        except SimulationError as error:
            trouble = trouble or error
            continue
        before, best = best, run if best is None or abs(run.energy_error) < abs(best.energy_error) else best
        if abs(best.energy_error) < BOOK_CLOSES:
            return best
        if before is not None and abs(run.energy_error) > HELPED * abs(before.energy_error):
            break
    if best is None:
        raise trouble if trouble else _blown_up(setting, 0, 0.0)
    missing = f"its book of energy does not close: {best.energy_error:+.1%}"
    return replace(best, warnings=(*best.warnings, missing))


def _simulate_once(
    setting: DropSetting, courant: float, progress: Callable[[float], None] | None, lowest: float
) -> DropRun:
    began = time.perf_counter()
    dust, wall = place_particles(setting)
    body = start_body(setting)
    watch = None if progress is None else lambda reached, state: progress(reached)
    _fill_elastic(setting, dust)
    stepped = setting.replace(numerics=replace(setting.numerics, courant=courant))
    result = evolve(stepped, dust, wall, body, watch, lowest=lowest)
    per_unit = 2 * math.pi if setting.geometry == "axisymmetric" else 1.0
    return make_run(
        setting, result.log, result.stop_step, result.at_stop, result.state,
        dust, wall, per_unit, result.rebuilds, time.perf_counter() - began,
    )  # fmt: skip


def start_body(setting: DropSetting) -> FloatArray:
    """The projectile at the start, as ``evolve`` takes it."""
    time, led = setting.path
    speed = (led[1] - led[0]) / time[1] if led.size else setting.impact_speed
    return np.array([0.0 - setting.motion.start_depth, -speed, 0.0, 0.0, 0.0])


def _blown_up(setting: DropSetting, steps: int, reached: float) -> SimulationError:
    return SimulationError(
        "simulation", "run", f"blew up after {steps} steps at {reached * 1e3:.4g} ms with {setting}"
    )


def _fill_elastic(setting: DropSetting, state: FloatArray) -> None:
    """Elastic energy per mass is a function of the state, so it is worked out only where somebody looks."""
    state[rows.ELASTIC] = find_law(setting.material.law).elastic_energy(setting, *name_rows(setting, state))


def _find_near(
    state: FloatArray, profile: FloatArray, spacing: float, tip: float, skin: float, axisymmetric: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Particles that can come within two spacings of the projectile, or to the axis, before the next list; and the tip now."""
    x, z = state[rows.X], state[rows.Z]
    margin = 2 * spacing + skin
    state[rows.DISTANCE] = 1.0e9
    near = np.nonzero(z > tip - margin)[0]
    distance = measure_distance(x[near], z[near], float(tip), profile)
    inner = np.nonzero(np.abs(x) < spacing)[0] if axisymmetric else np.zeros(0)
    return near[distance < margin].astype(np.uint32), inner.astype(np.uint32), float(tip)


def _find_images(x: FloatArray, near: float, mirrors: tuple[float, ...]) -> tuple[np.ndarray, FloatArray]:
    """Which particles have an image behind a mirror at x = const, and twice the place of its mirror."""
    sources = [np.nonzero(np.abs(x - at) < near)[0] for at in mirrors] or [np.zeros(0, dtype=np.int64)]
    return np.concatenate(sources), np.repeat(
        2.0 * np.asarray(mirrors), [len(found) for found in sources][: len(mirrors)]
    )


def _split(law: tuple[tuple[float, float], ...], scale: float) -> tuple[FloatArray, FloatArray]:
    pairs = np.asarray(law, dtype=float).reshape(-1, 2)
    return np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1]) * scale
