"""p_m of the same drops by accelerometers, by a camera, and by both.

    python -m benchmarks.acceleration.felt_and_filmed f91,f92 [--workers 2]

The names are of campaigns in benchmarks/lagrangian_mesh/fresh.toml. Each is made three times: its drops felt, filmed, and felt
and filmed, with the same dust and the same noise. Printed are ln p_m less the truth and its standard deviation, of each, and in
how many campaigns both together are not wider than the better of the two.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import tempfile
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.lagrangian_mesh.make_campaigns import make_campaign
from labsim.campaign import read_campaign
from labsim.inference.calibrate import calibrate

PLAN = Path(__file__).parents[1] / "lagrangian_mesh" / "fresh.toml"
FILMS = {"felt": False, "filmed": "alone", "both": True}


def measure(plan: dict) -> dict[str, tuple[float, float, bool]]:
    """Of each: ln p_m less the truth, its standard deviation, and whether the truth is between the 5 and 95 % quantiles."""
    found = {}
    for way, film in FILMS.items():
        with tempfile.TemporaryDirectory() as folder:
            name, _ = make_campaign(({**plan, "film": film}, Path(folder)))
            log_p_m = np.log(
                calibrate(read_campaign(Path(folder) / name), workers=1).posterior.samples("p_m_Pa")
            )
        off = float(log_p_m.mean()) - math.log(plan["pm"])
        low, high = np.quantile(log_p_m, [0.05, 0.95])
        found[way] = off, float(log_p_m.std()), bool(low < math.log(plan["pm"]) < high)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    plans = {each["name"]: each for each in tomllib.loads(PLAN.read_text())["campaign"]}
    names = asked.names.split(",")
    print("| campaign | " + " | ".join(FILMS) + " |\n|---|" + "---|" * len(FILMS), flush=True)
    widths, inside = [], []
    with ProcessPoolExecutor(asked.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for name, found in zip(names, pool.map(measure, [plans[name] for name in names]), strict=True):
            cells = [f"{off:+.3f} ± {sigma:.3f}" for off, sigma, _ in found.values()]
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
            widths.append([sigma for _, sigma, _ in found.values()])
            inside.append([within for _, _, within in found.values()])
    felt, filmed, both = np.transpose(widths)
    print(f"\nboth not wider than the better: {np.sum(both <= np.minimum(felt, filmed))} of {len(names)}")
    print(f"widths of both over the better, mean: {np.mean(both / np.minimum(felt, filmed)):.2f}")
    counts = [f"{way} {count}" for way, count in zip(FILMS, np.sum(inside, axis=0), strict=True)]
    print(f"the truth in the 90 % interval: {', '.join(counts)} of {len(names)}")


if __name__ == "__main__":
    main()
