"""Make labelled campaigns on the Lagrangian mesh: six drops each, which an accelerometer on the rod feels.

    python -m benchmarks.lagrangian_mesh.make_campaigns OUT [--plan PLAN.toml] [--only a01,a02] [--workers 1]

Writes OUT/a01, OUT/a02, … (campaign folders, format 1) and OUT/truth.json; a folder appears when it is complete, and a second
call makes what is missing. The plan says what is hidden in each (campaigns.toml beside this file). Drops are no deeper than the
1.5 radii that the mesh serves to; its force is smooth to 0.4 % of the peak.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from benchmarks.campaigns import labelled
from benchmarks.campaigns.film import Filming, film_drop
from benchmarks.lagrangian_mesh.feel import SCALE_SIGMA, Sensing, write_felt
from benchmarks.lagrangian_mesh.mesh import BEAD, Dust, Forces, Numerics, run_drop
from benchmarks.lagrangian_mesh.quadrilateral import find_strengths

CELLS = 16.0
# radius (m), mass over a bead's, nominal speed (m/s)
SERIES = (
    (0.75e-3, 1.0, 0.30),
    (0.75e-3, 1.0, 0.50),
    (0.75e-3, 2.5, 0.30),
    (1.5e-3, 1.0, 0.25),
    (1.5e-3, 1.0, 0.42),
    (1.5e-3, 2.5, 0.22),
)
AFTER = 1.5  # stopping times, for which a film and its run go on
PIXELS = 0.03  # of a film, in tip radii
# filling factors of the rows of a static test: a sample pulled apart a row, a sample squeezed all the way
ROWS = {"tension": np.linspace(0.16, 0.40, 6), "compression_omnidirectional": np.linspace(0.14, 0.52, 25)}
RATES, NOISES = (2e3, 50e3), (0.001, 0.02)  # Hz; over the peak: drawn between, evenly in the logarithm


def make_campaign(job: tuple[dict, Path]) -> tuple[str, dict]:
    hidden, out = job
    name = hidden["name"]
    rng = np.random.default_rng(hidden["seed"])
    rate, noise = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (RATES, NOISES))
    quiet = bool(hidden.get("quiet"))
    scale = 1.0 + SCALE_SIGMA * rng.normal()
    sensing = Sensing(rate, noise, 1.0 if quiet else scale, quiet)
    heavier_than_stated = hidden.get("measure", {}).get("mass", 1.0)
    sequence = rng.permutation(len(SERIES)) + 1
    # what is felt is the same with films and tests beside it and without
    beside = np.random.default_rng([hidden["seed"], 1])
    drops = {}
    with labelled.write_folder(out, name) as folder:
        for k, (radius, heavier, nominal) in enumerate(SERIES):
            mass = BEAD * radius**3 * heavier
            speed = nominal * rng.uniform(0.94, 1.06)
            normal = 0.0 * rng.normal() if quiet else rng.normal()
            own = labelled.draw_strength(hidden, normal, (int(sequence[k]) - 1) / (len(SERIES) - 1))
            result = run_drop(
                Dust(p_m=own, **labelled.set_dust(hidden)),
                radius,
                speed,
                Numerics(cells=CELLS),
                mass=mass * heavier_than_stated,
                forces=Forces(side=hidden.get("body", {}).get("side", 0.0) * radius / labelled.SMALL),
                after=AFTER if hidden.get("film") else 1.0,
            )
            label = f"D{k + 1:02d}"
            write_felt(
                folder / "drops" / label, result, sensing, rng,
                radius=radius, mass=mass, sequence=int(sequence[k]), speed=speed,
            )  # fmt: skip
            if hidden.get("film") == "alone":
                shutil.rmtree(folder / "drops" / label)
            if hidden.get("film"):
                filming = Filming(
                    frame_rate=10e3, pixel_size=PIXELS * radius, after=AFTER * result.stopping_time
                )
                film_drop(
                    folder / "drops" / f"{label}-film", result, speed, filming, beside,
                    radius=radius, mass=mass, sequence=int(sequence[k]), length=9e-3,
                    same_as="" if hidden["film"] == "alone" else label,
                )  # fmt: skip
            drops[label] = labelled.name_drop(result, speed, own)
        truth = Dust(p_m=hidden["pm"], **labelled.set_dust(hidden))
        for kind, sigma in hidden.get("tests", {}).items():
            stress = [find_strengths(phi, truth.law)[kind == "tension"] for phi in ROWS[kind]]
            labelled.write_test(folder / "strength" / kind, kind, ROWS[kind], np.array(stress), sigma, beside)
        nominal_dust = Dust()
        how = "before a camera" if hidden.get("film") == "alone" else "with an accelerometer"
        labelled.write_sample(
            folder,
            name,
            f"Drops of rods {how} into dust, on a Lagrangian mesh",
            nominal_dust,
            nominal_dust.filling_factor,
            nominal_dust.solid,
        )
    return name, {**labelled.name_hidden(hidden), "name": name, "drops": drops, "scans": {}}


if __name__ == "__main__":
    labelled.make_campaigns(make_campaign, __doc__, Path(__file__).parent / "campaigns.toml", "a")
