"""At which speeds are runs of scans made? Maps of runs at a scan's own speed, interpolated between speeds 1.7 apart, and the mean
of two 8 % about it, against a run with twice as many spacings.

    python -m benchmarks.accuracy.scan_speeds CAMPAIGN

Printed: root mean square over the compared cells, over the standard deviation of the map itself, of the map and of what a
weaker shear and a weaker tensile strength change in it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial

import numpy as np

import labsim
from labsim.effects import list_effects
from labsim.effects.contract import list_places
from labsim.inference.emulation.grid import (
    SAME_SPEED,
    SCAN_CELLS,
    interpolation_weights,
    set_nominal_drop,
)
from labsim.inference.measure import measure
from labsim.inference.observations.compacted_zone import ObservedScan, extract_map, observe_scan

P_M, FINE = 1000.0, 2 * SCAN_CELLS
RATIO = 1.7  # of the speeds that a map is interpolated between
CHANGES = {"": 0.0, "shear_strength": -0.4, "tensile_strength": -0.6}  # amplitudes
Code = Callable[[float, int], np.ndarray]


def interpolate_on_grid(code: Code, speed: float) -> np.ndarray:
    """Through three speeds of a grid that enclose one."""
    below = round(math.log(speed / 0.1) / math.log(RATIO) - 0.5)
    first = below - (math.log(speed / 0.1) / math.log(RATIO) - below < 0.5)
    nodes = [0.1 * RATIO ** (first + k) for k in range(3)]
    weights = interpolation_weights(tuple(np.log(nodes)), math.log(speed))
    return np.sum([w * code(node, SCAN_CELLS) for w, node in zip(weights, nodes, strict=True)], axis=0)


WAYS: dict[str, Callable[[Code, float], np.ndarray]] = {
    "fine": lambda code, speed: code(speed, FINE),
    "own": lambda code, speed: code(speed, SCAN_CELLS),
    "grid": interpolate_on_grid,
    "two": lambda code, speed: (
        0.5 * (code(speed / SAME_SPEED, SCAN_CELLS) + code(speed * SAME_SPEED, SCAN_CELLS))
    ),
}


def run_map(
    campaign: labsim.Campaign, scan: ObservedScan, name: str, amplitude: float, speed: float, cells: int
) -> np.ndarray:
    """Filling factor on the compared cells of a scan, with one effect or none."""
    setting = set_nominal_drop(campaign, scan.scan.projectile.simulated, speed, P_M, cells)
    if name:
        effect = list_effects(campaign)[name]
        parameter = effect.amplitudes[0]
        values = {parameter.name: parameter.hold(amplitude)}
        setting = effect.apply(setting, values, list_places(campaign)[scan.name])
    return extract_map(labsim.simulate(setting), scan)[1:]


def main(folder: str) -> None:
    campaign = labsim.read_campaign(folder)
    for reduced in measure(campaign).reduced:
        scan = observe_scan(reduced)
        speed = scan.scan.speed.value
        maps: dict[tuple[str, str], np.ndarray] = {}
        for name, amplitude in CHANGES.items():
            code = partial(run_map, campaign, scan, name, amplitude)
            for way, find in WAYS.items():
                maps[way, name] = find(code, speed)
            contrast = float(np.std(maps["fine", name]))
            for way in list(WAYS)[1:]:
                off = maps[way, name] - maps["fine", name]
                change = off - (maps[way, ""] - maps["fine", ""])
                sizes = [math.sqrt(np.mean(each**2)) / contrast for each in (off, change)]
                print(
                    f"{scan.name} {speed:.3f} m/s {name:16s} {way:4s} map {sizes[0]:.3f} change {sizes[1]:.3f}",
                    flush=True,
                )


if __name__ == "__main__":
    main(sys.argv[1])
