"""Does the 90 % interval of p_m hold what it says? Campaigns of labsim's own solver at another spacing, calibrated and counted.

    python -m benchmarks.accuracy.interval_coverage OUT [--campaigns 60] [--samples 0.02] [--workers 2]

Every campaign has 15 drops of four projectiles and two maps, with every nuisance that benchmarks.truths.measured knows,
and a p_m of its own. Writes OUT/rows.jsonl, one line a campaign; a second call goes on. Prints coverage and the goodness of fit.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.accuracy.own_campaigns import append_rows, interval, open_campaign, read_rows
from benchmarks.truths.measured import LABORATORY, measure_hidden
from benchmarks.truths.table import Hidden, TruthTable
from labsim.inference.calibrate import prepare, sample_fit
from labsim.inference.fits.fitting import fit_p_value
from labsim.inference.scatter import allow_scatter
from labsim.records import Campaign
from labsim.runs.store import RunStore

SPREAD = 0.15  # of ln p_m about 1300 Pa, inside the truth's own nodes


def calibrate_hidden(job: tuple[Campaign, Path | None, TruthTable, int, float]) -> dict:
    """Film one nominal campaign and calibrate it."""
    campaign, store, truth, seed, samples = job
    rng = np.random.default_rng(seed)
    p_m = float(np.exp(np.log(1300.0) + SPREAD * rng.standard_normal()))
    laboratory = replace(LABORATORY, samples=samples)
    measurements = measure_hidden(truth, Hidden(p_m=p_m), rng, laboratory=laboratory)
    began = time.perf_counter()
    problem, fit = prepare(campaign, RunStore(store), workers=1, measurements=measurements)
    problem, fit, _ = allow_scatter(problem, fit)
    chain = sample_fit(problem, fit, seed=seed).samples("p_m_Pa")
    low, middle, high = np.quantile(chain, [0.05, 0.5, 0.95])
    return {
        "seed": seed,
        "p_m": p_m,
        "low": low,
        "middle": middle,
        "high": high,
        "rank": float(np.mean(chain < p_m)),
        "scatter": problem.budget.scatter,
        "goodness": fit_p_value(fit),
        "wall": time.perf_counter() - began,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--campaigns", type=int, default=60)
    parser.add_argument("--samples", type=float, default=LABORATORY.samples, help="scatter of ln p_m")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--store", type=Path, default=None)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "rows.jsonl"
    campaign, templates = open_campaign("", True)
    store = RunStore(options.store)
    truth = TruthTable(campaign, store, workers=options.workers, templates=tuple(templates))
    truth.prepare([])
    done = {row["seed"] for row in read_rows(log)}
    jobs = [
        (campaign, options.store, truth.holding(Hidden()), seed, options.samples)
        for seed in range(70_000, 70_000 + options.campaigns)
        if seed not in done
    ]
    append_rows(
        log, calibrate_hidden, jobs, options.workers,
        lambda row: f": {row['p_m']:.0f} in {row['low']:.0f} to {row['high']:.0f}",
    )  # fmt: skip
    table = pd.DataFrame(read_rows(log))
    print(f"p_m in its 90 % interval {interval((table.low < table.p_m) & (table.p_m < table.high))}")
    print(f"goodness of fit below 0.05 {interval(table.goodness < 0.05)}")
    print(
        f"scatter allowed: {table.scatter.min():.3f} to {table.scatter.max():.3f}, median {table.scatter.median():.3f}"
    )
    print(f"ranks of the truth in tenths {np.histogram(table['rank'], np.linspace(0, 1, 11))[0].tolist()}")
    print(f"half width of the interval {((table.high - table.low) / 2 / table.middle).median():.1%} (median)")
    print(f"median wall {table.wall.median():.1f} s")


if __name__ == "__main__":
    main()
