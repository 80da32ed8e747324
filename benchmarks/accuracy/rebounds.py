"""How far drops come back up after their stop, beside the nominal simulation of campaigns that hide nothing in it.

    OMP_NUM_THREADS=1 python -m benchmarks.accuracy.rebounds CAMPAIGN... [--workers 2]

Per drop: the measured and the simulated way (µm), by what share they differ, and the film's noise as a share. At the end the mean
and the scatter of that share from drop to drop, noise taken out, over drops whose noise is less than a fifth of the way.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import pandas as pd

from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.observations.rebounds import Rebounds
from labsim.runs.store import RunStore

CLEAR = 0.2  # of the way


def list_rebounds(folder: str, workers: int) -> pd.DataFrame:
    """A row a drop of one campaign."""
    problem, fit = prepare(read_campaign(folder), RunStore(), workers=workers)
    found = problem.find(Rebounds)
    if found is None:
        return pd.DataFrame()
    place, rebounds = found
    measured = np.array([each.way for each in rebounds.drops])
    left, noise = fit.blocks[place].residual, np.array([each.sigma for each in rebounds.drops])
    simulated = measured - left
    return pd.DataFrame(
        {
            "campaign": problem.campaign.name,
            "drop": [each.name for each in rebounds.drops],
            "measured": measured * 1e6,
            "simulated": simulated * 1e6,
            "more": left / simulated,
            "noise": noise / simulated,
        }
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaigns", nargs="+")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    table = pd.concat([list_rebounds(each, args.workers) for each in args.campaigns])
    print(table.to_string(index=False, float_format=lambda x: f"{x:.2f}"))
    clear = table[table.noise < CLEAR]
    scatter = math.sqrt(max(float(clear.more.var(ddof=1) - np.mean(clear.noise**2)), 0.0))
    print(f"{len(clear)} drops: {clear.more.mean():+.2f} in the mean, {scatter:.2f} from drop to drop")


if __name__ == "__main__":
    main()
