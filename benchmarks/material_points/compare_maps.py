"""Are the solver's errors of CT maps common to the scans of a campaign, and how large? Maps at the truth, by another code.

    OMP_NUM_THREADS=1 python -m benchmarks.material_points.compare_maps FOLDER [--store STORE]

FOLDER holds campaigns of make_campaigns.py and their truth.json, or others labelled alike. Each is linearised at its true p_m
with what is hidden at its true strength: χ² of all its maps together, what their ln likelihood is more than with errors of each
map, and what it is more with other sizes of the error that is left where nothing is compacted.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

from benchmarks.material_points.compare_changes import read_hidden
from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.fits.blocks import Block
from labsim.inference.fits.fitting import Fit, fit_hypothesis
from labsim.inference.fits.tangents import linearise_at
from labsim.inference.observations import compacted_zone
from labsim.inference.problem import Problem
from labsim.runs.store import RunStore

FLOORS = (0.003, 0.001, 0.0005, 0.0003)  # beside the one that is


def rate(block: Block) -> float:
    """ln likelihood, up to a constant of the number of data."""
    return -0.5 * (block.chi_square + block.log_determinant)


def rate_with(problem: Problem, fit: Fit, floor: float) -> float:
    """ln likelihood of the maps with another error where nothing is compacted."""
    usual = compacted_zone.NUMERICAL_FLOOR
    compacted_zone.NUMERICAL_FLOOR = floor
    try:
        return rate(linearise_at(problem, fit.nuisances, fit.log_p_m, fit.values)[1])
    finally:
        compacted_zone.NUMERICAL_FLOOR = usual


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--store", type=Path, default=Path("runs"))
    given = parser.parse_args()
    floors = " | ".join(f"{floor:g}" for floor in FLOORS)
    print(f"| campaign | maps | data | χ² | with common errors | {floors} |")
    print("|" + "---|" * (5 + len(FLOORS)))
    for name, truth in sorted(json.loads((given.folder / "truth.json").read_text()).items()):
        hidden = read_hidden(truth)
        if hidden is None or not (given.folder / name).is_dir():
            continue
        problem, nominal = prepare(read_campaign(given.folder / name), RunStore(given.store), workers=1)
        found = problem.find(compacted_zone.CompactedZones)
        if found is None or len(problem.scans) < 2:
            continue
        values = {
            effect: value - problem.effects[effect].amplitudes[0].null for effect, value in hidden.items()
        }
        start = (math.log(truth["pm"]), values)
        fit = fit_hypothesis(problem, tuple(hidden), start, iterations=0, nuisances=nominal)
        maps = fit.blocks[found[0]]
        each = [Block(maps.residual[s], maps.covariance[s, s], {}) for s in maps.sections.values()]
        other = " | ".join(f"{rate_with(problem, fit, floor) - rate(maps):+.1f}" for floor in FLOORS)
        print(
            f"| {name} | {len(each)} | {maps.residual.size} | {maps.chi_square:.0f} | "
            f"{rate(maps) - sum(map(rate, each)):+.1f} | {other} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
