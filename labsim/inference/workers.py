"""Where runs are run: in this process, in one process a core, or on the workers of a Dask scheduler."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import wait

from ..errors import InferenceError
from ..records import Material, Projectile
from ..sph import DropSetting, simulate


class InProcess(Executor):
    """Runs at once, here: one worker gives the same numbers as many."""

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as trouble:
            future.set_exception(trouble)
        return future


@contextmanager
def open_executor(workers: int | None, scheduler: str | None, wanted: int) -> Iterator[tuple[Executor, int]]:
    """An executor and how many runs it takes at once. Raises InferenceError where a scheduler does not answer."""
    if scheduler is not None:
        with _open_dask(scheduler) as pair:
            yield pair
        return
    count = min(workers or count_cores(), wanted)
    if count <= 1:
        yield InProcess(), 1
        return
    warm_up()  # compile once here, or every worker would
    pool = ProcessPoolExecutor(
        max_workers=count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_worker
    )
    try:
        yield pool, count
    except BaseException:
        workers_now = list((pool._processes or {}).values())  # shutdown forgets them
        pool.shutdown(wait=False, cancel_futures=True)
        for process in workers_now:
            process.terminate()  # a run of minutes is not waited for when the user stops
        raise
    else:
        pool.shutdown()


def warm_up() -> None:
    """Compile the solver into its cache by a drop of a few steps."""
    cylinder = Projectile(tip="cylinder", tip_radius=5.0e-4, mass=2.0e-3)
    simulate(
        DropSetting(
            cylinder,
            0.5,
            Material(),
            geometry="planar",
            spacing=1.25e-4,
            duration=1e-5,
            width=2.5e-3,
            depth=2.5e-3,
        )
    )


def count_cores() -> int:
    """Cores this process may use (a container may have been given fewer than the machine has)."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin_worker() -> None:
    """One thread a run; leave when the parent is gone, even when it was killed without a word; Ctrl-C is the parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            wait([parent.sentinel])
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _open_dask(address: str) -> Iterator[tuple[Executor, int]]:
    try:
        from distributed import Client
    except ImportError:
        raise InferenceError(
            "", "--scheduler", "needs dask.distributed; install it with pip install distributed"
        ) from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as trouble:
        raise InferenceError(
            "",
            "--scheduler",
            f"{address} does not answer ({type(trouble).__name__}); start dask scheduler there",
        ) from None
    with client:
        slots = sum(client.nthreads().values())
        if slots == 0:
            raise InferenceError("", "--scheduler", f"{address} has no workers; start dask worker {address}")
        yield client.get_executor(pure=False), slots
