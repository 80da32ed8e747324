"""Does the 90 % interval of p_m hold what it says? Campaigns of labsim's own solver at another spacing, calibrated and counted.

    python -m benchmarks.accuracy.interval_coverage OUT [--campaigns 60] [--samples 0.02] [--workers 2]

Every campaign has the drops of data/campaigns/p01 and two maps, with every nuisance that benchmarks.truths.measured knows,
and a p_m of its own. Writes OUT/rows.jsonl, one line a campaign; a second call goes on. Prints coverage and the goodness of fit.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.accuracy.blind import read_rows
from benchmarks.accuracy.count_verdicts import count
from benchmarks.campaigns.scan import VOXEL
from benchmarks.truths.measured import LABORATORY, measure_hidden
from benchmarks.truths.table import Hidden, TruthTable
from labsim.campaign import read_campaign, read_scan
from labsim.ct.reduce import ReducedScan, reduce_scan
from labsim.inference.calibrate import prepare, sample_fit
from labsim.inference.fits.fitting import fit_p_value
from labsim.inference.scatter import allow_scatter
from labsim.records import Campaign, GreyCalibration, Measured, Projectile, Scan
from labsim.runs.store import RunStore

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "p01"
LABELLED_SCANS = CAMPAIGN.parents[1] / "ct" / "labelled_scans"
SCANS = [LABELLED_SCANS / name for name in ("p01-C01", "p05-C02")]  # frames, masks and errors of maps
# rods of 0.5 mm and of 1.5 mm radius, slow to fast
STANDARD = "D01,D02,D03,D05,D06,D07,D11,D13,D14"
SPREAD = 0.15  # of ln p_m about 1300 Pa, inside the truth's own nodes


def open_campaign(drops: str, maps: bool) -> tuple[Campaign, list[ReducedScan]]:
    """The campaign whose drops are filmed again, and the reduced scans whose frames its maps take."""
    campaign = read_campaign(CAMPAIGN)
    chosen = [drop for drop in campaign.drops if not drops or drop.name in drops.split(",")]
    if maps:
        scans = [replace(read_scan(path), name=f"C{k:02d}") for k, path in enumerate(SCANS, start=1)]
        reduced = [reduce_scan(scan, sample_filling_factor=campaign.sample.filling_factor) for scan in scans]
        return replace(campaign, drops=tuple(chosen), scans=tuple(scans)), reduced
    projectile = chosen[0].projectile
    bead = Projectile("sphere", projectile.tip_radius, projectile.mass)
    grey = GreyCalibration(12.0, 0.16, campaign.sample.monomer_density)
    scan = Scan(
        "C01", bead, Measured(0.8, 0.04), Path(), VOXEL, "top", 8, grey
    )  # only its undisturbed dust is made
    return replace(campaign, drops=tuple(chosen), scans=(scan, replace(scan, name="C02"))), []


def append_rows(
    log: Path, judge: Callable[[Any], dict], jobs: Sequence, workers: int, say: Callable[[dict], str]
) -> None:
    """Judge the jobs side by side; every row is written as it comes, so that a second call goes on."""
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool, log.open("a") as file:
        for number, row in enumerate(pool.map(judge, jobs), start=1):
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(f"{number}/{len(jobs)}{say(row)}", flush=True)


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
    done = {row["seed"] for row in (read_rows(log) if log.exists() else [])}
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
    count("p_m in its 90 % interval", (table.low < table.p_m) & (table.p_m < table.high))
    count("goodness of fit below 0.05", table.goodness < 0.05)
    print(
        f"scatter allowed: {table.scatter.min():.3f} to {table.scatter.max():.3f}, median {table.scatter.median():.3f}"
    )
    print(f"ranks of the truth in tenths {np.histogram(table['rank'], np.linspace(0, 1, 11))[0].tolist()}")
    print(f"half width of the interval {((table.high - table.low) / 2 / table.middle).median():.1%} (median)")
    print(f"median wall {table.wall.median():.1f} s")


if __name__ == "__main__":
    main()
