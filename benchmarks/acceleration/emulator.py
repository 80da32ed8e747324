"""How far what is interpolated between runs is off from runs at the very place, for drops with an accelerometer.

    python -m benchmarks.acceleration.emulator [--workers 2]

The campaign is data/campaigns/f161, its drops at a p_m and with causes that lie between the nodes. Each drop is simulated at its
own speed, p_m and amplitude, with spacings a few per cent apart: their mean is what single runs scatter about. The table has
the rms over drops, in %: of the depth, of the stopping time, of the mean force over fortieths of the stop, as the likelihood
compares it (of the largest); for the interpolated run, and for a single one. Below: how far a shear factor f and a tensile
factor f², the same but in tension, lie apart when simulated and when interpolated.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.acceleration.error import bin_force
from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.emulation.curves import interpolate_speed
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.inference.observations import RunFeatures
from labsim.inference.observations.observe_acceleration import BINS, COMPARED
from labsim.inference.problem import Problem
from labsim.inference.scatter import set_error_budget
from labsim.runs.parts import Motion
from labsim.runs.store import RunStore

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "f161"
P_M = 1640.0  # Pa, between nodes
FACTOR = 0.52
# effects with their amplitudes above null
CAUSES: dict[str, dict[str, float]] = {
    "none": {},
    "shear_strength": {"shear_strength": FACTOR - 1.0},
    "tensile_strength": {"tensile_strength": FACTOR**2 - 1.0},
    "pore_gas": {"pore_gas": 5500.0},
}
SPACINGS = np.linspace(7.6, 8.4, 9)  # in a tip radius; the middle one is FELT_CELLS


def simulate_at(
    problem: Problem, features: Mapping[str, RunFeatures], speeds: Mapping[str, float]
) -> dict[tuple[str, str], np.ndarray]:
    """(cause, drop) -> codes (spacings, m) of runs at that very place."""
    keys = [(cause, drop) for cause in CAUSES for drop in speeds]
    settings = []
    for cause, drop in keys:
        group = problem.groups[features[drop].group]
        setting = problem.grid.setting(group, speeds[drop], P_M)
        for name, amplitude in CAUSES[cause].items():
            setting = problem.change(name, amplitude)(setting)
        settings += [setting.replace(spacing=group.projectile.tip_radius / each) for each in SPACINGS]
    runs = problem.grid.store.get_parts(
        settings, [Motion] * len(settings), workers=problem.grid.workers, text="at the place"
    )
    return {
        key: np.array(
            [features[key[1]].extract(run) for run in runs[k * len(SPACINGS) : (k + 1) * len(SPACINGS)]]
        )
        for k, key in enumerate(keys)
    }


def find_force(run: np.ndarray, stop: float) -> np.ndarray:
    return bin_force(lambda time: interpolate_speed(run, time), stop)[: round(COMPARED * BINS)]


def compare(run: np.ndarray, others: np.ndarray) -> list[float]:
    """Off in depth, stopping time and force from the mean of others (k, m), %."""
    mean = others.mean(axis=0)
    forces = np.array([find_force(each, np.exp(mean[1])) for each in others])
    off = find_force(run, np.exp(mean[1])) - forces.mean(axis=0)
    return [*(100.0 * (run - mean)[:2]), 100.0 * float(np.sqrt(np.mean(off**2)) / forces.mean(axis=0).max())]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2)
    campaign = read_campaign(CAMPAIGN)
    problem, _ = prepare(
        campaign, RunStore(), workers=parser.parse_args().workers, budget=set_error_budget(campaign)
    )
    tables = {model.observed.name: model.table for model in problem.tracks.models}
    features = {
        drop: next(each for each in problem.features if each.table is table) for drop, table in tables.items()
    }
    speeds = {model.observed.name: model.observed.impact_speed for model in problem.tracks.models}
    for amplitudes in CAUSES.values():
        # runs are asked for about the place, and nothing is fitted
        fit_hypothesis(problem, tuple(amplitudes), (np.log(P_M), amplitudes), around=True, iterations=0)
    there = simulate_at(problem, features, speeds)
    between = {
        (cause, drop): tables[drop].features(np.log(P_M), np.log(speeds[drop]), CAUSES[cause])
        for cause, drop in there
    }

    def show(rows: list[list[float]]) -> str:
        return " | ".join(f"{each:.2f}" for each in np.sqrt(np.mean(np.square(rows), axis=0)))

    print("| cause | depth | time | force | one run: depth | time | force |\n|---" + "|---" * 6 + "|")
    middle = len(SPACINGS) // 2
    for cause in CAUSES:
        interpolated = [compare(between[cause, drop], there[cause, drop]) for drop in speeds]
        single = [compare(there[cause, drop][middle], there[cause, drop]) for drop in speeds]
        print(f"| {cause} | {show(interpolated)} | {show(single)} |")
    single_runs = {key: each[middle] for key, each in there.items()}
    apart = [
        show(
            [compare(codes["shear_strength", drop], codes["tensile_strength", drop][None]) for drop in speeds]
        )
        for codes in (between, single_runs)
    ]
    print(f"| shear less tension | {apart[0]} | {apart[1]} |")


if __name__ == "__main__":
    main()
