"""Cone soundings in clay at nine speeds: is the cause found, in how many halves, and how often where there is none?

    python -m benchmarks.accuracy.soundings CAMPAIGN [--shuffles 200] [--halves 50] [--seed 1] [--store runs]

The whole campaign; its pushes at the most frequent speed alone; the speeds dealt out anew among the pushes, so that none can
matter; halves of the pushes drawn at random. Printed: how often strength_rate stands first, its inclusion probability (alone or
beside another cause), its gain a decade.
Beside it the regression of each push's mean ln net resistance on log10 of the speed, which needs no simulation.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import Judgement, judge_scatters
from labsim.inference.calibrate import prepare
from labsim.inference.measure import Measurements, measure
from labsim.inference.observations.observe_push import ObservedPush
from labsim.records import Campaign, Drop
from labsim.runs.store import RunStore

CAUSE = ("strength_rate",)


def judge_pushes(
    campaign: Campaign, pushes: Sequence[ObservedPush], store: RunStore, workers: int
) -> Judgement:
    """The verdict on some pushes of a campaign."""
    chosen = replace(campaign, drops=tuple(push.drop for push in pushes))
    seen = Measurements(list(pushes))
    return judge_scatters(
        chosen, lambda budget: prepare(chosen, store, budget=budget, workers=workers, measurements=seen)
    )


def at_speed(push: ObservedPush, source: Drop) -> ObservedPush:
    """A push with the stated speed of another."""
    speed = replace(
        push.speeds[0], value=dict(source.motion.values)["speed"], sigma=source.motion.speed_sigma
    )
    return replace(push, drop=replace(push.drop, motion=source.motion), speeds=(speed,))


def regress(pushes: Sequence[ObservedPush]) -> tuple[float, float, float, float]:
    """Slope a decade with its error, rms before and after, of the mean ln net resistance in windows that all pushes have."""
    common = set.intersection(*({int(n) for n in push.windows} for push in pushes))
    mean = np.array(
        [
            np.mean([r for n, r in zip(p.windows, p.resistance, strict=True) if int(n) in common])
            for p in pushes
        ]
    )
    design = np.column_stack([np.ones(len(pushes)), [math.log10(p.impact_speed) for p in pushes]])
    best, *_ = np.linalg.lstsq(design, mean, rcond=None)
    left = mean - design @ best
    variance = left @ left / (len(mean) - 2)
    sigma = math.sqrt(variance * np.linalg.inv(design.T @ design)[1, 1])
    return float(best[1]), sigma, float(mean.std(ddof=1)), math.sqrt(variance)


def say(found: Judgement) -> tuple[float, str]:
    """Inclusion probability of the cause, alone or beside another, and a line."""
    p = found.verdict.inclusion.get(CAUSE[0], 0.0)
    fit = next((fit for fit in found.rivals if fit.hypothesis == CAUSE), None)
    size = ""
    if fit is not None:
        value, sigma = fit.values["strength_rate"], math.sqrt(fit.covariance[1, 1])
        size = f"; gain a decade {value:.3f} ± {sigma:.3f}"
    first = " + ".join(found.verdict.probabilities[0][0])
    return p, f"first {first} {found.verdict.probabilities[0][1]:.3f}, strength_rate {p:.3f}{size}"


def count(hits: int, of: int) -> str:
    low, high = (
        beta.ppf(0.05, hits, of - hits + 1) if hits else 0.0,
        beta.ppf(0.95, hits + 1, of - hits) if hits < of else 1.0,
    )
    return f"{hits} of {of} (90 %: {low:.2f} to {high:.2f})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("campaign", type=Path)
    parser.add_argument("--shuffles", type=int, default=200)
    parser.add_argument("--halves", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--store", type=Path, default=None)
    given = parser.parse_args()
    campaign, store, rng = (
        read_campaign(given.campaign),
        RunStore(given.store),
        np.random.default_rng(given.seed),
    )
    pushes = [push for push in measure(campaign).drops if isinstance(push, ObservedPush)]
    began = time.perf_counter()
    slope, sigma, before, after = regress(pushes)
    print(
        f"regression of ln net resistance: {slope:.3f} ± {sigma:.3f} a decade, rms {before:.3f} before, {after:.3f} after"
    )
    print(f"all {len(pushes)} pushes: {say(judge_pushes(campaign, pushes, store, given.workers))[1]}; "
          f"{store.new} new runs, {time.perf_counter() - began:.0f} s", flush=True)  # fmt: skip
    usual, _ = Counter(push.impact_speed for push in pushes).most_common(1)[0]
    same = [push for push in pushes if push.impact_speed == usual]
    print(
        f"the {len(same)} at {1e3 * usual:g} mm/s: {say(judge_pushes(campaign, same, store, given.workers))[1]}",
        flush=True,
    )
    for name, times, threshold in (("speeds dealt anew", given.shuffles, 0.5), ("halves", given.halves, 0.5)):
        hits, first = 0, 0
        for _ in range(times):
            if name == "halves":
                chosen = [
                    pushes[k] for k in sorted(rng.permutation(len(pushes))[: math.ceil(len(pushes) / 2)])
                ]
            else:
                order = rng.permutation(len(pushes))
                chosen = [at_speed(push, pushes[k].drop) for push, k in zip(pushes, order, strict=True)]
            found = judge_pushes(campaign, chosen, store, given.workers)
            p, _line = say(found)
            hits += p > threshold
            first += found.verdict.probabilities[0][0] == CAUSE
        if times:
            print(f"{name}: strength_rate above {threshold:g} in {count(hits, times)}, first in {count(first, times)}; "
                  f"{time.perf_counter() - began:.0f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
