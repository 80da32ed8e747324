"""Sweeps that something stops: does the process end, how soon, with which words?

    python -m benchmarks.faults.sweeps                    200 tries, some 8 minutes of two cores
    python -m benchmarks.faults.sweeps --tries 36 --kinds raise     results of 100 kB and an error, the smallest case

Kinds: raise and worker-in-result run a sweep of 100 kB results that costs nothing (its status is Python's own, 1); full,
worker, interrupt and term are ``labsim simulate`` with five spacings, with a quota on files, a worker killed, Ctrl-C and
SIGTERM at a random instant. A try fails where it does not end within 10 s, or ends otherwise than with one line and its status.
Each runs in a process group of its own, which is killed after the 10 s.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIMIT = 10.0  # s
SHARES = {"raise": 0.4, "worker-in-result": 0.2, "full": 0.1, "worker": 0.1, "interrupt": 0.1, "term": 0.1}
QUOTA = 300_000  # bytes: the third spacing's file does not fit
COMMAND = (
    "simulate --geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3 --spacings 5 "
    "--time-ms 0.3 --workers 2 --quiet"
).split()
# status 0: the sweep was through before the fault came
EXPECTED = {"full": {2}, "worker": {0, 2}, "interrupt": {0, 130}, "term": {0, 143}}
SMALL = ROOT / "tests/shared/small_sweep.py"


def start(arguments: list[str], **how: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **how,  # type: ignore[call-overload]
    )


def end(process: subprocess.Popen[str]) -> tuple[str, float] | None:
    """What it said and how long it took to end; None where it did not within LIMIT."""
    began = time.monotonic()
    try:
        said = process.communicate(timeout=LIMIT)[1]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return None
    return said, time.monotonic() - began


def list_workers(pid: int) -> list[int]:
    found = []
    try:
        for file in Path(f"/proc/{pid}/task").glob("*/children"):
            for child in file.read_text().split():
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(int(child))
    except OSError:  # it ended while we looked
        pass
    return found


def try_small(kind: str, chance: random.Random, _folder: Path) -> tuple[str, float]:
    stop = chance.randrange(1, 300) if kind == "raise" else 10_000
    deadly = chance.randrange(300) if kind != "raise" else -1
    arguments = (400, 100_000, stop, deadly, chance.uniform(0.0, 2e-3))
    process = start([str(SMALL), *map(str, arguments)])
    assert process.stdout is not None
    process.stdout.readline()
    found = end(process)
    if found is None:
        return "hang", LIMIT
    said, seconds = found
    good = process.returncode == 0 or (process.returncode == 1 and said.count("Traceback") == 1)
    return ("ended" if good else f"status {process.returncode}: {said[-200:]!r}"), seconds


def try_command(kind: str, chance: random.Random, folder: Path) -> tuple[str, float]:
    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # a shell's & would have it ignored
        if kind == "full":
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (QUOTA, QUOTA))

    store = folder / "store"
    arguments = ["-m", "labsim", *COMMAND, "-o", str(folder / "out"), "--store", str(store)]
    process = start(arguments, preexec_fn=prepare)
    first = ""
    if kind == "full":  # the seconds are those from its line to its end
        assert process.stderr is not None
        first = process.stderr.readline()
    else:
        while process.poll() is None and not list_workers(process.pid):
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 3.0))
        if kind == "worker":
            for victim in list_workers(process.pid)[:1]:
                os.kill(victim, signal.SIGKILL)
        elif process.poll() is None:
            os.killpg(process.pid, signal.SIGINT if kind == "interrupt" else signal.SIGTERM)
    found = end(process)
    if found is None:
        return "hang", LIMIT
    said, seconds = first + found[0], found[1]
    lines = [line for line in said.splitlines() if line.strip()]
    good = process.returncode in EXPECTED[kind]
    good &= (not lines) if process.returncode == 0 else len(lines) == 1 and lines[0].startswith("error: ")
    return ("ended" if good else f"status {process.returncode}: {said[-300:]!r}"), seconds


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tries", type=int, default=200)
    parser.add_argument("--kinds", nargs="+", choices=list(SHARES), default=list(SHARES))
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    whole = sum(SHARES[kind] for kind in given.kinds)
    print(f"{'kind':18} {'tries':>5} {'ended':>5} {'hang':>5} {'other':>5}   slowest")
    failed = 0
    for kind in given.kinds:
        number = round(given.tries * SHARES[kind] / whole)
        counts: Counter[str] = Counter()
        slowest, others = 0.0, []
        for _ in range(number):
            with tempfile.TemporaryDirectory(prefix="labsim-sweep-") as folder:
                attempt = try_small if kind in {"raise", "worker-in-result"} else try_command
                outcome, seconds = attempt(kind, chance, Path(folder))
            counts[outcome if outcome in {"ended", "hang"} else "other"] += 1
            if outcome not in {"ended", "hang"}:
                others.append(outcome)
            slowest = max(slowest, seconds)
        failed += number - counts["ended"]
        print(
            f"{kind:18} {number:5} {counts['ended']:5} {counts['hang']:5} {counts['other']:5}   {slowest:.1f} s",
            flush=True,
        )
        for outcome in sorted(set(others)):
            print("    " + outcome)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
