"""How far drops come back up after their stop, beside the nominal simulation of campaigns that hide nothing.

    OMP_NUM_THREADS=1 python -m benchmarks.accuracy.way_back CAMPAIGN... [--workers 2]

Per drop: the simulated way back (µm, 1.2 to 1.33 stopping times after contact), how much of it the film shows more or less, and
the noise of that. At the end the mean and the scatter of the share from drop to drop, noise taken out, over drops whose noise is
less than a fifth of the way.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import pandas as pd

from labsim.campaign import read_campaign
from labsim.inference.calibrate import prepare
from labsim.inference.observations.drop_model import DropModel
from labsim.runs.store import RunStore

BEFORE, AFTER = (0.85, 1.0), (1.2, 1.33)  # of the stopping time
CLEAR = 0.2


def list_ways(folder: str, workers: int) -> list[dict[str, float | str]]:
    """A row a drop of one campaign."""
    campaign = read_campaign(folder)
    problem, fit = prepare(campaign, RunStore(), workers=workers)
    rows: list[dict[str, float | str]] = []
    for model, instant in zip(problem.tracks.models, problem.tracks.instants(fit.nuisances[0]), strict=True):
        if not isinstance(model, DropModel):
            continue
        name = model.observed.name
        instrument = problem.instruments({})[name]
        features = model.table.features(fit.log_p_m, instant.log_speed, {})
        here = model.predict(features, instrument, instant)
        depth, stop = np.exp(features[:2])
        clock = (model.mean_time(instrument) - instant.contact_time) / stop
        before, after = ((clock > low) & (clock < high) for low, high in (BEFORE, AFTER))
        if not (before.any() and after.any()):
            continue
        way, left = float(depth - here[after].mean()), model.data - here
        noise = model.observed.sigma * math.hypot(before.sum() ** -0.5, after.sum() ** -0.5)
        rows.append(
            {
                "campaign": campaign.name,
                "drop": name,
                "way um": way * 1e6,
                "more": (left[before].mean() - left[after].mean()) / way,
                "noise": noise / way,
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaigns", nargs="+")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    table = pd.DataFrame([row for each in args.campaigns for row in list_ways(each, args.workers)])
    print(table.to_string(index=False, float_format=lambda x: f"{x:.2f}"))
    clear = table[table.noise < CLEAR]
    scatter = math.sqrt(max(float(clear.more.var(ddof=1) - np.mean(clear.noise**2)), 0.0))
    print(f"{len(clear)} drops: {clear.more.mean():+.2f} in the mean, {scatter:.2f} from drop to drop")


if __name__ == "__main__":
    main()
