"""What laws on the projectile change of drops: from runs without them (deflection.py), beside runs with them.

    python -m benchmarks.solver.deflected [--p_m 1300] [--cells 4] [--radius 0.5] [--workers 2]

For each law and speed the change of the depth in %, simulated / deflected; last the rms of the difference over that of the
change, of depths and of stopping times.
"""

from __future__ import annotations

import argparse

import numpy as np

from labsim.effects.terms import add_term, list_terms
from labsim.inference.emulation.curves import extract_curve
from labsim.inference.emulation.deflection import deflect
from labsim.records import Material, Projectile
from labsim.runs.parts import Motion
from labsim.runs.store import RunStore
from labsim.sph import DropSetting

SPEEDS = (0.15, 0.22, 0.34, 0.5, 0.78, 1.1)  # m/s
DENSITY = 1.33e-6 / 0.5e-3**3  # kg/m³, mass over radius cubed of the usual bead
LAWS = {  # term: coefficient
    "constant_pressure": 100.0,
    "film_at_0_2_mm": 150.0,
    "depth_spring": 40.0,
    "inertial_drag": 150.0,
    "viscous_drag": 100.0,
    "shaft_drag": 150.0,
    "shaft_viscosity": 60.0,
    "time_ramp": 30.0,
    "stuck_mass": 0.1,
    "gathered_mass": 0.1,
    "rim_pull": 0.03,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--p_m", type=float, default=1300.0)
    parser.add_argument("--cells", type=float, default=4.0)
    parser.add_argument("--radius", type=float, default=0.5, help="mm")
    parser.add_argument("--workers", type=int, default=None)
    options = parser.parse_args()
    radius = 1e-3 * options.radius
    bead = Projectile("hemisphere", radius, DENSITY * radius**3)
    plain = [
        DropSetting(bead, speed, Material(p_m=options.p_m), spacing=radius / options.cells, after_stop=0.34)
        for speed in SPEEDS
    ]
    terms = list_terms()
    laws = {name: [add_term(each, terms[name], size) for each in plain] for name, size in LAWS.items()}
    settings = [*plain, *(each for changed in laws.values() for each in changed)]
    runs = RunStore().get_parts(settings, [Motion] * len(settings), workers=options.workers)
    before = np.array([extract_curve(run)[:2] for run in runs[: len(SPEEDS)]])
    deflected = deflect(runs[: len(SPEEDS)], list(laws.values()))
    print("| law | " + " | ".join(f"{speed:g} m/s" for speed in SPEEDS) + " | depth | time |")
    print("| --- " * (len(SPEEDS) + 3) + "|")
    for k, (name, motions) in enumerate(zip(laws, deflected, strict=True), start=1):
        simulated = runs[k * len(SPEEDS) : (k + 1) * len(SPEEDS)]
        change = np.array([extract_curve(run)[:2] for run in simulated]) - before
        said = (
            np.array([extract_curve(each)[:2] if each is not None else [np.nan] * 2 for each in motions])
            - before
        )
        known = np.isfinite(said[:, 0])
        off = np.sqrt(np.sum((said - change)[known] ** 2, axis=0) / np.sum(change[known] ** 2, axis=0))
        cells = " | ".join(
            f"{100 * np.expm1(a):+.1f} / " + (f"{100 * np.expm1(b):+.1f}" if np.isfinite(b) else "–")
            for a, b in zip(change[:, 0], said[:, 0], strict=True)
        )
        term = terms[name]
        unit = "" if term.unit == "1" else f" {term.unit}"
        print(
            f"| {term.title}, {LAWS[name]:g}{unit} | {cells} | {100 * off[0]:.0f} % | {100 * off[1]:.0f} % |"
        )


if __name__ == "__main__":
    main()
