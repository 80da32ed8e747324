"""A sweep of long results that costs nothing: small_sweep.py NUMBER BYTES STOP DEADLY DELAY

NUMBER results of BYTES each by two workers; an error after STOP of them; the worker with result DEADLY is killed DELAY seconds
after it began, within that result, say. Run as a script by tests/faults/test_workers.py and benchmarks/faults/sweeps.py.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from concurrent.futures import FIRST_COMPLETED, wait

from labsim.runs.workers import open_executor


def make(size: int, number: int, deadly: int, delay: float) -> bytes:
    if number == deadly:
        threading.Timer(delay, os.kill, (os.getpid(), signal.SIGKILL)).start()
    return bytes(size)


if __name__ == "__main__":
    count, size, stop, deadly = map(int, sys.argv[1:5])
    delay = float(sys.argv[5])
    with open_executor(2, None, count, compile_first=False) as (executor, slots):
        running = {executor.submit(make, size, number, deadly, delay) for number in range(count)}
        print("begun", flush=True)
        seen = 0
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                future.result()
                seen += 1
                if seen == stop:
                    raise OSError(28, "No space left on device")
