"""Random falls with known figures through labsim's curve fit: python -m benchmarks.faults.falls [--number 500] [--seed 1].

The truth is integrated here, from laws of force or from an independent solver's curves (data/reference), not from the
segments that the fit is made of. Half of the falls have 5 % spikes, a quarter rebound.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import UnivariateSpline

from labsim.errors import MeasurementError
from labsim.records import Camera, Track
from labsim.video.motion.curve import fit_deceleration

RATE, PIXEL, SURFACE = 10_000.0, 20e-6, 300.0
GRAVITY = 9.81 / PIXEL / RATE**2  # px per frame squared
LAWS = ("constant", "linear", "sine", "depth", "tip", "solver")
CURVES = Path(__file__).parents[2] / "data" / "reference" / "independent_curves.csv"
FIGURES = ("D", "v0", "T_s")


@dataclass(frozen=True)
class Fall:
    """One random fall: speed (px/frame), stop (frames), noise (px), what it was, its track and its true depth (px)."""

    law: str
    speed: float
    stop: float
    sigma: float
    spikes: int
    rebound: bool
    track: Track
    depth: float


def read_solver_shapes() -> list[tuple[np.ndarray, np.ndarray]]:
    """(time over stopping time, depth over speed · stopping time) of every curve of the independent solver, 401 points each."""
    rows = defaultdict(list)
    with CURVES.open() as file:
        for line in csv.DictReader(file):
            rows[line["tip_radius_mm"], line["speed_m_s"]].append((line["time_ms"], line["depth_mm_h16"]))
    shapes = []
    for (_, speed), points in rows.items():
        t, z = np.array(points, float).T
        smooth = UnivariateSpline(t, z, k=5, s=len(t) * 2e-5**2)
        fine = np.linspace(0, t[-1], 4001)
        pace = smooth.derivative()(fine)
        stop = float(np.interp(0.0, -pace, fine))
        u = np.linspace(0, 1, 401)
        shapes.append((u, smooth(u * stop) / (float(speed) * stop)))
    return shapes


def shape_motion(law: str, rng: np.random.Generator, shapes: list) -> tuple[np.ndarray, np.ndarray, float]:
    """u, depth over (speed · stopping time) and deceleration at the stop over (speed / stopping time) of one law."""
    if law == "solver":
        u, z = shapes[rng.integers(len(shapes))]
        return u, z, -float(UnivariateSpline(u, z, k=5, s=0).derivative(2)(1.0))
    slope = rng.uniform(-0.6, 0.6) if law == "linear" else 0.0
    radius, inertia = rng.uniform(0.2, 1.2), rng.uniform(0.0, 1.5)

    def push(t: float, state: np.ndarray) -> list[float]:
        z, v = state
        if law == "constant":
            return [v, -1.0]
        if law == "linear":
            return [v, -(1.0 + slope * (1.0 - 2.0 * t))]
        if law == "sine":
            return [
                v,
                -0.5 * np.pi * np.sin(np.pi * t),
            ]  # half a sine: nothing at contact, nothing at the stop
        if law == "depth":
            return [v, -z]
        reach = min(max(z / radius, 0.0), 1.0)
        return [v, -(2 * reach - reach**2) * (1.0 + inertia * v**2)]

    end = 1.0 if law in ("constant", "linear", "sine") else 20.0
    stops = lambda _, state: state[1]  # noqa: E731
    stops.terminal = True
    events = stops if end > 1.0 else None
    found = solve_ivp(push, (0, end), [0.0, 1.0], events=events, dense_output=True, rtol=1e-10, atol=1e-12)
    stop = found.t[-1]
    u = np.linspace(0, 1, 401)
    last = -push(stop, found.y[:, -1])[1] * stop
    return u, found.sol(u * stop)[0] / stop, last


def make_fall(rng: np.random.Generator, shapes: list) -> Fall:
    law = LAWS[rng.integers(len(LAWS))]
    speed = np.exp(rng.uniform(np.log(0.6), np.log(14.0)))
    stop, sigma = rng.uniform(4.0, 30.0), np.exp(rng.uniform(np.log(0.005), np.log(0.1)))
    before = round(np.exp(rng.uniform(np.log(6), np.log(120))))
    after = round(np.exp(rng.uniform(np.log(8), np.log(80))))
    contact = before - rng.uniform()
    t = np.arange(before + int(np.ceil(stop)) + after) - contact
    u, shape, last = shape_motion(law, rng, shapes)
    depth = float(shape[-1]) * speed * stop
    fine = UnivariateSpline(u, shape, k=5, s=0)
    z = speed * stop * fine(np.clip(t / stop, 0, 1))
    s = np.minimum(t, 0.0)
    z += speed * s + 0.5 * GRAVITY * s**2
    rebound = bool(rng.uniform() < 0.25) and last > 0.1
    if rebound:  # the dust springs back: its push fades over a small way, then the projectile flies
        way = depth * np.exp(rng.uniform(np.log(2e-3), np.log(3e-2)))
        pull = last * speed / stop
        phase = np.sqrt(pull / way)
        e = np.clip(t - stop, 0, None)
        loose = 0.5 * np.pi / phase
        f = np.clip(e - loose, 0, None)
        z -= way * (1 - np.cos(phase * np.minimum(e, loose))) + way * phase * f - 0.5 * GRAVITY * f**2
    row = SURFACE + z + rng.normal(0, sigma, len(t))
    spikes = int(rng.binomial(len(t), 0.05)) if rng.uniform() < 0.5 else 0
    where = rng.choice(len(t), spikes, replace=False)
    row[where] += rng.choice([-1, 1], spikes) * np.exp(rng.uniform(np.log(0.2), np.log(30.0), spikes))
    n = len(t)
    track = Track(np.arange(n), np.arange(n) / RATE, row, np.full(n, sigma), np.ones(n, bool), ("",) * n)
    return Fall(law, speed, stop, sigma, spikes, rebound, track, depth)


def measure_fall(fall: Fall) -> tuple[np.ndarray, np.ndarray] | str:
    """(errors over truth, errors over sigma) of D, v0, T_s, or why there is none."""
    try:
        curve = fit_deceleration(fall.track, Camera(RATE, PIXEL, SURFACE, 0.0))
    except MeasurementError as trouble:
        return trouble.message
    pairs = (
        (curve.penetration_depth, fall.depth * PIXEL),
        (curve.impact_speed, fall.speed * PIXEL * RATE),
        (curve.stopping_time, fall.stop / RATE),
    )
    relative = np.array([figure.value / truth - 1 for figure, truth in pairs])
    pull = np.array([(figure.value - truth) / figure.sigma for figure, truth in pairs])
    return (relative, pull) if np.all(np.isfinite(pull)) else "depth or stopping time unknown"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--number", type=int, default=500)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--list", action="store_true", help="name every fall beyond 4 sigma")
    chosen = options.parse_args()
    shapes = read_solver_shapes()
    begun = time.perf_counter()
    rows: list[tuple[Fall, np.ndarray, np.ndarray]] = []
    lost: list[str] = []
    for k in range(chosen.number):
        fall = make_fall(np.random.default_rng([chosen.seed, k]), shapes)
        found = measure_fall(fall)
        what = (
            f"{k:4d} {fall.law:8s} {fall.speed:5.2f} px/frame, stop {fall.stop:4.1f}, sigma {fall.sigma:.4f}, "
            f"{fall.spikes} spikes, {'rebound' if fall.rebound else 'rest'}"
        )
        if isinstance(found, str):
            lost.append(f"{what}: {found}")
            continue
        rows.append((fall, *found))
        if chosen.list and np.max(np.abs(found[1])) > 4:
            print(what, "pulls", np.round(found[1], 1), "relative", np.round(found[0], 4))
    seconds = time.perf_counter() - begun
    groups = {
        "all": lambda _: True,
        "no spikes": lambda fall: not fall.spikes,
        "spikes": lambda fall: fall.spikes > 0,
        "rebound": lambda fall: fall.rebound,
        "stop < 8 frames": lambda fall: fall.stop < 8,
        **{law: lambda fall, law=law: fall.law == law for law in LAWS},
    }
    print(f"{'falls':16s} {'number':>6s} | within 4 sigma, % | standard deviation of pulls | median sigma, %")
    print(f"{'':23s} | " + " | ".join(["".join(f"{name:>7s}" for name in FIGURES)] * 3))
    for name, belongs in groups.items():
        some = [row for row in rows if belongs(row[0])]
        if not some:
            continue
        relative, pull = np.array([row[1] for row in some]), np.array([row[2] for row in some])
        columns = (
            100 * np.mean(np.abs(pull) < 4, axis=0),
            np.std(pull, axis=0),
            100 * np.median(np.abs(relative / pull), axis=0),
        )
        print(
            f"{name:16s} {len(some):6d} | "
            + " | ".join("".join(f"{value:7.2f}" for value in column) for column in columns)
        )
    bad = sum(abs(row[1][2]) > 0.02 and abs(row[2][2]) > 4 for row in rows)
    print(f"T_s off by more than 2 % and 4 sigma: {bad}; no figures: {len(lost)}; {seconds:.0f} s")
    for line in lost:
        print("no figures:", line)


if __name__ == "__main__":
    sys.exit(main())
