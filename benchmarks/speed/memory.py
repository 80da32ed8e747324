"""Largest memory and CPU time of a command with its workers together.

    python -m benchmarks.speed.memory [--full] [-- labsim arguments]

Proportional set sizes of all its processes, summed ten times a second, so that shared pages count once. Without
arguments the quick commands are measured; ``--full`` adds calibrate and diagnose of two drops.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def measure(arguments: list[str], store: Path) -> tuple[float, float, float, int]:
    """(largest memory in bytes, wall s, CPU s, exit status) of one command."""
    environment = {**os.environ, "LABSIM_STORE": str(store), "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(
        [sys.executable, "-m", "labsim", *arguments], env=environment, stdout=subprocess.DEVNULL
    )
    largest = 0
    while process.poll() is None:
        largest = max(largest, sum(_size(pid) for pid in _family(process.pid)))
        time.sleep(0.1)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return largest, time.perf_counter() - began, used, process.returncode


def _family(pid: int) -> list[int]:
    found = [pid]
    for member in found:
        try:
            for thread in Path(f"/proc/{member}/task").glob("*/children"):
                found += map(int, thread.read_text().split())
        except OSError:
            continue
    return found


def _size(pid: int) -> int:
    try:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 0


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--full", action="store_true")
    parser.add_argument("arguments", nargs="*")
    given = parser.parse_args()
    sys.path.insert(0, str(ROOT / "tests" / "shared"))
    from small_campaign import copy_campaign

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        campaign = str(copy_campaign(folder / "campaign"))
        quick = (
            "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3".split()
        )
        scan = ROOT / "data" / "ct" / "labelled_scans" / "p01-C01"
        video = ROOT / "data" / "video" / "rendered_drops" / "mjpeg_3mm"
        commands = {
            "check, 2 drops": ["check", campaign],
            "simulate, 2000 particles": ["simulate", *quick],
            "simulate, 3 spacings, 2 workers": ["simulate", *quick, "--spacings", "3", "--workers", "2"],
            "track, 384 x 128 px": ["track", str(video)],
            "ct, 1.1 million voxels": ["ct", str(scan)],
        }
        if given.full:
            commands["calibrate, 2 drops, 2 workers"] = ["calibrate", campaign, "--workers", "2"]
            commands["diagnose, 2 drops, 2 workers"] = ["diagnose", campaign, "--workers", "2"]
        if given.arguments:
            commands = {" ".join(given.arguments): given.arguments}
        print("| command | largest memory | wall | CPU |\n| --- | --- | --- | --- |")
        for number, (label, arguments) in enumerate(commands.items()):
            out = [] if arguments[0] == "check" or "-o" in arguments else ["-o", str(folder / f"out{number}")]
            largest, wall, used, status = measure([*arguments, *out, "--quiet"], folder / "store")
            failed = f", status {status}" if status else ""
            print(
                f"| {label} | {largest / 2**20:.0f} MiB | {wall:.0f} s{failed} | {used:.0f} s |", flush=True
            )


if __name__ == "__main__":
    main()
