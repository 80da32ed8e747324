"""The slope Δ and the ceiling φ2 of the strength from a compression test, alone and beside drops, and p_m beside them.

    python benchmarks/lagrangian_mesh/make_campaigns.py FOLDER --plan benchmarks/lagrangian_mesh/static_tests.toml
    python benchmarks/slope_and_ceiling.py FOLDER g21,g22 [--workers 2]

Alone: the curve of four parameters through the test's rows. Beside drops: p_m, the p_m of the test over it, Δ, and φ2 where that
is hidden too, all by ``labsim.calibrate``. Printed are medians and the truth, and how often they agree.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.inference.calibrate import calibrate
from labsim.inference.observations.static_tests import fit_strength
from labsim.inference.scatter import set_terms

KIND = "compression_omnidirectional"
NOMINAL = {"delta": 0.58, "phi_2": 0.58}
CLOSE = 0.05


@dataclass(frozen=True)
class Found:
    """alone, beside : Δ and φ2 of the test alone and beside drops (what is not free is nominal); p_m : Pa, 5, 50 and 95 % of the
    posterior."""

    alone: dict[str, float]
    beside: dict[str, float]
    p_m: tuple[float, float, float]


def measure(folder: Path, causes: tuple[str, ...]) -> Found:
    campaign = read_campaign(folder)
    tests = [test for test in campaign.strength_tests if test.kind == KIND]
    curve = fit_strength(KIND, tests, set_terms(campaign).scatter)
    found = calibrate(campaign, ("p_m", *causes), workers=1).posterior
    free = {"delta": "strength_slope.delta", "phi_2": "strength_ceiling.phi_2"}
    beside = {
        key: float(np.median(found.samples(name))) if name.split(".")[0] in causes else NOMINAL[key]
        for key, name in free.items()
    }
    low, middle, high = (float(q) for q in np.quantile(found.samples("p_m_Pa"), [0.05, 0.5, 0.95]))
    return Found({key: curve.values[key] for key in NOMINAL}, beside, (low, middle, high))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    names = asked.names.split(",")
    # the causes are stated to the calibration; their sizes stay in truth.json until all is found
    truth = json.loads((asked.folder / "truth.json").read_text())
    causes = [tuple(truth[name]["cause"].split(" + ")) for name in names]
    print(
        "| campaign | Δ true, alone, beside | φ2 true, alone, beside | p_m true, found (kPa) |\n|---|---|---|---|"
    )
    counts = {key: 0 for key in ("Δ alone", "φ2 alone", "Δ beside", "φ2 beside", "p_m in its 90 % interval")}
    with ProcessPoolExecutor(asked.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        results = pool.map(measure, [asked.folder / name for name in names], causes)
        for name, found in zip(names, results, strict=True):
            true = NOMINAL | {key: v for key, v in truth[name]["mat"].items() if key in NOMINAL}
            cells = [f"{true[k]:.3f}, {found.alone[k]:.3f}, {found.beside[k]:.3f}" for k in NOMINAL]
            low, middle, high = (p / 1e3 for p in found.p_m)
            p_m = truth[name]["pm"] / 1e3
            print(
                f"| {name} | {' | '.join(cells)} | {p_m:.2f}, {middle:.2f} ({low:.2f} to {high:.2f}) |",
                flush=True,
            )
            for key, sign in (("delta", "Δ"), ("phi_2", "φ2")):
                for way, values in (("alone", found.alone), ("beside", found.beside)):
                    counts[f"{sign} {way}"] += abs(values[key] / true[key] - 1.0) < CLOSE
            counts["p_m in its 90 % interval"] += low < p_m < high
    print()
    for what, count in counts.items():
        print(f"{what}{'' if 'p_m' in what else f' within {100 * CLOSE:g} %'}: {count} of {len(names)}")


if __name__ == "__main__":
    main()
