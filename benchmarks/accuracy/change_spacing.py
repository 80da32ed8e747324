"""How coarse may runs be that say what an effect changes? Changes of depth, stopping time and compacted volume by one step of
each effect, against those of runs with 8 spacings in a tip radius.

    python -m benchmarks.accuracy.change_spacing CAMPAIGN 4 5 6

A change is a difference of logarithms, so what both runs get wrong alike drops out. Printed: root mean square over effects, p_m
and speeds, in per cent, of the changes themselves and of their errors.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import labsim
from labsim.effects import list_effects
from labsim.effects.contract import list_places
from labsim.inference.emulation.grid import set_nominal_drop

FINE = 8
STRENGTHS, SPEEDS = (500.0, 1000.0, 2000.0), (0.35, 0.6, 0.9)
DENSE = 0.20


def measure_run(setting: labsim.DropSetting) -> np.ndarray:
    """ln of depth, stopping time and volume denser than DENSE, and the CPU time in s."""
    begin = time.process_time()
    run = labsim.simulate(setting)
    took = time.process_time() - begin
    volume = max(run.compacted_volume(DENSE), 1e-15)
    return np.array([*np.log([run.penetration_depth, run.stopping_time, volume]), took])


def main(folder: str, spacings: list[int]) -> None:
    campaign = labsim.read_campaign(folder)
    place = max(list_places(campaign).values(), key=lambda each: abs(each.sequence_fraction))
    projectile = campaign.drops[0].projectile.simulated
    costly = {
        name: effect
        for name, effect in list_effects(campaign).items()
        if effect.change_setting is not None and effect.amplitudes and effect.kind != "numerics"
    }
    changes: dict[int, list[np.ndarray]] = {cells: [] for cells in [*spacings, FINE]}
    took = dict.fromkeys(changes, 0.0)
    for cells, found in changes.items():
        for p_m in STRENGTHS:
            for speed in SPEEDS:
                nominal = set_nominal_drop(campaign, projectile, speed, p_m, cells)
                plain = measure_run(nominal)
                took[cells] += plain[3]
                for effect in costly.values():
                    parameter = effect.amplitudes[0]
                    values = {parameter.name: parameter.hold(parameter.step)}
                    changed = measure_run(effect.apply(nominal, values, place))
                    took[cells] += changed[3]
                    found.append(changed[:3] - plain[:3])
    fine = np.array(changes[FINE])
    felt = np.abs(fine[:, 0]) > 1e-4
    print(f"{felt.sum()} changes; depth, stopping time, volume denser than {DENSE}, %; CPU s")
    print("changes", *np.round(100 * np.sqrt(np.mean(fine[felt] ** 2, axis=0)), 2), f"{took[FINE]:.0f}")
    for cells in spacings:
        error = (np.array(changes[cells]) - fine)[felt]
        print(cells, *np.round(100 * np.sqrt(np.mean(error**2, axis=0)), 2), f"{took[cells]:.0f}")


if __name__ == "__main__":
    main(sys.argv[1], [int(each) for each in sys.argv[2:]] or [4, 5, 6])
