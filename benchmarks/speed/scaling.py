"""A calibration's sweep on one worker, on two, and on a local Dask cluster of two: python -m benchmarks.speed.scaling [--runs 40]

Each arrangement does the same axisymmetric drops, at the spacing of a fit, into an empty store. ``ratio`` is wall time
against one worker; on a machine that others use too it says little, so ``busy`` stands beside it: the share of the workers'
time that was spent within runs. Two workers that are busy 0.95 of the time are worth 1.9 where two cores are free. ``CPU``
is the time of all processes of an arrangement, the scheduler's included. Dask's statistical profiler is off, as docs/cluster.md
says (``--dask-profiler`` leaves it on).
``--coarse`` takes runs of some 30 ms instead (a/dx = 4, grains ten times softer), which show what comes with every run.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

from labsim.records import Material, Projectile
from labsim.runs.store import RunStore
from labsim.runs.workers import warm_up
from labsim.sph import DropSetting


def make_sweep(count: int, coarse: bool, cells: int = 5) -> list[DropSetting]:
    """Drops of a rod at one speed, p_m from 1 to 4 kPa, a/dx = cells, or a/dx = 4 and soft grains."""
    rod = Projectile("hemisphere", 5e-4, 1.33e-6)
    dust = Material(bulk_modulus=4500.0 if coarse else 45000.0)
    spacing = 5e-4 / (4 if coarse else cells)
    return [
        DropSetting(rod, 0.3, dust.replace(p_m=1000.0 * 4.0 ** (k / max(count - 1, 1))), spacing=spacing)
        for k in range(count)
    ]


def measure(
    settings: list[DropSetting], folder: Path, workers: int, scheduler: str | None
) -> tuple[float, float, float]:
    """Wall time of the sweep, the share of its workers' time that was spent within runs, and CPU time."""
    store = RunStore(folder)
    began, used = time.perf_counter(), count_cpu()
    store.get_many(settings, workers=workers, scheduler=scheduler)
    wall, used = time.perf_counter() - began, count_cpu() - used
    return wall, sum(entry.wall for entry in store.index()) / (workers * wall), used


def count_cpu() -> float:
    """CPU-seconds of this process and of all below it so far."""
    found, ticks = [os.getpid()], 0
    for pid in found:
        try:
            ticks += sum(map(int, Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]))
            for thread in Path(f"/proc/{pid}/task").iterdir():
                found += map(int, (thread / "children").read_text().split())
        except OSError:
            continue
    return ticks / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--cells", type=int, default=5, help="a/dx of the runs")
    parser.add_argument("--coarse", action="store_true")
    parser.add_argument("--dask-profiler", action="store_true")
    given = parser.parse_args()
    os.environ["DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED"] = str(given.dask_profiler)
    settings = make_sweep(given.runs, given.coarse, given.cells)
    warm_up()
    load = os.getloadavg()[0]
    rows: list[tuple[str, float, float, float]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows.append(("one worker", *measure(settings, folder / "one", 1, None)))
        measure(
            make_sweep(2, True), folder / "warm", 2, None
        )  # the processes start and load the compiled solver
        rows.append(("two processes", *measure(settings, folder / "two", 2, None)))
        try:
            from distributed import LocalCluster
        except ImportError:
            print("no distributed here: pip install labsim[cluster]")
        else:
            with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
                address = cluster.scheduler_address
                measure(make_sweep(8, True), folder / "warm dask", 2, address)
                rows.append(("two Dask workers", *measure(settings, folder / "dask", 2, address)))
    print(f"{given.runs} runs, {os.cpu_count()} cores, load {load:.1f} of others before")
    print("| workers | wall | ratio | busy | CPU |\n| --- | --- | --- | --- | --- |")
    for label, wall, busy, used in rows:
        print(f"| {label} | {wall:.1f} s | {rows[0][1] / wall:.2f} | {busy:.2f} | {used:.1f} s |")


if __name__ == "__main__":
    main()
