"""Hide causes in campaigns of the Lagrangian mesh, as the day's date draws them, and require that the diagnosis finds them.

    OMP_NUM_THREADS=1 python -m benchmarks.accuracy.hide_and_find [--seed 20261130] [--workers 2] [--store FOLDER]

Six campaigns (fresh.py, without scans where none is needed): one hides nothing, four a listed cause, one a cause that nobody
listed. Right is what blind.py's ``judge_rows`` says, wrong another cause with more than 0.5. The exit status is 1 where fewer
than LEAST_RIGHT are right or more than MOST_WRONG are wrong: at the rates that docs/drawn-campaigns.md counts this is less than
one day in a hundred, so it means that something broke. DAILY keeps a line a campaign, those of one seed in place of older ones:
the days' lines together say more than a day does.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from datetime import UTC, datetime
from multiprocessing import get_context
from pathlib import Path

import pandas as pd

from benchmarks.accuracy.blind import judge_labelled, read_rows, score
from benchmarks.accuracy.fresh import NEED_SCANS, draw_plan
from benchmarks.lagrangian_mesh.film_campaigns import make_campaign
from labsim.runs.store import RunStore

DAILY = Path(__file__).parent / "rows" / "daily.jsonl"
NULLS, LISTED, UNLISTED = 1, 4, 1
LEAST_RIGHT, MOST_WRONG = 3, 2


def hide_and_judge(job: tuple[dict, Path, Path | None]) -> dict:
    """Film one campaign and judge it."""
    hidden, folder, store = job
    began = time.process_time()
    name, truth = make_campaign((hidden, folder))
    filmed = time.process_time()
    row = judge_labelled(folder / name, truth, RunStore(store), workers=1)
    return row | {"filming": filmed - began, "judging": time.process_time() - filmed}


def keep(rows: list[dict], table: pd.DataFrame, seed: int) -> list[dict]:
    """Lines of DAILY."""
    return [
        {
            "seed": seed,
            "date": row["date"],
            "commit": row["commit"],
            "hidden": each["hidden"],
            "note": row["truth"]["note"],
            "sigmas": None if math.isnan(each["sigmas"]) else each["sigmas"],
            "ranked": [[name, round(p, 3)] for name, p in row["ranked"][:3]],
            "right": bool(each["right"]),
            "wrong": bool(each["wrong>0.5"]),
            "p_m": [each["p_m true"], each["p_m"], *(round(p) for p in row["p_m_90"])],
        }
        for row, each in zip(rows, table.to_dict("records"), strict=True)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=int(f"{datetime.now(UTC):%Y%m%d}"))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--store", type=Path, default=None)
    options = parser.parse_args()
    began = time.perf_counter()
    print(f"seed {options.seed} (--seed {options.seed} repeats this)", flush=True)
    plan = draw_plan(options.seed, nulls=NULLS, listed=LISTED, pairs=0, unlisted=UNLISTED, letter="d")
    for hidden in plan:  # a scan costs as much as all films
        hidden["scans"] &= any(name in hidden["cause"] for name in NEED_SCANS)
    plan.sort(key=lambda hidden: hidden["cause"] != "unknown")  # that takes longest
    rows: list[dict] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool,
    ):
        jobs = [pool.submit(hide_and_judge, (hidden, Path(folder), options.store)) for hidden in plan]
        for future in as_completed(jobs):
            row = future.result()
            rows.append(row)
            hidden, ranked = row["truth"], ", ".join(f"{name} {p:.2f}" for name, p in row["ranked"][:3])
            print(
                f"{hidden['cause']} ({hidden['note'] or 'as it is'}), p_m {hidden['pm']:.0f} Pa: {ranked}; p_m "
                f"{row['p_m']:.0f} Pa; CPU {row['filming']:.0f} s to hide, {row['judging']:.0f} s to find",
                flush=True,
            )
    table = score(rows)
    print(table[["hidden", "sigmas", "first", "P", "right", "wrong>0.5"]].to_string(index=False))
    others = [line for line in read_rows(DAILY) if line["seed"] != options.seed] if DAILY.exists() else []
    lines = sorted(
        [*others, *keep(rows, table, options.seed)], key=lambda line: (line["seed"], line["hidden"])
    )
    DAILY.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    right, wrong = int(table.right.sum()), int(table["wrong>0.5"].sum())
    failed = right < LEAST_RIGHT or wrong > MOST_WRONG
    print(
        f"seed {options.seed}: {'FAILED' if failed else 'passed'}; right {right} of {len(rows)} (at least {LEAST_RIGHT}); "
        f"wrong above 0.5: {wrong} (at most {MOST_WRONG}); all days: right {sum(line['right'] for line in lines)} of "
        f"{len(lines)}; {time.perf_counter() - began:.0f} s"
    )
    sys.exit(failed)


if __name__ == "__main__":
    main()
