"""Hide effects in campaigns of labsim's own solver at another spacing, and count what the diagnosis finds.

    python -m benchmarks.accuracy.own_campaigns OUT [--nulls 100] [--each 2] [--sigma 8,16] [--samples 0.02] [--workers 2]
                                           [--drops D01,D02] [--effects a,b] [--maps] [--store FOLDER] [--plan]

Writes OUT/strengths.json, what is hidden, and OUT/rows.jsonl, one line a campaign; a second call goes on where the first
stopped. Prints false alarms and coverage on the nulls, exact and class hit rates per strength, p_m coverage with the extension, a
reliability table of the probabilities. --plan stops after the strengths. The strength of an effect is what the best nominal fit
leaves of it in a campaign without noise (benchmarks.truths.strength), in standard deviations; every draw takes the other
side of null where it has two. OMP_NUM_THREADS=1 keeps the workers out of each other's way.
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
from scipy.stats import beta

from benchmarks.accuracy.blind import name_hypothesis
from benchmarks.truths.measured import LABORATORY, measure_hidden
from benchmarks.truths.strength import Found, Search, StrengthCount
from benchmarks.truths.table import Hidden, TruthTable
from labsim.campaign import read_campaign, read_scan
from labsim.ct.reduce import ReducedScan, reduce_scan
from labsim.diagnosis.average import average_p_m
from labsim.diagnosis.campaign import judge_scatters
from labsim.diagnosis.screen import CONFUSABLE
from labsim.effects import list_effects
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import fit_p_value
from labsim.records import Campaign, GreyCalibration, Measured, Projectile, Scan
from labsim.runs.store import RunStore

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "p01"
LABELLED_SCANS = CAMPAIGN.parents[1] / "ct" / "labelled_scans"
SCANS = [LABELLED_SCANS / name for name in ("p01-C01", "p05-C02")]  # frames, masks and errors of maps
# rods of 0.5 mm and of 1.5 mm radius, slow to fast
STANDARD = "D01,D02,D03,D05,D06,D07,D11,D13,D14"
# no truth of their own here; a floor is felt or not, which leaves nothing to choose a strength by
NOT_HIDDEN = ("resolution", "planar_geometry", "gravity", "hard_floor")
SPREAD = 0.15  # of ln p_m about the middle, inside the truth's own nodes
MIDDLE = 1300.0  # Pa
VOXEL = 40e-6  # m


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
    job: tuple[Campaign, Path | None, TruthTable, Hidden, int, float, float, float],
) -> dict:
    """Film one truth and judge it."""
    campaign, store_at, truth, hidden, seed, strength, counted, samples = job
    began, busy = time.perf_counter(), time.process_time()
    laboratory = replace(LABORATORY, samples=samples)
    measurements = measure_hidden(truth, hidden, np.random.default_rng(seed), laboratory=laboratory)
    store = RunStore(store_at)
    found = judge_scatters(
        campaign, lambda budget: prepare(campaign, store, budget=budget, workers=1, measurements=measurements)
    )
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
    log_p_m, sigma = found.best.log_p_m_over_shapes
    averaged = average_p_m(found.verdict, found.nominal, found.rivals, campaign.p_m_range)
    value = next((value for values in hidden.effects.values() for value in values.values()), math.nan)
    first = found.verdict.probabilities[0]
    return {
        "cause": hidden.cause,
        "values": {name: dict(values) for name, values in hidden.effects.items()},
        "samples": samples,
        "scatter": found.problem.budget.scatter,
        "strength": strength,
        "counted": counted,
        "seed": seed,
        "named": [" + ".join(hypothesis) for hypothesis, _ in found.verdict.named],
        "p_m": hidden.p_m,
        "log_p_m": log_p_m,
        "log_p_m_sigma": sigma,
        "p_m_averaged_90": np.quantile(averaged, [0.05, 0.95]).tolist(),
        "value": value,
        "found": {
            name: found.problem.effects[name].amplitudes[0].null + amplitude
            for name, amplitude in found.best.values.items()
        },
        "first": name_hypothesis(first[0]),
        "probability": first[1],
        "ranked": [(name_hypothesis(h), p) for h, p in found.verdict.probabilities],
        "alike": alike,
        "goodness": fit_p_value(found.nominal),
        "p_value": found.p_value,
        "wall": time.perf_counter() - began,
        "cpu": time.process_time() - busy,
    }


def find_strengths(
    job: tuple[Campaign, Path | None, TruthTable, str, int, list[float]],
) -> tuple[str, int, Search]:
    """Amplitudes of one effect on one side of null."""
    campaign, store_at, truth, name, side, sigmas = job
    store = RunStore(store_at)
    count = StrengthCount(campaign, store, replace(truth, store=store, workers=1))
    return name, side, count.find(count.truth.effect(name), side, sigmas)


def find_all(
    campaign: Campaign,
    store_at: Path | None,
    truth: TruthTable,
    sigmas: list[float],
    wanted: set[str],
    workers: int,
) -> dict[str, dict[int, Search]]:
    """What to hide of every effect that can be at work in the campaign, or of those wanted: by effect, side of null, strength."""
    names = [
        name
        for name, effect in list_effects(campaign.folder).items()
        if name not in NOT_HIDDEN and not effect.applies(campaign) and effect.amplitudes
    ]
    nominal = truth.holding(Hidden())
    jobs = [
        (campaign, store_at, nominal, name, side, sigmas)
        for name in sorted(names)
        if not wanted or name in wanted
        for side in (1, -1)
    ]
    found: dict[str, dict[int, Search]] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for name, side, search in pool.map(find_strengths, jobs):
            unit = truth.effect(name).amplitudes[0].unit
            said = [
                f"{next(iter(each.hidden.effects[name].values())):.4g} {unit} is {each.strength:.1f}"
                for each in search.found.values()
            ]
            if missed := [f"{sigma:.0f}" for sigma in sigmas if sigma not in search.found]:
                said.append(
                    f"{', '.join(missed)} sigma left out: {search.most:.1f} is the most, {search.end}"
                    if search.strengths
                    else "null is its limit"
                )
            print(f"{name} {'+' if side > 0 else '-'}: {', '.join(said)}", flush=True)
            found.setdefault(name, {})[side] = search
    return found


def plan_hidden(
    found: dict[str, dict[int, Search]], sigmas: list[float], each: int
) -> list[tuple[Found, float, int]]:
    """(what is hidden, strength asked for, seed), the sides of null in turn."""
    plan = []
    for name, sides in found.items():
        number = 1000 * sum(ord(letter) * 31**k for k, letter in enumerate(name)) % 10**9
        for turn, sigma in enumerate(sigmas):
            able = [side for side in sides if sigma in sides[side].found]
            for k in range(each if able else 0):
                chosen = sides[able[(len(name) + turn + k) % len(able)]].found[sigma]
                plan.append((chosen, sigma, number + 10 * round(sigma) + k))
    return plan


def interval(hits: pd.Series) -> str:
    """Share of True with its Clopper-Pearson interval, 95 %."""
    of, yes = len(hits), int(hits.sum())
    low = beta.ppf(0.025, yes, of - yes + 1) if yes else 0.0
    high = beta.ppf(0.975, yes + 1, of - yes) if yes < of else 1.0
    return f"{yes}/{of} = {yes / max(of, 1):.2f} [{low:.2f}, {high:.2f}]"


def report(rows: list[dict]) -> None:
    table = pd.DataFrame(rows)
    table["inside"] = (table.log_p_m - np.log(table.p_m)).abs() < 1.645 * table.log_p_m_sigma
    table["averaged"] = [
        low < p_m < high for (low, high), p_m in zip(table.p_m_averaged_90, table.p_m, strict=True)
    ]
    table["exact"] = table["first"] == table.cause
    twins = [
        {other for near in alike.values() for other, cosine in near.items() if abs(cosine) > CONFUSABLE}
        for alike in table.alike
    ]
    table["alone"] = [not names for names in twins]
    alike = [name in names for name, names in zip(table["first"], twins, strict=True)]
    table["class"] = table.exact | np.array(alike)
    table["among"] = [cause in named for cause, named in zip(table.cause, table.named, strict=True)]
    table["sure"] = ~table["first"].isin(["none", "unknown"]) & (table.probability > 0.5)
    nulls = table[table.cause == "none"]
    if len(nulls):
        print(f"nulls: not called none {interval(~nulls.exact)}; a cause above 0.5 {interval(nulls.sure)}")
        print(
            f"  goodness of fit below 0.05 {interval(nulls.goodness < 0.05)}; p value below 0.05 {interval(nulls.p_value < 0.05)}"
        )
        print(f"  p_m in its 90 % interval {interval(nulls.inside)}")
    for strength, some in table[table.cause != "none"].groupby("strength"):
        spread = f"{some.counted.min():.1f} to {some.counted.max():.1f} counted"
        print(
            f"{strength:.0f} sigma ({spread}): exact {interval(some.exact)}; class {interval(some['class'])}"
        )
        print(f"  exact where no other is alike {interval(some.exact[some.alone])}")
        print(f"  among the at most three that the verdict names {interval(some.among)}")
        print(f"  wrong above 0.5 {interval(some.sure & ~some['class'])}")
        print(
            f"  p_m in its 90 % interval {interval(some.inside)}; over all causes {interval(some.averaged)}"
        )
        for _, row in some[~some.exact].iterrows():
            print(f"    {row.cause} {row.value:.3g}: {[(name, round(p, 3)) for name, p in row.ranked[:3]]}")
    print("reliability: probability of the first against how often it is true")
    for _, some in table.groupby(pd.cut(table.probability, [0.0, 0.5, 0.8, 0.95, 0.99, 1.0])):
        if len(some):
            print(f"  mean {some.probability.mean():.3f}: true {interval(some.exact)}")
    for hidden, some in (("nulls", nulls), ("effects", table[table.cause != "none"])):
        if len(some):
            busy = f"CPU {some.cpu.median():.1f} s (median), {some.cpu.mean():.1f} s (mean)"
            print(f"{hidden}: wall {some.wall.median():.1f} s (median), {busy}")


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
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--sigma", default="8,16")
    parser.add_argument("--samples", type=float, default=LABORATORY.samples, help="scatter of ln p_m")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--drops", default=STANDARD, help="names with commas; empty for all of the campaign")
    parser.add_argument("--effects", default="")
    parser.add_argument("--store", type=Path, default=None)
    parser.add_argument("--maps", action="store_true", help="maps of the compacted zone too")
    parser.add_argument("--plan", action="store_true", help="strengths only, no campaign")
    options = parser.parse_args()
    began = time.perf_counter()
    options.out.mkdir(parents=True, exist_ok=True)
    log = options.out / "rows.jsonl"
    campaign, templates = open_campaign(options.drops, options.maps)
    store = RunStore(options.store)
    truth = TruthTable(campaign, store, workers=options.workers, templates=tuple(templates))
    truth.prepare([])
    plan: list[tuple[Found, float, int]] = []
    if options.each:
        sigmas = [float(s) for s in options.sigma.split(",")]
        wanted = {name for name in options.effects.split(",") if name}
        found = find_all(campaign, options.store, truth, sigmas, wanted, options.workers)
        plan = plan_hidden(found, sigmas, options.each)
        said = [(f.hidden.cause, dict(f.hidden.effects), f.strength, sigma, seed) for f, sigma, seed in plan]
        (options.out / "strengths.json").write_text(json.dumps(said, indent=1), encoding="utf-8")
    truth.prepare([each.hidden for each, _, _ in plan])  # at the very amplitudes that are hidden
    print(f"strengths and truths: {time.perf_counter() - began:.0f} s", flush=True)
    if options.plan:
        return
    plan = [(Found(Hidden(), 0.0), 0.0, 1000 + k) for k in range(options.nulls)] + plan
    done = {(row["cause"], row["strength"], row["seed"]) for row in read_rows(log)}
    jobs = []
    for each, sigma, seed in plan:
        p_m = MIDDLE * math.exp(SPREAD * np.random.default_rng([20090101, seed]).standard_normal())
        hidden = replace(each.hidden, p_m=p_m)
        if (hidden.cause, sigma, seed) not in done:
            known = truth.holding(hidden)
            jobs.append((campaign, options.store, known, hidden, seed, sigma, each.strength, options.samples))
    append_rows(
        log, judge_hidden, jobs, options.workers,
        lambda row: f" {row['cause']} {row['strength']:.0f}: {row['first']} {row['probability']:.2f}",
    )  # fmt: skip
    report(read_rows(log))
    print(f"all {time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
