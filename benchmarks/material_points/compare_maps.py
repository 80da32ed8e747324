"""Are the solver's errors of CT maps common to the scans of a campaign? Maps at the truth, by another code.

    OMP_NUM_THREADS=1 python benchmarks/material_points/compare_maps.py FOLDER [--store STORE]

FOLDER holds campaigns of make_campaigns.py and their truth.json, or others labelled alike. Each is linearised at its true p_m
with what is hidden at its true strength; ln likelihood of all its maps together, and as if each had errors of its own.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

from compare_changes import read_hidden

from labsim.campaign import read_campaign
from labsim.inference.blocks import Block
from labsim.inference.calibrate import prepare
from labsim.inference.fitting import fit_hypothesis
from labsim.inference.runs import RunStore


def rate(block: Block) -> float:
    """ln likelihood, up to a constant of the number of data."""
    return -0.5 * (block.chi_square + block.log_determinant)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--store", type=Path, default=Path("runs"))
    given = parser.parse_args()
    print("| campaign | maps | data | χ² together | χ² apart | ln likelihood together over apart |")
    print("|---|---|---|---|---|---|")
    for name, truth in sorted(json.loads((given.folder / "truth.json").read_text()).items()):
        hidden = read_hidden(truth)
        if hidden is None or not (given.folder / name).is_dir():
            continue
        bench, nominal = prepare(read_campaign(given.folder / name), RunStore(given.store), workers=1)
        if len(bench.scans) < 2:
            continue
        values = {
            effect: value - bench.effects[effect].amplitudes[0].null for effect, value in hidden.items()
        }
        start = (math.log(truth["pm"]), values)
        fit = fit_hypothesis(bench, tuple(hidden), start, iterations=0, nuisances=nominal)
        maps = fit.blocks[1]
        each = [Block(maps.residual[s], maps.covariance[s, s], {}) for s in maps.sections.values()]
        print(
            f"| {name} | {len(each)} | {maps.residual.size} | {maps.chi_square:.0f} | "
            f"{sum(block.chi_square for block in each):.0f} | {rate(maps) - sum(map(rate, each)):+.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
