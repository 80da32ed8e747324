"""What effects change of the force, with 8, 11 and 16 spacings in a tip radius, beside a Lagrangian mesh.

    python -m benchmarks.acceleration.effect_roughness [--workers 2]

Deceleration over fortieths of each run's own stopping time, over its mean: p_m's part is taken off. The table has what an effect
changes of that, in %, and how far it is off from the mesh of 16 cells (benchmarks/lagrangian_mesh), rms of three drops. What is
rough alike at every resolution is the mesh's own.

A second table has how far what an effect changes is off with one spacing, and with the mean of two (FELT_SPACINGS), from that
with a third between them. A third table has how alike two effects are: what is left of the one's change, rms %, after the best
multiple of the other's.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.acceleration.error import bin_force
from benchmarks.lagrangian_mesh import mesh
from labsim.campaign import read_campaign
from labsim.effects import list_effects, list_places
from labsim.inference.emulation.curves import extract_speeds, interpolate_speed
from labsim.inference.emulation.grid import FELT_SPACINGS
from labsim.inference.observations.observe_acceleration import BINS, COMPARED
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

RADIUS, P_M, SPEEDS = 0.75e-3, 2200.0, (0.26, 0.32, 0.38)  # m, Pa, m/s
MASS = mesh.BEAD_DENSITY * 4 / 3 * math.pi * RADIUS**3
# effect: its amplitude above null, and the same in the mesh's words
EFFECTS = {
    "tensile_strength": (4.06, {"tensile_factor": 5.06}),
    "shear_strength": (-0.684, {"shear_factor": 0.316}),
    "strength_slope": (0.4, {"delta": 0.98}),
    "density_gradient": (8.0, {"gradient": 8.0}),
    "pore_gas": (8000.0, {"gas_pressure": 8000.0}),
    "weak tensile_strength": (-0.73, {"tensile_factor": 0.27}),
    "weak shear_strength": (-0.48, {"shear_factor": 0.52}),
}
# spacings, cells in a tip radius; the first of the mesh is the reference
OWN, MESH = (8.0, 11.0, 16.0), (16.0, 12.0)
CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "f161"  # for the limits of effects


def lay_out(cells: float, name: str, amplitude: float, speed: float) -> DropSetting:
    """A drop with (effect or nothing, its amplitude above null)."""
    setting = DropSetting(
        Projectile("hemisphere", RADIUS, MASS), speed, Material(p_m=P_M), spacing=RADIUS / cells
    )
    if not name:
        return setting
    campaign = read_campaign(CAMPAIGN)
    effect = list_effects(campaign)[name.removeprefix("weak ")]
    parameter = effect.amplitudes[0]
    place = next(iter(list_places(campaign).values()))
    return effect.apply(setting, {parameter.name: parameter.null + amplitude}, place)


def run(asked: tuple[bool, float, str, float]) -> np.ndarray:
    """Deceleration over its mean of (own, cells, effect or nothing, speed)."""
    own, cells, name, speed = asked
    if own:
        setting = lay_out(cells, name, EFFECTS[name][0] if name else 0.0, speed)
        features = extract_speeds(simulate(setting))
        force = bin_force(lambda t: interpolate_speed(features, t), math.exp(features[1]))
    else:
        dust = mesh.Dust(p_m=P_M, **(EFFECTS[name][1] if name else {}))
        found = mesh.run_drop(dust, RADIUS, speed, mesh.Numerics(cells=cells), mass=MASS)
        force = bin_force(lambda t: np.interp(t, found.time, found.speed), found.stopping_time)
    force = force[: round(COMPARED * BINS)]
    return force / force.mean()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=2)
    workers = parser.parse_args().workers
    kinds = [(True, cells) for cells in OWN] + [(False, cells) for cells in MESH]
    beside = [(True, OWN[0] / factor) for factor in FELT_SPACINGS]
    asked = [(*kind, name, speed) for kind in kinds + beside for name in ("", *EFFECTS) for speed in SPEEDS]
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = dict(zip(asked, pool.map(run, asked), strict=True))
    words = [f"labsim, {cells:g}" for cells in OWN] + [f"mesh, {cells:g}" for cells in MESH[1:]]
    print("| effect | changes, rms % | off from the mesh, rms %: " + " | ".join(words) + " |")
    print("|---" * (2 + len(words)) + "|")
    references = {}
    for name in EFFECTS:
        changed = {
            kind: 100
            * np.array([found[(*kind, name, speed)] - found[(*kind, "", speed)] for speed in SPEEDS])
            for kind in kinds
        }
        reference = references[name] = changed[False, MESH[0]]
        off = [float(np.std(changed[kind] - reference)) for kind in kinds if kind != (False, MESH[0])]
        print(f"| {name} | {reference.std():.1f} | " + " | ".join(f"{each:.1f}" for each in off) + " |")

    print("\n| effect | one spacing, off by rms % | the mean of two |")
    print("|---|---|---|")
    for name in EFFECTS:
        one, other, between = (
            100
            * np.array([found[True, cells, name, speed] - found[True, cells, "", speed] for speed in SPEEDS])
            for cells in (*(OWN[0] / factor for factor in FELT_SPACINGS), OWN[0])
        )
        print(f"| {name} | {np.std(one - between):.1f} | {np.std((one + other) / 2 - between):.1f} |")

    print("\n| what is left of | " + " | ".join(f"after {name}" for name in EFFECTS) + " |")
    print("|---" * (1 + len(EFFECTS)) + "|")
    for name, own in references.items():
        left = [own - other * np.sum(own * other) / np.sum(other**2) for other in references.values()]
        print(f"| {name} | " + " | ".join(f"{each.std():.1f}" for each in left) + " |")


if __name__ == "__main__":
    main()
