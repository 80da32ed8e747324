"""Run the quick benchmarks one after the other and print their tables: python -m benchmarks.speed.all [--only NAME,NAME]

Each is one process with small settings, a few minutes in all on two free cores. The long studies (blind, coverage,
kill_and_resume, the solver beside PySPH) have commands of their own, named in their first lines.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import time

QUICK = {
    "solver": ["--largest", "20000"],
    "tracking": ["--frames", "200"],
    "scans": ["--edges", "56,80"],
    "scaling": ["--runs", "8"],
    "memory": [],
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default=",".join(QUICK))
    given = parser.parse_args()
    print(
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, load {os.getloadavg()[0]:.1f}"
    )
    failed = []
    for name in given.only.split(","):
        if name not in QUICK:
            sys.exit(f"{name} is none of {', '.join(QUICK)}")
        print(f"\n## {name}", flush=True)
        began = time.perf_counter()
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        if subprocess.run(
            [sys.executable, "-m", f"benchmarks.speed.{name}", *QUICK[name]], env=environment, check=False
        ).returncode:
            failed.append(name)
        print(f"({time.perf_counter() - began:.0f} s)", flush=True)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
