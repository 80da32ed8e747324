"""How far the force with an effect is off between the amplitudes that are simulated, where accelerometers are.

    python -m benchmarks.acceleration.effect_interpolation [--workers 2]

At a tenth, 0.35, 0.6 and 0.85 of an effect's step, between the amplitudes that are simulated: what the effect changes of the
deceleration, and how far the interpolated one is off from a simulation at that amplitude, on the straight line to one run at the
step and on the curve through the runs of labsim.inference.nodes. In % of the largest deceleration, rms of three drops; both
smoothed to a cubic in time, since each run is rough.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks.acceleration.effect_roughness import CAMPAIGN, SPEEDS, lay_out
from labsim.campaign import read_campaign
from labsim.effects import list_effects
from labsim.inference.emulation.curves import extract_speeds, interpolate_speed
from labsim.inference.emulation.grid import FELT_CELLS, FELT_STEPS, smooth_weights
from labsim.inference.emulation.nodes import amplitude_nodes
from labsim.inference.observations.observe_acceleration import BINS, COMPARED
from labsim.sph import simulate

EFFECTS = (
    "strength_rate", "shear_strength", "tensile_strength", "strength_slope", "surface_crust", "pore_gas",
    "density_gradient", "side_friction",
)  # fmt: skip
SHARES = (0.1, 0.35, 0.6, 0.85)


def run(asked: tuple[str, float, float]) -> np.ndarray:
    """Encoded speeds with (effect or nothing, amplitude, speed)."""
    name, amplitude, speed = asked
    return extract_speeds(simulate(lay_out(FELT_CELLS, name, amplitude, speed)))


def find_force(features: np.ndarray, stop: float) -> np.ndarray:
    ends = np.linspace(0.0, COMPARED * stop, BINS)
    force = -np.diff(interpolate_speed(features, ends)) / np.diff(ends)
    time = np.linspace(-1.0, 1.0, force.size)
    return np.polynomial.legendre.legval(time, np.polynomial.legendre.legfit(time, force, 3))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2)
    workers = parser.parse_args().workers
    catalogue = list_effects(read_campaign(CAMPAIGN))
    effects = {name: catalogue[name].stretch(FELT_STEPS) for name in EFFECTS}
    places = {}
    for name, effect in effects.items():
        parameter = effect.amplitudes[0]
        places[name] = [parameter.amplitude_at(share * parameter.grade(parameter.step)) for share in SHARES]
    amplitudes = {
        name: {
            *places[name],
            *(node for a in places[name] for node in amplitude_nodes(effect, a, around=True, bent=True)),
        }
        for name, effect in effects.items()
    }
    asked = [("", 0.0, speed) for speed in SPEEDS]
    asked += [(name, a, speed) for name in EFFECTS for a in sorted(amplitudes[name]) for speed in SPEEDS]
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        codes = dict(zip(asked, pool.map(run, asked), strict=True))
    print("| effect | at | changes | off on a line | on the curve |\n|---|---|---|---|---|")
    for name, effect in effects.items():
        parameter = effect.amplitudes[0]
        for a in places[name]:
            rows = []
            for speed in SPEEDS:
                plain, true = codes["", 0.0, speed], codes[name, a, speed]
                stop = math.exp(min(plain[1], true[1]))
                found = [find_force(plain, stop)]
                for bent in (False, True):
                    nodes = amplitude_nodes(effect, a, around=bent, bent=bent)
                    grades = [0.0, *map(parameter.grade, nodes)]
                    runs = np.array([plain, *(codes[name, node, speed] for node in nodes)])
                    found.append(find_force(smooth_weights(grades, parameter.grade(a)) @ runs, stop))
                rows.append((np.array(found) - find_force(true, stop)) / found[0].max())
            cells = " | ".join(f"{100 * each:.1f}" for each in np.sqrt(np.mean(np.square(rows), axis=(0, 2))))
            print(f"| {name} | {parameter.null + a:.3g} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
