"""Where runs are run: in this process, in one process a core, or on the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import multiprocessing
import os
import platform
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import Any

from ..errors import InferenceError
from ..records import Material, Projectile
from ..sph import DropSetting, simulate, solver_hash


class InProcess(Executor):
    """Runs at once, here: one worker gives the same numbers as many."""

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as trouble:
            future.set_exception(trouble)
        return future


class OnDask(Executor):
    """Work for the workers of a Dask client; what they return comes back here, they need no disk in common."""

    def __init__(self, client: Any) -> None:
        self._executor = client.get_executor(pure=False)
        self._solver = solver_hash()

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        return self._executor.submit(run_with_solver, self._solver, fn, *args, **kwargs)


def run_with_solver(solver: str, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """``fn(...)`` on a worker; refused where another labsim is installed there, for its numbers would be others."""
    if solver_hash() != solver:
        raise InferenceError(
            platform.node(),
            "labsim",
            "another version is installed on this worker; install the one you start from",
        )
    return fn(*args, **kwargs)


def is_loss(trouble: BaseException) -> bool:
    """Whether a future failed because its workers, or their scheduler, went away."""
    return isinstance(trouble, (BrokenProcessPool, CancelledError)) or type(trouble).__module__.startswith(
        "distributed."
    )


@contextmanager
def open_executor(
    workers: int | None, scheduler: str | None, wanted: int, *, compile_first: bool = True
) -> Iterator[tuple[Executor, int]]:
    """An executor and how many runs it should hold. Raises InferenceError where a scheduler does not answer.

    That is a few more than it works on at once: a worker goes on with the next run while the last one is written here.
    """
    if scheduler is not None:
        with _open_dask(scheduler) as pair:
            yield pair
        return
    count = workers or count_cores()
    if min(count, wanted) <= 1:
        yield InProcess(), 1
        return
    pool = _pools.get(count)
    if pool is None:
        if compile_first:
            warm_up()  # once here, or every worker would
        pool = ProcessPoolExecutor(
            max_workers=count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_worker
        )
        _pools[count] = pool
    try:
        yield pool, count + 1
    except BaseException:
        _pools.pop(count, None)
        workers_now = list((pool._processes or {}).values())  # shutdown forgets them
        pool.shutdown(wait=False, cancel_futures=True)
        for process in workers_now:
            process.terminate()  # a run of minutes is not waited for when the user stops
        raise


_pools: dict[int, ProcessPoolExecutor] = {}  # kept from sweep to sweep: a fit asks for many small ones


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
    for name in (
        "distributed",
        "distributed.client",
        "distributed.core",
        "distributed.comm",
        "tornado.application",
    ):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # labsim says what happened, in one line
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
        yield OnDask(client), slots + max(2, slots // 4)
