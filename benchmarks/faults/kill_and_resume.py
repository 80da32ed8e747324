"""Kill a command with SIGKILL at random instants, start it again, and compare with one that nobody disturbed.

    python -m benchmarks.faults.kill_and_resume calibrate [--kills 10] [--seed 1] [--workers 2] [--folder EMPTY]

Commands: simulate (three spacings), calibrate, diagnose, track and ct (of a whole campaign). Every other kill takes a
worker process instead of the main one. A life ends when the command comes through; where kills are left then, the next
life begins with an empty store. Prints each kill with what was stored, and at the end whether every life gave the same
numbers, bit for bit, and how many runs were made twice. Exit status 1 where it did not.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from labsim.cli._compare import compare_folders

ROOT = Path(__file__).parents[2]
SUMMARY = {
    "simulate": "run.json",
    "calibrate": "calibration.json",
    "diagnose": "diagnosis.json",
    "track": "tracks.json",
    "ct": "scans.json",
}
NEW = {"track": "measured_new", "ct": "measured_new"}
REUSED = {"track": "reused", "ct": "reused"}


def make_campaign(folder: Path, command: str) -> Path:
    """Two drops; for track and ct with two videos and two scans, which calibrate would simulate for minutes."""
    sys.path.insert(0, str(ROOT / "tests" / "shared"))
    from small_campaign import add_videos_and_scans, copy_campaign

    made = copy_campaign(folder)
    text = (made / "campaign.toml").read_text()  # ten times softer grains: a run costs a third
    (made / "campaign.toml").write_text(text.replace("bulk_modulus_Pa = 45000.0", "bulk_modulus_Pa = 4500.0"))
    return add_videos_and_scans(made) if command in NEW else made


def make_arguments(command: str, campaign: Path) -> list[str]:
    if command == "simulate":
        quick = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 110 --speed-m-s 0.3 --spacings 3"
        return ["simulate", *quick.split()]
    return [command, str(campaign)]


class Study:
    """One command with one output folder and one store; ``begin`` starts it (again)."""

    def __init__(self, arguments: list[str], folder: Path, workers: int) -> None:
        self.out, self.store = folder / "out", folder / "store"
        self.command = [*arguments, "-o", str(self.out), "--workers", str(workers), "--quiet"]
        self.environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "LABSIM_STORE": str(self.store),
            "OMP_NUM_THREADS": "1",
        }

    def begin(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "labsim", *self.command],
            env=self.environment,
            stderr=subprocess.PIPE,
            text=True,
        )

    def count(self, command: str) -> int:
        """What is stored: runs, or measured drops and scans."""
        if command in NEW:
            return len(list(self.out.glob("*/drop.json" if command == "track" else "*/scan.json")))
        return len(list(self.store.glob("??/*.h5")))


def list_workers(pid: int) -> list[int]:
    """Worker processes of a running command."""
    threads = Path(f"/proc/{pid}/task").glob("*/children")  # each worker is started by a thread of its own
    children = [child for thread in threads for child in thread.read_text().split()]
    return [int(c) for c in children if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def strike(process: subprocess.Popen[str], worker: bool, chance: random.Random) -> str:
    """Kill the main process, or one of its workers; what was killed."""
    try:
        targets = list_workers(process.pid) if worker else []
    except OSError:
        targets = []
    if targets:
        os.kill(chance.choice(targets), signal.SIGKILL)
        _, said = process.communicate(timeout=120)
        return f"worker; status {process.returncode}, {said.strip()[:90]}"
    process.kill()
    process.communicate()
    return "main process"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=sorted(SUMMARY))
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="labsim-kills-"))
    campaign = folder / "campaign"
    if not campaign.is_dir():
        make_campaign(campaign, given.command)
    arguments = make_arguments(given.command, campaign)
    chance = random.Random(given.seed)

    reference = Study(arguments, folder / "undisturbed", given.workers)
    began = time.monotonic()
    process = reference.begin()
    _, said = process.communicate()
    if process.returncode:
        sys.exit(f"the undisturbed {given.command} failed: {said}")
    whole = time.monotonic() - began
    total = reference.count(given.command)
    print(f"{given.command}: undisturbed {whole:.0f} s, {total} stored, {given.workers} workers", flush=True)

    kills, life, good = 0, 0, True
    while kills < given.kills:
        life += 1
        study = Study(arguments, folder / f"life{life}", given.workers)
        kept = 0
        while True:
            started = time.monotonic()
            process = study.begin()
            wait = chance.uniform(1.0, max(0.7 * whole, 4.0)) if kills < given.kills else None
            try:
                _, said = process.communicate(timeout=wait)
            except subprocess.TimeoutExpired:
                what = strike(process, worker=kills % 2 == 1, chance=chance)
                kills += 1
                stored = study.count(given.command)
                good &= stored >= kept
                print(
                    f"  life {life}, kill {kills:2d} after {wait:5.1f} s: {stored:3d} of {total} stored; {what}",
                    flush=True,
                )
                kept = stored
                continue
            break
        if kept == 0:  # nothing disturbed it: the machine may be freer than it was
            whole = time.monotonic() - started
        if process.returncode:
            print(f"  life {life} ended with status {process.returncode}: {said.strip()}")
            sys.exit(1)
        summary = json.loads((study.out / SUMMARY[given.command]).read_text())
        new = summary.get(NEW.get(given.command, "runs_new"))
        reused = summary.get(REUSED.get(given.command, "runs_reused"))
        found = compare_folders(reference.out, study.out)
        same = [line for line in found.differences if "measured_new" not in line and "reused" not in line]
        good &= not same and (reused is None or reused >= kept) and study.count(given.command) == total
        print(
            f"  life {life} came through: {'the same' if not same else 'DIFFERENT'} ({found.numbers} numbers), "
            f"last start found {kept} stored, reused {reused}, made {new}",
            flush=True,
        )
        for line in same[:10]:
            print("   ", line)
    print(
        "every life gave the same numbers; only what was in flight was made twice" if good else "NOT THE SAME"
    )
    if given.folder is None:
        shutil.rmtree(folder)
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
