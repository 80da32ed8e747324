"""Make labelled campaigns with the material-point solver: 15 drops as tracks and two CT scans each.

    python -m benchmarks.material_points.make_campaigns OUT [--plan PLAN.toml] [--only c01,c02] [--workers 1]

Writes OUT/c01, OUT/c02, … (campaign folders, format 1) and OUT/truth.json; a folder appears when it is complete, and a
second call makes what is missing. The plan says what is hidden in each (plan.toml beside this file).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.campaigns import labelled
from benchmarks.campaigns.film import Filming, film_drop, read_faults
from benchmarks.campaigns.labelled import SMALL
from benchmarks.campaigns.scan import write_scan
from benchmarks.material_points.drop import (
    SOLID,
    Body,
    Dust,
    Numerics,
    extrapolate_drop,
    fill_factor_at,
    run_drop,
)

BEAD = 2540.0 * 4.0 / 3.0 * np.pi  # kg/m^3: mass of a glass bead over the cube of its radius
LARGE = 1.5e-3  # m
# and half as many cells again, for the limit of no cell size; a smaller domain costs less than 0.1 % of the depth
NUMERICS = Numerics(cells=8.0, courant=0.5, own=0.98, width=4.0, height=3.0, near=2.2)
# a map has no limit of two runs: one run whose projectile is felt a sixth of a cell around it, as deep as the limit to 0.6 %
MAPPED = Numerics(cells=12.0, courant=0.5, own=0.98, height=5.0, gap=0.17)
FILLING = 0.150  # as stated
# radius (m), mass over a bead's, nominal speed (m/s), film after contact (s)
SERIES = (
    *((SMALL, 1.0, speed, 4.85e-3) for speed in (0.15, 0.30, 0.45, 0.65, 0.65, 0.90, 1.10)),
    *((SMALL, 2.5, speed, 7.35e-3) for speed in (0.30, 0.50, 0.75)),
    *((LARGE, 1.0, speed, 10.7e-3) for speed in (0.20, 0.40, 0.40, 0.70)),
    (LARGE, 2.5, 0.30, 16.3e-3),
)
SCANS = (0.75, 0.37)  # m/s
AFTER = 1.6  # of the stopping time, for which runs of rods go on: films show how far they come back up
REST = 2.0  # of the stopping time: a bead is scanned after it has come to rest, some of its depth above the deepest point


def dust_of(hidden: dict, p_m: float) -> Dust:
    return Dust(p_m=p_m, **{"filling_factor": FILLING, **labelled.set_dust(hidden)})


def body_of(hidden: dict, radius: float, mass: float, sphere: bool = False) -> Body:
    """Side forces and the pull grow with the radius; what the plan gives holds for 0.5 mm."""
    terms = dict(hidden.get("body", {}))
    for name in ("side", "shaft_drag", "pull"):
        if name in terms:
            terms[name] *= radius / SMALL
    if sphere:  # no shaft
        terms.pop("side", None)
        terms.pop("shaft_drag", None)
    return Body(radius=radius, mass=mass, sphere=sphere, **terms)


def make_campaign(job: tuple[dict, Path]) -> tuple[str, dict]:
    hidden, out = job
    name = hidden["name"]
    with labelled.write_folder(out, name) as folder:
        rng = np.random.default_rng(hidden["seed"])
        drops = drop_rods(hidden, folder, rng)
        scans = scan_beads(hidden, folder, rng)
        description = "Drops of rods and glass beads into dust, by a material-point solver"
        labelled.write_sample(folder, name, description, Dust(), FILLING, SOLID)
    return name, {**labelled.name_hidden(hidden), "name": name, "drops": drops, "scans": scans}


def drop_rods(hidden: dict, folder: Path, rng: np.random.Generator) -> dict:
    """Fifteen films; the truth of each."""
    measure = hidden.get("measure", {})
    sequence = rng.permutation(len(SERIES)) + 1
    drops = {}
    for k, (radius, heavier, nominal, after) in enumerate(SERIES):
        mass = BEAD * radius**3 * heavier
        speed = nominal * rng.uniform(0.94, 1.06)
        own = labelled.draw_strength(hidden, rng.normal(), (int(sequence[k]) - 1) / (len(SERIES) - 1))
        if radius < 1e-3:
            own *= hidden.get("small_strength", 1.0)
        body = body_of(hidden, radius, mass * measure.get("mass", 1.0))
        result = extrapolate_drop(dust_of(hidden, own), body, speed, NUMERICS, stop_factor=AFTER)
        assert result.stopping_time > 0.0, f"{hidden['name']} drop {k + 1} did not stop"
        label = f"D{k + 1:02d}"
        drops[label] = labelled.name_drop(result, speed, own)
        filming = Filming(
            frame_rate=10000.0 if radius < 1e-3 else 5000.0,
            pixel_size=20e-6 if radius < 1e-3 else 40e-6,
            after=after,
            **read_faults(measure),
        )
        film_drop(
            folder / "drops" / label, result, speed, filming, rng,
            radius=radius, mass=mass, sequence=int(sequence[k]), length=4e-3 if radius < 1e-3 else 9e-3,
        )  # fmt: skip
    return drops


def scan_beads(hidden: dict, folder: Path, rng: np.random.Generator) -> dict:
    """Two CT scans; the truth of each."""
    measure, ct = hidden.get("measure", {}), hidden.get("ct", {})
    scans = {}
    for k, nominal in enumerate(SCANS):
        speed = nominal * rng.uniform(0.94, 1.06)
        own = labelled.draw_strength(hidden, rng.normal()) * hidden.get("small_strength", 1.0)
        mass = BEAD * SMALL**3
        dust = dust_of(hidden, own)
        body = body_of(hidden, SMALL, mass * measure.get("mass", 1.0), sphere=True)
        result = run_drop(dust, body, speed, MAPPED, stop_factor=REST)
        blur = ct["blur_mm"] * 1e-3 if "blur_mm" in ct else None
        scans[f"C{k + 1:02d}"] = write_scan(
            folder / "ct" / f"C{k + 1:02d}", result.points, partial(fill_factor_at, dust),
            float(result.depth[-1]), SMALL, mass, speed, SMALL / MAPPED.cells, rng, ct.get("scale", 1.0), blur,
        )  # fmt: skip
    return scans


if __name__ == "__main__":
    labelled.make_campaigns(make_campaign, __doc__, Path(__file__).parent / "plan.toml", "c")
