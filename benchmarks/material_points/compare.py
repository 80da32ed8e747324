"""Set this solver beside another material-point solver: its table, its curves, the campaigns made with it.

    python -m benchmarks.material_points.compare [--cells 8,12] [--curves] [--labelled FOLDER] [--drops D01,D03,…]

The other solver's figures: same equations and method, written by somebody else, at the same cells in a radius. FOLDER
holds labelled campaigns and a truth.json with the hidden cause and each drop's true speed and depth.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import tomllib
from pathlib import Path

import numpy as np

from benchmarks.material_points.drop import Body, Dust, Numerics, Result, run_drop

BEAD_DENSITY = 2540.0
CURVES = Path(__file__).parents[2] / "data" / "reference" / "independent_curves.csv"
# case: radius mm, speed m/s, p_m Pa, K0 kPa; at 8 and 12 cells a radius: depth mm, stopping time ms, V(φ > 0.20)
TABLE = {
    "A": (0.5, 0.65, 1300, 45.0, {8: (0.6933, 1.811, 0.680), 12: (0.6917, 1.790, 0.706)}),
    "B": (0.5, 0.20, 1300, 45.0, {8: (0.2160, 1.706, 0.082), 12: (0.2168, 1.689, 0.086)}),
    "C": (0.5, 1.00, 1300, 45.0, {8: (1.1812, 2.118, 1.388), 12: (1.1815, 2.103, 1.477)}),
    "D": (1.5, 0.40, 1300, 45.0, {8: (1.3149, 5.257, 0.323), 12: (1.3115, 5.176, 0.338)}),
    "E": (0.5, 0.65, 2600, 45.0, {8: (0.5674, 1.460, 0.408), 12: (0.5641, 1.437, 0.418)}),
    "F": (0.5, 0.65, 1300, 4.5, {8: (0.7649, 1.981, 0.604), 12: (0.7529, 1.941, 0.613)}),
}
# the labelled campaigns' words for what is hidden
DUST_WORDS = {
    "eta": "eta",
    "raten": "rate_n",
    "delta": "delta",
    "yf": "shear_factor",
    "pgas": "gas_pressure",
}
BODY_WORDS = {"mu_f": "friction", "accrete": "accreted"}


def drop_bead(radius: float, speed: float, dust: Dust, cells: float) -> Result:
    mass = BEAD_DENSITY * 4 / 3 * np.pi * radius**3
    return run_drop(dust, Body(radius=radius, mass=mass), speed, Numerics(cells=cells), stop_factor=1.0)


def percent(mine: float, other: float) -> str:
    return f"{100 * (mine / other - 1):+.2f}"


def compare_table(cells: int) -> None:
    print(f"\na/h = {cells} | case | D mm | other | % | T_s ms | other | % | V(phi > 0.20) | other |")
    for case, (radius, speed, p_m, bulk, theirs) in TABLE.items():
        depth, stop, volume = theirs[cells]
        found = drop_bead(radius * 1e-3, speed, Dust(p_m=p_m, bulk_modulus=bulk * 1e3), cells)
        points = found.points
        dense = points[points[:, 3] > 0.20, 2].sum() / (4 / 3 * np.pi * (radius * 1e-3) ** 3)
        mine, time = found.stopping_depth * 1e3, found.stopping_time * 1e3
        print(
            f"| {case} | {mine:.4f} | {depth} | {percent(mine, depth)} | {time:.3f} | {stop} | {percent(time, stop)} "
            f"| {dense:.3f} | {volume} |",
            flush=True,
        )


def compare_curves() -> None:
    print("\na/h = 12 | a mm | v m/s | D mm | other | % | largest difference of the curve, % of D |")
    curves: dict[tuple[float, float], list[tuple[float, float]]] = {}
    with CURVES.open() as lines:
        for row in csv.DictReader(lines):
            key = float(row["tip_radius_mm"]), float(row["speed_m_s"])
            curves.setdefault(key, []).append((float(row["time_ms"]), float(row["depth_mm_h12"])))
    for (radius, speed), rows in curves.items():
        time, depth = np.array(rows).T
        found = drop_bead(radius * 1e-3, speed, Dust(), 12)
        mine = np.interp(time * 1e-3, found.time, found.depth) * 1e3
        off = np.abs(mine - depth).max() / depth[-1] * 100
        deepest = found.stopping_depth * 1e3
        print(
            f"| {radius} | {speed} | {deepest:.4f} | {depth.max():.4f} | {percent(deepest, depth.max())} "
            f"| {off:.2f} |",
            flush=True,
        )


def hidden_terms(truth: dict) -> tuple[dict, dict]:
    dust = {DUST_WORDS[key]: value for key, value in truth["mat"].items()}
    body = {BODY_WORDS[key]: value for key, value in truth["dyn"].items() if key in BODY_WORDS}
    if truth["profile"]:
        dust["crust"] = (truth["profile"]["df"], truth["profile"]["l"])
    if "side" in truth["dyn"]:
        body["side"] = float(re.match(r"[\d.]+", truth["note"]).group())
    return dust, body


def compare_labelled(folder: Path, names: list[str], cells: float, rate_in_shear: bool) -> None:
    print(f"\na/h = {cells} | campaign | cause | mine over true depth, %: " + " | ".join(names) + " | mean |")
    for campaign, truth in json.loads((folder / "truth.json").read_text()).items():
        dust, body = hidden_terms(truth)
        off = []
        for name in names:
            stated = tomllib.loads((folder / campaign / "drops" / name / "drop.toml").read_text())[
                "projectile"
            ]
            radius = stated["tip_radius_mm"] * 1e-3
            terms = dict(body)
            if "side" in terms:
                terms["side"] *= radius / 0.5e-3
            found = run_drop(
                Dust(p_m=truth["pm"], rate_in_shear=rate_in_shear, **dust),
                Body(radius=radius, mass=stated["mass_mg"] * 1e-6, **terms),
                truth["drops"][name]["true_v0"],
                Numerics(cells=cells),
                stop_factor=1.0,
            )
            off.append(100 * (found.stopping_depth / truth["drops"][name]["true_depth"] - 1))
        print(
            f"| {campaign} | {truth['cause']} | "
            + " | ".join(f"{x:+.1f}" for x in off)
            + f" | {np.mean(off):+.1f} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", default="")
    parser.add_argument("--curves", action="store_true")
    parser.add_argument("--labelled", type=Path)
    parser.add_argument("--labelled-cells", type=float, default=8.0)
    parser.add_argument("--drops", default="D01,D03,D06,D10,D11,D14")
    parser.add_argument(
        "--rate-leaves-shear", action="store_true", help="Y keeps the strength without the rate"
    )
    arguments = parser.parse_args()
    for cells in arguments.cells.split(",") if arguments.cells else []:
        compare_table(int(cells))
    if arguments.curves:
        compare_curves()
    if arguments.labelled:
        names = arguments.drops.split(",")
        compare_labelled(arguments.labelled, names, arguments.labelled_cells, not arguments.rate_leaves_shear)


if __name__ == "__main__":
    main()
