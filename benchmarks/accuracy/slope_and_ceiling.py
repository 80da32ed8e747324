"""The slope Δ and the ceiling φ2 of the strength from a compression test, alone and beside drops, and p_m beside them.

    python -m benchmarks.lagrangian_mesh.make_campaigns FOLDER --plan benchmarks/lagrangian_mesh/static_tests.toml
    python -m benchmarks.accuracy.slope_and_ceiling FOLDER g21,g22 [--workers 2]

Alone: the curve of four parameters through the test's rows. Beside drops: p_m, the p_m of the test over it, Δ, and φ2 where that
is hidden too, all by ``labsim.calibrate``. Printed are medians and the truth, and how often they agree.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.campaigns.labelled import measure_campaigns
from labsim.campaign import read_campaign
from labsim.inference.calibrate import calibrate
from labsim.inference.observations.static_tests import fit_strength
from labsim.inference.scatter import set_error_budget

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


def measure(folder: Path) -> Found:
    campaign = read_campaign(folder)
    # the causes are stated to the calibration, their sizes are not
    causes = json.loads((folder.parent / "truth.json").read_text())[folder.name]["cause"].split(" + ")
    tests = [test for test in campaign.strength_tests if test.kind == KIND]
    curve = fit_strength(KIND, tests, set_error_budget(campaign).scatter)
    found = calibrate(campaign, ("p_m", *causes), workers=1).posterior
    free = {"delta": "strength_slope.delta", "phi_2": "strength_ceiling.phi_2"}
    beside = {
        key: float(np.median(found.samples(name))) if name.split(".")[0] in causes else NOMINAL[key]
        for key, name in free.items()
    }
    low, middle, high = (float(q) for q in np.quantile(found.samples("p_m_Pa"), [0.05, 0.5, 0.95]))
    return Found({key: curve.values[key] for key in NOMINAL}, beside, (low, middle, high))


def main() -> None:
    print(
        "| campaign | Δ true, alone, beside | φ2 true, alone, beside | p_m true, found (kPa) |\n|---|---|---|---|"
    )
    close, inside = [], []
    for name, truth, found in measure_campaigns(measure, __doc__):
        true = {key: truth["mat"].get(key, NOMINAL[key]) for key in NOMINAL}
        cells = [f"{true[k]:.3f}, {found.alone[k]:.3f}, {found.beside[k]:.3f}" for k in NOMINAL]
        low, middle, high = (p / 1e3 for p in found.p_m)
        p_m = truth["pm"] / 1e3
        print(
            f"| {name} | {' | '.join(cells)} | {p_m:.2f}, {middle:.2f} ({low:.2f} to {high:.2f}) |",
            flush=True,
        )
        close.append(
            [
                abs(each[key] / true[key] - 1.0) < CLOSE
                for key in NOMINAL
                for each in (found.alone, found.beside)
            ]
        )
        inside.append(low < p_m < high)
    print()
    whats = ("Δ, the test alone", "Δ beside drops", "φ2, the test alone", "φ2 beside drops")
    for what, count in zip(whats, np.sum(close, axis=0), strict=True):
        print(f"{what} within {100 * CLOSE:g} %: {count} of {len(close)}")
    print(f"p_m in its 90 % interval: {sum(inside)} of {len(inside)}")


if __name__ == "__main__":
    main()
