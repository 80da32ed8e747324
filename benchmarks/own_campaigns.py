"""Hide effects in campaigns of labsim's own solver at another spacing, and count what the diagnosis finds.

    python benchmarks/own_campaigns.py OUT [--nulls 100] [--each 3] [--sigma 8,16] [--workers 2] [--drops D01,D02]
                                           [--effects a,b] [--maps]

Writes OUT/rows.jsonl, one line a campaign; a second call goes on where the first stopped. Prints false alarms and coverage on
the nulls, exact and class hit rates per strength, p_m coverage with the extension, a reliability table of the probabilities.
The strength of an effect is its amplitude times the length of its fingerprint in the nominal campaign, in standard
deviations. OMP_NUM_THREADS=1 keeps the workers out of each other's way.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from blind import name_hypothesis
from scipy.stats import beta

from labsim.campaign import read_campaign, read_scan
from labsim.ct.reduce import ReducedScan, reduce_scan
from labsim.diagnosis.campaign import CONFUSABLE, judge_campaign
from labsim.effects import Effect
from labsim.inference.calibrate import prepare
from labsim.inference.fitting import goodness_of_fit
from labsim.inference.runs import RunStore
from labsim.inference.synthetic import Hidden, TruthTable, measure_hidden
from labsim.records import Campaign, GreyCalibration, Measured, Projectile, Scan

CAMPAIGN = Path(__file__).parent.parent / "data" / "campaigns" / "p01"
LABELLED_SCANS = CAMPAIGN.parents[1] / "ct" / "labelled_scans"
SCANS = [LABELLED_SCANS / name for name in ("p01-C01", "p05-C02")]  # frames, masks and errors of maps
# no truth of their own here; a floor has no tangent that a strength could be counted in
NOT_HIDDEN = ("resolution", "planar_geometry", "gravity", "hard_floor")
VOXEL = 40e-6  # m
OFF_DEFAULT = 0.8  # hidden shapes are this share of the stated one


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


def judge_hidden(
    job: tuple[Campaign, list[ReducedScan], Path | None, TruthTable, Hidden, int, float],
) -> dict:
    """Film one truth and judge it."""
    campaign, templates, store_at, truth, hidden, seed, strength = job
    began = time.perf_counter()
    measurements = measure_hidden(truth, hidden, np.random.default_rng(seed), templates=templates)
    found = judge_campaign(*prepare(campaign, RunStore(store_at), workers=1, measurements=measurements))
    names = found.screening.names
    alike = {
        name: {
            other: round(float(found.screening.cosines[names.index(name), j]), 3)
            for j, other in enumerate(names)
            if other != name
        }
        for name in hidden.effects
        if name in names
    }
    sigma = math.sqrt(found.best.covariance[0, 0])
    value = next((value for values in hidden.effects.values() for value in values.values()), math.nan)
    first = found.verdict.probabilities[0]
    return {
        "cause": hidden.cause,
        "values": {name: dict(values) for name, values in hidden.effects.items()},
        "strength": strength,
        "seed": seed,
        "p_m": hidden.p_m,
        "log_p_m": found.best.log_p_m,
        "log_p_m_sigma": sigma,
        "value": value,
        "found": {
            name: found.bench.effects[name].amplitudes[0].null + amplitude
            for name, amplitude in found.best.values.items()
        },
        "first": name_hypothesis(first[0]),
        "probability": first[1],
        "ranked": [(name_hypothesis(h), p) for h, p in found.verdict.probabilities],
        "alike": alike,
        "goodness": goodness_of_fit(found.nominal),
        "p_value": found.p_value,
        "wall": time.perf_counter() - began,
    }


def set_strength(effect: Effect, signal: float, sigma: float, sign: int) -> dict[str, float] | None:
    """Values of an effect that is this many standard deviations of its fingerprint; None beyond its limits."""
    parameter = effect.amplitudes[0]
    value = parameter.null + sign * sigma / signal
    if not parameter.limits[0] <= value <= parameter.limits[1]:
        return None
    return {parameter.name: value, **{p.name: OFF_DEFAULT * p.null for p in effect.parameters if p.shape}}


def choose_amplitudes(
    campaign: Campaign, store: RunStore, truth: TruthTable, sigmas: list[float], workers: int
) -> list:
    """(hidden, strength) of every effect at every strength that its limits allow, with alternating signs."""
    measurements = measure_hidden(truth, Hidden(), np.random.default_rng(0))
    found = judge_campaign(*prepare(campaign, store, workers=workers, measurements=measurements))
    signal = {score.name: score.signal for score in found.screening.scores}
    chosen = []
    for number, (name, effect) in enumerate(sorted(found.bench.effects.items())):
        if name in NOT_HIDDEN or name not in signal:
            continue
        for k, sigma in enumerate(sigmas):
            for sign in ((-1) ** (number + k), -((-1) ** (number + k))):
                values = set_strength(effect, signal[name], sigma, sign)
                if values is not None:
                    chosen.append((Hidden({name: values}), sigma))
                    break
            else:
                size, unit = sigma / signal[name], effect.amplitudes[0].unit
                print(f"{name}: {sigma:.0f} sigma would be {size:.3g} {unit} from null, outside its limits")
    return chosen


def interval(hits: pd.Series) -> str:
    """Share of True with its Clopper-Pearson interval, 95 %."""
    of, yes = len(hits), int(hits.sum())
    low = beta.ppf(0.025, yes, of - yes + 1) if yes else 0.0
    high = beta.ppf(0.975, yes + 1, of - yes) if yes < of else 1.0
    return f"{yes}/{of} = {yes / max(of, 1):.2f} [{low:.2f}, {high:.2f}]"


def report(rows: list[dict]) -> None:
    table = pd.DataFrame(rows)
    table["inside"] = (table.log_p_m - np.log(table.p_m)).abs() < 1.645 * table.log_p_m_sigma
    table["exact"] = table["first"] == table.cause
    twins = [
        {other for near in alike.values() for other, cosine in near.items() if abs(cosine) > CONFUSABLE}
        for alike in table.alike
    ]
    table["alone"] = [not names for names in twins]
    alike = [name in names for name, names in zip(table["first"], twins, strict=True)]
    table["class"] = table.exact | np.array(alike)
    table["named"] = ~table["first"].isin(["none", "unknown"]) & (table.probability > 0.5)
    nulls = table[table.cause == "none"]
    if len(nulls):
        print(f"nulls: not called none {interval(~nulls.exact)}; a cause above 0.5 {interval(nulls.named)}")
        print(
            f"  goodness of fit below 0.05 {interval(nulls.goodness < 0.05)}; p value below 0.05 {interval(nulls.p_value < 0.05)}"
        )
        print(f"  p_m in its 90 % interval {interval(nulls.inside)}")
    for strength, some in table[table.cause != "none"].groupby("strength"):
        print(f"{strength:.0f} sigma: exact {interval(some.exact)}; class {interval(some['class'])}")
        print(f"  exact where no other is alike {interval(some.exact[some.alone])}")
        print(
            f"  wrong above 0.5 {interval(some.named & ~some['class'])}; p_m in its 90 % interval {interval(some.inside)}"
        )
        for _, row in some[~some.exact].iterrows():
            print(f"    {row.cause} {row.value:.3g}: {[(name, round(p, 3)) for name, p in row.ranked[:3]]}")
    print("reliability: probability of the first against how often it is true")
    for _, some in table.groupby(pd.cut(table.probability, [0.0, 0.5, 0.8, 0.95, 0.99, 1.0])):
        if len(some):
            print(f"  mean {some.probability.mean():.3f}: true {interval(some.exact)}")
    print(f"median wall {table.wall.median():.1f} s")


def read_rows(log: Path) -> list[dict]:
    """What earlier calls have written, one line a campaign."""
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


def append_rows(
    log: Path, judge: Callable[[Any], dict], jobs: Sequence, workers: int, say: Callable[[dict], str]
) -> None:
    """Judge the jobs side by side; every row is written as it comes, so that a second call goes on."""
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool, log.open("a") as file:
        for number, row in enumerate(pool.map(judge, jobs), start=1):
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(f"{number}/{len(jobs)}{say(row)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--nulls", type=int, default=100)
    parser.add_argument("--each", type=int, default=3)
    parser.add_argument("--sigma", default="8,16")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--drops", default="")
    parser.add_argument("--effects", default="")
    parser.add_argument("--store", type=Path, default=None)
    parser.add_argument("--maps", action="store_true", help="maps of the compacted zone too")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "rows.jsonl"
    campaign, templates = open_campaign(options.drops, options.maps)
    store = RunStore(options.store)
    truth = TruthTable(campaign, store, workers=options.workers)
    truth.prepare([])
    chosen = []
    if options.each:
        sigmas = [float(s) for s in options.sigma.split(",")]
        chosen = choose_amplitudes(campaign, store, truth, sigmas, options.workers)
        wanted = {name for name in options.effects.split(",") if name}
        chosen = [(hidden, sigma) for hidden, sigma in chosen if not wanted or hidden.cause in wanted]
        truth.prepare([hidden for hidden, _ in chosen])
    truth.progress = None
    draw = np.random.default_rng(20090101)
    plan = [(Hidden(), 1000 + k, 0.0) for k in range(options.nulls)]
    plan += [(h, 5000 + 100 * n + k, s) for n, (h, s) in enumerate(chosen) for k in range(options.each)]
    done = {(row["cause"], row["seed"]) for row in read_rows(log)}
    jobs = []
    for hidden, seed, sigma in plan:
        hidden = replace(hidden, p_m=float(np.exp(np.log(1300.0) + 0.15 * draw.standard_normal())))
        if (hidden.cause, seed) not in done:
            jobs.append((campaign, templates, options.store, replace(truth, store=None), hidden, seed, sigma))
    append_rows(
        log, judge_hidden, jobs, options.workers,
        lambda row: f" {row['cause']} {row['strength']:.0f}: {row['first']} {row['probability']:.2f}",
    )  # fmt: skip
    report(read_rows(log))


if __name__ == "__main__":
    main()
