"""One process a worker of this machine, each with a pipe of its own.

``concurrent.futures`` has one pipe for the results of all workers and holds its writing end itself: where a worker dies within
a result that is longer than the pipe's buffer, the reader waits for the rest for ever. Here a worker alone holds the other end
of its pipe, so that its death ends the reading; and nothing that waits keeps this process from ending.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import queue
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any

JOIN = 5.0  # s that a worker which was killed is waited for; it only guards against a process that no signal reaches
OF_THE_PARENT = (
    signal.SIGINT,
    signal.SIGTERM,
)  # a terminal or a batch system sends them to all processes at once
Call = tuple[
    Future, Callable[..., Any], tuple, dict, str
]  # the last is the folder that relative paths are of


class ProcessWorkers(Executor):
    """Calls are taken in their order by ``count`` processes, each started when there is work for it.

    A call whose worker died ends with BrokenExecutor, and so does every call after ``end``.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._calls: queue.SimpleQueue[Call | None] = queue.SimpleQueue()
        self._lock = threading.Lock()  # of the three below
        self._processes: list[SpawnProcess] = []
        self._threads = 0
        self._ended = False
        self._unfinished = 0  # calls, only a hint for how many workers to start
        atexit.register(self.end)

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        with self._lock:
            if self._ended:
                raise BrokenExecutor("the workers were ended")
            self._unfinished += 1
            begins = self._threads < min(self._count, self._unfinished)
            self._threads += begins
        self._calls.put((future, fn, args, kwargs, os.getcwd()))
        if begins:  # a daemon: the interpreter ends without waiting for it
            threading.Thread(target=self._serve, name="labsim-worker", daemon=True).start()
        return future

    def end(self) -> None:
        """Kill the workers, whatever they are at: a run of minutes is not waited for when somebody wants to stop."""
        with self._lock:
            self._ended = True
            processes = list(self._processes)
        for process in processes:
            process.kill()
        while True:  # what was not begun; what was ends by itself, its pipe is broken
            try:
                call = self._calls.get_nowait()
            except queue.Empty:
                break
            if call is not None and call[0].cancel():
                call[0].set_running_or_notify_cancel()  # those that wait for it are told
        for _ in range(self._count):
            self._calls.put(None)
        for process in processes:
            process.join(JOIN)
        atexit.unregister(self.end)  # last: an interrupt in the middle of it leaves it to the exit

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self.end()

    def _serve(self) -> None:
        """The thread of one worker: hands it the calls and takes its results, one at a time."""
        if hasattr(
            signal, "pthread_sigmask"
        ):  # a worker inherits it, and is deaf from its first instruction on
            resource_tracker.ensure_running()  # which leaves the mask as it likes it, where it has to be started
            signal.pthread_sigmask(signal.SIG_BLOCK, OF_THE_PARENT)
        worker: tuple[SpawnProcess, Connection] | None = None
        while (call := self._calls.get()) is not None:
            future, *asked = call
            if future.set_running_or_notify_cancel():
                try:
                    worker = worker or self._start()
                    future.set_result(_ask(*worker, asked))
                except BaseException as trouble:
                    future.set_exception(trouble)
            with self._lock:
                self._unfinished -= 1

    def _start(self) -> tuple[SpawnProcess, Connection]:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_work, args=(theirs,), name="labsim-worker")
        with self._lock:
            if self._ended:
                raise BrokenExecutor("the workers were ended")
            process.start()
            self._processes.append(process)
        theirs.close()  # only the worker holds it now: its death is the end of what is read from ours
        return process, ours


def _ask(process: SpawnProcess, pipe: Connection, call: list) -> Any:
    """What a call returns, or raise what it raised. Raises BrokenExecutor where the worker is gone."""
    try:
        pipe.send(call)
        result, trouble = pipe.recv()
    except (EOFError, OSError):
        process.join(JOIN)
        raise BrokenExecutor(_say_end(process.exitcode)) from None
    if trouble is not None:
        raise trouble
    return result


def _say_end(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"killed by {signal.Signals(-exitcode).name}; out of memory?"
    # a worker starts by importing the script that asked for it
    return f'exit status {exitcode}; does the script that calls labsim do so under if __name__ == "__main__"?'


@contextmanager
def silence_numerics() -> Iterator[None]:
    """Without numpy's RuntimeWarning of an empty mean or a division by nought, whose lines of source say nothing to who
    runs a command: what comes of them is not finite, and is checked where it matters. ``python -W`` has the last word."""
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore", RuntimeWarning)
        yield


def _work(pipe: Connection) -> None:
    """What a worker does until its parent is gone."""
    _begin()
    with silence_numerics():
        _answer(pipe)


def _answer(pipe: Connection) -> None:
    while True:
        try:
            fn, args, kwargs, folder = pipe.recv()
        except EOFError:
            return
        result, trouble = None, None
        try:
            os.chdir(folder)  # a worker may be older than the caller's last change of it
            result = fn(*args, **kwargs)
        except Exception as found:
            trouble = found
        try:
            pipe.send((result, trouble))
        except OSError:  # the parent is gone
            return
        except Exception as found:  # neither result nor error that can be sent
            pipe.send((None, RuntimeError(f"{type(found).__name__}: {found}")))


def _begin() -> None:
    """One thread a run; leave when the parent is gone, even when it was killed without a word; signals are the parent's."""
    for number in OF_THE_PARENT:
        signal.signal(number, signal.SIG_IGN)
    # none of Numba's: where one changes, it forgets where compiled code is kept
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            wait([parent.sentinel])
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()
