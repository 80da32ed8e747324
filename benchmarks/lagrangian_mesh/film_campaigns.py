"""Make labelled campaigns on the Lagrangian mesh: thirteen filmed drops and two CT scans each.

    python -m benchmarks.lagrangian_mesh.film_campaigns OUT --plan PLAN.toml [--only n01,n02] [--workers 1]

Writes OUT/n01, … (campaign folders, format 1) and OUT/truth.json; a folder appears when it is complete, and a second call makes
what is missing. benchmarks/accuracy/fresh.py draws plans. Forces in a plan hold for a tip of 0.5 mm: on the side they grow with
the radius, on the tip with its cross-section. Speeds grow as √p_m, so that drops go 0.4 to 1.5 tip radii deep whatever p_m is;
where what is hidden makes dust so weak that the mesh does not serve, all drops are slower.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from benchmarks.campaigns import labelled
from benchmarks.campaigns.film import Filming, film_drop, read_faults
from benchmarks.campaigns.labelled import SMALL
from benchmarks.campaigns.scan import write_scan
from benchmarks.lagrangian_mesh.mesh import BEAD, Dust, Forces, Numerics, Result, run_drop

LARGE = 1.5e-3  # m
P_M = 1300.0  # Pa, that the speeds below are stated for
# radius (m), mass over a bead's, speed (m/s); the deepest of each projectile first, for it fails first
SERIES = (
    *((SMALL, 1.0, speed) for speed in (0.68, 0.50, 0.50, 0.38, 0.26, 0.18)),
    *((SMALL, 2.5, speed) for speed in (0.42, 0.30, 0.20)),
    *((LARGE, 1.0, speed) for speed in (0.62, 0.40, 0.25)),
    (LARGE, 2.5, 0.32),
)
SCANS = (0.62, 0.36)  # m/s, of beads
CELLS, DEPTH = 12.0, 7.0  # in a tip radius; tip radii
AFTER, REST = 1.6, 2.0  # of the stopping time: for which a film goes on, after which a bead is scanned
# of the radius, with which a force of a plan grows from SMALL on
POWERS = {"side": 1, "shaft_drag": 1, "pull": 1, "viscous": 2, "inertial": 2, "film": 2}
ON_SHAFT = ("side", "shaft_drag")
SLOWER = (1.0, 0.8, 0.64, 0.5)
DEEPEST = 1.8  # tip radii, that the mesh still serves to


class TooDeep(Exception):
    """A drop deeper than the mesh serves to."""


def run(hidden: dict, radius: float, mass: float, speed: float, p_m: float, *, bead: bool = False) -> Result:
    """One drop with what is hidden. Raises TooDeep."""
    terms = {}
    for name, value in hidden.get("body", {}).items():
        larger = (radius / SMALL) ** POWERS.get(name, 0)
        if not (bead and name in ON_SHAFT):
            terms[name] = (value[0] * larger, value[1]) if name == "film" else value * larger
    numerics = Numerics(cells=CELLS, depth=DEPTH, floor=hidden.get("floor", math.inf))
    dust = Dust(p_m=p_m, **labelled.set_dust(hidden))
    try:
        found = run_drop(
            dust, radius, speed, numerics, mass, bead, forces=Forces(**terms), after=REST if bead else AFTER
        )
    except RuntimeError as error:
        raise TooDeep from error
    if found.stopping_depth > DEEPEST * radius:
        raise TooDeep
    return found


def spread_points(result: Result, h: float) -> np.ndarray:
    """(k, 4) r, z, volume, φ of points in the cells, less than ``h`` apart."""

    def divide(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cell and place in it, 0 to 1, of points along one direction; edges : (cells,) widths."""
        counts = np.ceil(1.5 * edges / h).astype(int) + 1
        return np.repeat(np.arange(counts.size), counts), np.concatenate(
            [(np.arange(n) + 0.5) / n for n in counts]
        )

    nodes = np.stack([result.nodes_r, result.nodes_z], axis=-1)
    across = np.linalg.norm(np.diff(nodes, axis=0), axis=-1).max(axis=1)
    down = np.linalg.norm(np.diff(nodes, axis=1), axis=-1).max(axis=0)
    (i, u), (j, v) = divide(across), divide(down)
    u, v = u[:, None, None], v[None, :, None]
    corner = [nodes[i + a][:, j + b] for a, b in ((0, 0), (1, 0), (0, 1), (1, 1))]
    place = (1 - u) * ((1 - v) * corner[0] + v * corner[2]) + u * ((1 - v) * corner[1] + v * corner[3])
    # each of the points of a cell holds a share of its volume in proportion to its radius
    total = np.zeros(result.volume.shape)
    cell = np.ix_(i, j)
    r, z = place[..., 0], place[..., 1]
    np.add.at(total, cell, r)
    volume = result.volume[cell] * r / total[cell]
    # linear between the middles of cells, with the mean of each kept: in steps a crust would show rows that alternate by 2e-4
    index = np.meshgrid(i + u.ravel() - 0.5, j + v.ravel() - 0.5, indexing="ij")
    phi = map_coordinates(result.phi, index, order=1, mode="nearest")
    held = np.zeros(result.volume.shape)
    np.add.at(held, cell, volume * phi)
    phi += (result.phi - held / result.volume)[cell]
    return np.column_stack([each.ravel() for each in (r, z, volume, phi)])


