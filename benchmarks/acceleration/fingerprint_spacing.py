"""How alike fingerprints of causes are that come from coarser runs, for drops with an accelerometer.

    python -m benchmarks.acceleration.fingerprint_spacing [CAMPAIGN]

A fingerprint is what a cause changes in the data, over their errors, after p_m and all nuisances are taken out. The campaign is
data/campaigns/f161 where none is named. Of every cause with runs: the cosine between its fingerprint from coarser runs and that
from runs as fits have them (8 spacings in a tip radius, the mean of two), and how long it is over that. Last: CPU seconds of the
screening, all of it simulated anew in this one process.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.inference.calibrate import prepare
from labsim.inference.emulation import grid
from labsim.inference.scatter import set_error_budget
from labsim.records import Campaign
from labsim.runs.store import RunStore

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "f161"
# spacings in a tip radius, and of how many runs the mean is taken; the first is that of fits
RUNS = ((8, 2), (8, 1), (6, 2), (6, 1))
USUAL = grid.ProjectileGroup.spacings


def find_fingerprints(campaign: Campaign, spacings: int, count: int) -> tuple[dict[str, np.ndarray], float]:
    """Name of a cause -> its fingerprint per step; and CPU seconds. count : runs of which the mean is taken."""
    # of fingerprints a run of ``spacings``, or two: their spacing is that of fits times a factor
    factors = tuple(
        grid.FELT_CELLS / spacings * each for each in (grid.FELT_SPACINGS if count == 2 else (1.0,))
    )
    grid.ProjectileGroup.spacings = lambda group, sparse, *rest: (  # type: ignore[method-assign]
        factors if sparse else USUAL(group, sparse, *rest)
    )
    with tempfile.TemporaryDirectory() as folder:
        problem, nominal = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
        problem.grid.store = RunStore(Path(folder))
        began = time.process_time()
        found = screen(problem, nominal, np.random.default_rng(1))
        spent = time.process_time() - began
    steps = {name: problem.effects[name].amplitudes[0].step for name in found.names}
    simulated = [
        name
        for name in found.names
        if problem.affects_simulation(name) and problem.effects[name].kind != "numerics"
    ]
    return {name: steps[name] * found.fingerprints[:, found.names.index(name)] for name in simulated}, spent


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("campaign", type=Path, nargs="?", default=CAMPAIGN)
    campaign = read_campaign(parser.parse_args().campaign)
    found = {runs: find_fingerprints(campaign, *runs) for runs in RUNS}
    finest, *coarser = RUNS
    lengths = {name: float(np.linalg.norm(each)) for name, each in found[finest][0].items()}
    words = [f"{count} × {spacings}" for spacings, count in coarser]
    print("| cause | length | " + " | ".join(f"{each}: cosine | length" for each in words) + " |")
    print("|---" * (2 + 2 * len(coarser)) + "|")
    for name in sorted(lengths, key=lambda name: -lengths[name]):
        row = [f"{lengths[name]:.1f}"]
        for runs in coarser:
            there, finer = found[runs][0][name], found[finest][0][name]
            length = float(np.linalg.norm(there))
            row += [f"{there @ finer / (length * lengths[name]):.2f}", f"{length / lengths[name]:.2f}"]
        print(f"| {name} | " + " | ".join(row) + " |")
    spent = ", ".join(
        f"{spent:.0f} with {count} × {spacings}" for (spacings, count), (_, spent) in found.items()
    )
    print(f"CPU seconds: {spent}")


if __name__ == "__main__":
    main()
