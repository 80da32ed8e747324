"""Updates per CPU-second of the solver: elastic rings beside PySPH, and porous drops from 4k to 300k particles.

    OMP_NUM_THREADS=1 python -m benchmarks.speed.solver                        # everything but PySPH
    OMP_NUM_THREADS=1 python -m benchmarks.speed.solver --pysph PYTHON         # and PySPH's rings, with that interpreter

PySPH is timed in an environment of its own, made with
    python3 -m venv V && V/bin/pip install "setuptools<70" wheel "numpy<2" "cython<3.1" mako cyarray compyle pytools
    V/bin/pip install --no-build-isolation pysph
CPU time of the process is what counts: wall time on a shared machine says nothing. One update is one particle moved by
one step, list rebuilds included, compilation not. Prints Markdown for docs/performance-solver.md.
"""

from __future__ import annotations

import argparse
import datetime
import math
import platform
import resource
import subprocess
import sys
import time
from pathlib import Path

from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate
from labsim.sph.bodies import evolve_body, place_rings

RADIUS = 5e-4
PYSPH = """
import sys, tempfile, time
import numpy as np
from pysph.examples.solid_mech.rings import Rings
cpu = []
class Timed(Rings):
    def post_step(self, solver):
        cpu.append(time.process_time())
app = Timed(output_dir=tempfile.mkdtemp())
app.run(["--max-steps", "40", "--pfreq", "1000000", "--disable-output", "--no-openmp"])
n = app.particles[0].get_number_of_particles()
print("RESULT", n, n / np.diff(cpu)[2:].mean())
"""


def time_rings(steps: int) -> tuple[int, float]:
    """Particles and updates per CPU-second of two elastic rings of 17.6k particles in all."""
    setting, state = place_rings(0.05, 1e9)
    step = setting.numerics.courant * setting.numerics.smoothing * 0.05 / math.sqrt(1 + 4 / 3 * 0.22)
    evolve_body(setting.replace(duration=12 * step), state)  # compiles
    began = time.process_time()
    result = evolve_body(setting.replace(duration=steps * step), state)
    return state.shape[1], state.shape[1] * (len(result.log) - 1) / (time.process_time() - began)


def drop_setting(geometry: str, particles: int, steps: int) -> DropSetting:
    """A 1 mm bead (or cylinder) at 0.66 m/s into dust of about ``particles`` particles, for about ``steps`` steps."""
    planar = geometry == "planar"
    projectile = (
        Projectile("cylinder", RADIUS, 2540 * math.pi * RADIUS**2)
        if planar
        else Projectile("hemisphere", RADIUS, 2540 * 4 / 3 * math.pi * RADIUS**3)
    )
    setting = DropSetting(projectile, 0.66, Material(), geometry=geometry)
    width, depth = setting.extent
    spacing = math.sqrt(width * depth / particles)
    step = setting.numerics.courant * setting.numerics.smoothing * spacing / math.sqrt(45e3 * 5 / 3 / 300)
    return setting.replace(spacing=spacing, duration=steps * step)


def time_drop(geometry: str, particles: int, steps: int) -> tuple[int, float]:
    setting = drop_setting(geometry, particles, steps)
    began = time.process_time()
    run = simulate(setting)
    return run.particles.r.size, run.particles.r.size * run.steps / (time.process_time() - began)


def time_pysph(python: str) -> tuple[int, float]:
    out = subprocess.run([python, "-c", PYSPH], capture_output=True, text=True, check=True).stdout
    _, particles, rate = next(line for line in out.splitlines() if line.startswith("RESULT")).split()
    return int(particles), float(rate)


def commit() -> str:
    here = Path(__file__).parent
    out = subprocess.run(
        ["git", "-C", here, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    return out.stdout.strip() or "unknown"


def processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    return next(
        (line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine()
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pysph", help="interpreter of an environment with PySPH")
    parser.add_argument("--largest", type=int, default=300_000, help="particles of the largest drop")
    options = parser.parse_args()
    print(
        f"{datetime.date.today()}, {processor()}, one core, Python {platform.python_version()}, commit {commit()}\n"
    )
    print("| what | particles | updates per CPU-second |\n| --- | --- | --- |")
    particles, rings = time_rings(300)
    print(f"| elastic rings | {particles} | {rings:.2e} |", flush=True)
    if options.pysph:
        particles, other = time_pysph(options.pysph)
        print(f"| the same example in PySPH | {particles} | {other:.2e} |")
        print(f"| ratio | | {rings / other:.1f} |", flush=True)
    for geometry in ("planar", "axisymmetric"):
        simulate(drop_setting(geometry, 3000, 5))  # compiles
        for size, steps in ((4_000, 1500), (17_600, 600), (70_000, 200), (300_000, 60)):
            if size <= options.largest:
                particles, rate = time_drop(geometry, size, steps)
                print(f"| porous drop, {geometry} | {particles} | {rate:.2e} |", flush=True)
    bead = Projectile("hemisphere", RADIUS, 2540 * 4 / 3 * math.pi * RADIUS**3)
    setting = DropSetting(bead, 0.66, Material(), spacing=RADIUS / 8)
    began = time.process_time()
    run = simulate(setting)
    print(f"\nDrop in r-z, a/dx = 8, K0 45 kPa, 0.66 m/s, to 1.2 T_s: {time.process_time() - began:.2f} CPU-s "
          f"({run.particles.r.size} particles, {run.steps} steps, {run.rebuilds} lists)")  # fmt: skip
    print(
        f"Largest memory of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB"
    )


if __name__ == "__main__":
    sys.exit(main())
