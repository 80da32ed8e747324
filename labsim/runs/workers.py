"""Where runs are run: in this process, in one process a core, or on the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from functools import cache
from typing import Any

from ..errors import InferenceError, LabsimError
from ..records import Material, Projectile
from ..sph import DropSetting, simulate, solver_hash
from .processes import ProcessWorkers

log = logging.getLogger(__name__)

# s. Workers of a batch system come and go within seconds: a minute without any is worth a line. Ten minutes are longer than a
# node needs to come back, and short against the hours that a command which waits for nothing would hold its place in a queue.
LOOK_EVERY, SAID_AFTER, GIVEN_UP_AFTER = 5.0, 60.0, 600.0


class InProcess(Executor):
    """Runs at once, here: one worker gives the same numbers as many."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as trouble:
            future.set_exception(trouble)
        return future


class OnDask(Executor):
    """Work for the workers of a Dask client; what they return comes back here, they need no disk in common."""

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._solver = solver_hash()
        self.address = address

    def submit(self, fn, /, *args, **kwargs):
        return self._executor.submit(run_with_solver, self._solver, fn, *args, **kwargs)

    def count_workers(self) -> int:
        """How many are there now. Raises InferenceError where the scheduler does not answer."""
        try:
            return len(self._client.nthreads())
        except (OSError, ValueError, RuntimeError):  # distributed.CommClosedError is an OSError
            raise self.lost() from None

    def is_lost(self, trouble: BaseException) -> bool:
        """Whether a future failed because the scheduler is gone: then its client cancels all of them."""
        closed = isinstance(trouble, OSError) and type(trouble).__module__.startswith("distributed.")
        return closed or isinstance(trouble, CancelledError) or self._client.status != "running"

    def lost(self) -> InferenceError:
        return InferenceError(
            "",
            "--scheduler",
            f"{self.address} does not answer any more; start it again, and then the same command: what is finished is kept",
        )


def run_with_solver(solver: str, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """``fn(...)`` on a worker; refused where another labsim is installed there, for its numbers would be others."""
    if solver_hash() != solver:
        raise InferenceError(
            platform.node(),
            "labsim",
            "another version is installed on this worker; install the one you start from",
        )
    return fn(*args, **kwargs)


def wait_for_any(executor: Executor, running: Iterable[Future]) -> set[Future]:
    """Those of the futures that are done, once one is.

    Raises InferenceError where a scheduler had no worker for GIVEN_UP_AFTER, or is gone itself.
    """
    if not isinstance(executor, OnDask):
        return wait(running, return_when=FIRST_COMPLETED).done
    alone_since, said = None, False
    while not (done := wait(running, timeout=LOOK_EVERY, return_when=FIRST_COMPLETED).done):
        now = time.monotonic()
        if executor.count_workers() > 0:
            alone_since, said = None, False
            continue
        alone_since = alone_since or now
        if now - alone_since >= GIVEN_UP_AFTER:
            raise InferenceError(
                "",
                "--scheduler",
                f"{executor.address} has had no workers for {now - alone_since:.0f} s; start dask worker "
                f"{executor.address} and the same command again, what is finished is kept",
            )
        if now - alone_since >= SAID_AFTER and not said:
            said = True
            log.warning(
                "all workers of %s are gone for %.0f s; waiting %.0f s more for others (dask worker %s)",
                executor.address,
                now - alone_since,
                GIVEN_UP_AFTER - (now - alone_since),
                executor.address,
            )
    return done


def explain_loss(executor: Executor, trouble: BaseException, where: object) -> InferenceError | None:
    """The error to raise where a future failed because its worker or the scheduler went away; None where it did not."""
    if isinstance(trouble, LabsimError):
        return None
    if isinstance(executor, OnDask):
        if executor.is_lost(trouble):
            return executor.lost()
        if not type(trouble).__module__.startswith("distributed."):
            return None
    elif not isinstance(trouble, BrokenExecutor):
        return None
    said = str(trouble) if isinstance(trouble, BrokenExecutor) else type(trouble).__name__
    return InferenceError(
        where,
        "--workers",
        f"a worker died ({said}); start again, with fewer workers if it is memory: what is finished is kept",
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
    if compile_first:
        warm_up()  # once here, or every worker would
    pool = _pools.get(count)
    if pool is None:
        pool = _pools[count] = ProcessWorkers(count)
    try:
        yield pool, count + 1
    except BaseException:
        _pools.pop(count, None)
        pool.end()
        raise


_pools: dict[int, ProcessWorkers] = {}  # kept from sweep to sweep: a fit asks for many small ones


@cache
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
        yield OnDask(client, address), slots + max(2, slots // 4)