def film_rods(hidden: dict, folder: Path, slower: float) -> dict:
    """Films of rods; the truth of each."""
    measure = hidden.get("measure", {})
    sequence = np.random.default_rng([hidden["seed"], 0]).permutation(len(SERIES)) + 1
    drops = {}
    for k, (radius, heavier, nominal) in enumerate(SERIES):
        rng = np.random.default_rng([hidden["seed"], 1, k])
        mass = BEAD * radius**3 * heavier
        speed = nominal * slower * math.sqrt(hidden["pm"] / P_M) * rng.uniform(0.94, 1.06)
        own = labelled.draw_strength(hidden, rng.normal(), (int(sequence[k]) - 1) / (len(SERIES) - 1))
        own *= hidden.get("small_strength", 1.0) if radius == SMALL else 1.0
        result = run(hidden, radius, mass * measure.get("mass", 1.0), speed, own)
        filming = Filming(
            frame_rate=10e3 if radius == SMALL else 5e3,
            pixel_size=20e-6 if radius == SMALL else 40e-6,
            after=AFTER * result.stopping_time,
            noise_slope=hidden.get("noise_slope", 0.0),
            **read_faults(measure),
        )
        label = f"D{k + 1:02d}"
        film_drop(
            folder / "drops" / label, result, speed, filming, rng,
            radius=radius, mass=mass, sequence=int(sequence[k]), length=4e-3 if radius == SMALL else 9e-3,
        )  # fmt: skip
        drops[label] = labelled.name_drop(result, speed, own)
    return drops


def scan_beads(hidden: dict, folder: Path, slower: float) -> dict:
    """Two CT scans; the truth of each."""
    ct = hidden.get("ct", {})
    scans = {}
    for k, nominal in enumerate(SCANS):
        rng = np.random.default_rng([hidden["seed"], 2, k])
        speed = nominal * slower * math.sqrt(hidden["pm"] / P_M) * rng.uniform(0.94, 1.06)
        own = labelled.draw_strength(hidden, rng.normal()) * hidden.get("small_strength", 1.0)
        mass = BEAD * SMALL**3
        result = run(hidden, SMALL, mass * hidden.get("measure", {}).get("mass", 1.0), speed, own, bead=True)
        dust = Dust(p_m=own, **labelled.set_dust(hidden))
        h = SMALL / CELLS
        # the bead that has bounced lies again on the dust that has sprung back
        tip = -float(result.nodes_z[0, 0])
        label = f"C{k + 1:02d}"
        scans[label] = write_scan(
            folder / "ct" / label, spread_points(result, h), dust.fill, tip, SMALL, mass,
            speed, h, rng, ct.get("scale", 1.0), ct["blur_mm"] * 1e-3 if "blur_mm" in ct else None,
        )  # fmt: skip
    return scans


def make_campaign(job: tuple[dict, Path]) -> tuple[str, dict]:
    hidden, out = job
    name = hidden["name"]
    nominal = Dust()
    for slower in SLOWER:
        try:
            with labelled.write_folder(out, name) as folder:
                drops = film_rods(hidden, folder, slower)
                scans = scan_beads(hidden, folder, slower) if hidden.get("scans", True) else {}
                description = "Films of rods that drop into dust, and scans of beads, on a Lagrangian mesh"
                labelled.write_sample(
                    folder, name, description, nominal, nominal.filling_factor, nominal.solid
                )
        except TooDeep:
            continue
        return name, {**labelled.name_hidden(hidden), "name": name, "drops": drops, "scans": scans}
    raise RuntimeError(f"{name}: drops go too deep for the mesh, however slow")


if __name__ == "__main__":
    labelled.make_campaigns(make_campaign, __doc__, None, "n")
