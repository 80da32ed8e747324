"""Shear and tensile strength told apart by a tension test beside drops, and without it.

    python benchmarks/lagrangian_mesh/make_campaigns.py FOLDER --plan benchmarks/lagrangian_mesh/static_tests.toml
    python benchmarks/shear_or_tension.py FOLDER g01,g02 [--workers 2]

One of the two is hidden in each campaign. Both are fitted, with the test and without. Printed is ln of the evidence of the true
one over that of the other, and over that of nothing hidden.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.fitting import fit_hypothesis
from labsim.inference.runs import RunStore
from labsim.inference.scatter import set_terms

CAUSES = ("shear_strength", "tensile_strength")
STARTS = (-0.3, 0.5)  # factors of 0.7 and 1.5: both sides are tried


def weigh(folder: Path, tested: bool) -> dict[str, float]:
    """ln evidence of each cause over that of none."""
    campaign = read_campaign(folder)
    if not tested:
        campaign = replace(campaign, strength_tests=())
    bench, nominal = prepare(campaign, RunStore(), workers=1, terms=set_terms(campaign))
    return {
        cause: max(
            fit_hypothesis(bench, (cause,), (nominal.log_p_m, {cause: start})).evidence for start in STARTS
        )
        - nominal.evidence
        for cause in CAUSES
    }


def measure(folder: Path) -> tuple[dict[str, float], dict[str, float]]:
    return weigh(folder, True), weigh(folder, False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    names = asked.names.split(",")
    truth = json.loads((asked.folder / "truth.json").read_text())
    print(
        "| campaign | hidden | drops and test: over the other, over none | drops alone |\n|---|---|---|---|"
    )
    right = [0, 0]
    with ProcessPoolExecutor(asked.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for name, found in zip(
            names, pool.map(measure, [asked.folder / name for name in names]), strict=True
        ):
            true = truth[name]["cause"]
            (other,) = set(CAUSES) - {true}
            (factor,) = truth[name]["mat"].values()
            cells = [f"{each[true] - each[other]:+.1f}, {each[true]:+.1f}" for each in found]
            print(f"| {name} | {true} × {factor:.2f} | {cells[0]} | {cells[1]} |", flush=True)
            for k, each in enumerate(found):
                right[k] += each[true] > each[other]
    share = [f"{100 * n / len(names):.0f} %" for n in right]
    print(f"\nthe true one before the other, of {len(names)}:")
    print(f"with the test {right[0]} ({share[0]}), drops alone {right[1]} ({share[1]})")


if __name__ == "__main__":
    main()
