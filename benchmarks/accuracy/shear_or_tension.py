"""Shear and tensile strength told apart by a tension test beside drops, and without it.

    python -m benchmarks.lagrangian_mesh.make_campaigns FOLDER --plan benchmarks/lagrangian_mesh/static_tests.toml
    python -m benchmarks.accuracy.shear_or_tension FOLDER g01,g02 [--workers 2]

One of the two is hidden in each campaign. Both are fitted, with the test and without. Printed is ln of the evidence of the true
one over that of the other, and over that of nothing hidden.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.campaigns.labelled import measure_campaigns
from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.inference.scatter import set_error_budget
from labsim.runs.store import RunStore

CAUSES = ("shear_strength", "tensile_strength")
STARTS = (-0.3, 0.5)  # factors of 0.7 and 1.5: both sides are tried


def weigh(folder: Path, tested: bool) -> dict[str, float]:
    """ln evidence of each cause over that of none."""
    campaign = read_campaign(folder)
    if not tested:
        campaign = replace(campaign, strength_tests=())
    problem, nominal = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
    return {
        cause: max(
            fit_hypothesis(problem, (cause,), (nominal.log_p_m, {cause: start})).evidence for start in STARTS
        )
        - nominal.evidence
        for cause in CAUSES
    }


def measure(folder: Path) -> tuple[dict[str, float], dict[str, float]]:
    return weigh(folder, True), weigh(folder, False)


def main() -> None:
    print(
        "| campaign | hidden | drops and test: over the other, over none | drops alone |\n|---|---|---|---|"
    )
    right = []
    for name, truth, found in measure_campaigns(measure, __doc__):
        true = truth["cause"]
        (other,) = set(CAUSES) - {true}
        (factor,) = truth["mat"].values()
        cells = [f"{each[true] - each[other]:+.1f}, {each[true]:+.1f}" for each in found]
        print(f"| {name} | {true} × {factor:.2f} | {cells[0]} | {cells[1]} |", flush=True)
        right.append([each[true] > each[other] for each in found])
    tested, alone = np.sum(right, axis=0)
    print(f"\nthe true one before the other, of {len(right)}: with the test {tested}, drops alone {alone}")


if __name__ == "__main__":
    main()
