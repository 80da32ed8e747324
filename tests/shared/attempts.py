"""One command in a forked process with limits on memory and time, and what it left behind."""

from __future__ import annotations

import hashlib
import os
import resource
import signal
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

MEMORY = (
    2 << 30
)  # bytes of address space: nothing may need more, beside what earlier tests have left in this process
CPU_SECONDS = 60
WALL_SECONDS = 900.0


def _count_mapped() -> int:
    """Bytes of address space of this process."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


AT_START = _count_mapped()


@dataclass(frozen=True)
class Attempt:
    """status : exit status, negative for a signal; said : standard error; strays : files changed outside the output."""

    status: int
    said: str
    printed: str
    strays: tuple[str, ...]
    peak: int  # bytes
    cpu: float  # s

    def complaint(self) -> str:
        """What is wrong with this attempt; empty where it succeeded, or failed as it should."""
        lines = [line for line in self.said.splitlines() if line.strip()]
        if self.status not in (0, 2):
            return f"status {self.status}: {self.said[-1500:]}"
        if "Traceback" in self.said or "Error:" in self.said:
            return f"traceback: {self.said[-1500:]}"
        if self.status == 2 and (len(lines) != 1 or not lines[0].startswith("error: ") or len(lines[0]) < 15):
            return f"not one line: {self.said[-1500:]}"
        if self.status == 0 and lines:
            return f"success, and yet: {self.said[-1500:]}"
        if self.strays:
            return f"touched {self.strays}"
        return ""


def attempt(
    arguments: list[object],
    root: Path,
    out: str = "out",
    *,
    cpu_seconds: int = CPU_SECONDS,
    wall_seconds: float = WALL_SECONDS,
) -> Attempt:
    """``labsim ARGUMENTS`` in ``root``; whatever it writes must lie in ``root/out``."""
    before = _survey(root, out)
    said, printed = root.with_name(root.name + ".err"), root.with_name(root.name + ".out")
    child = os.fork()
    if child == 0:
        status = 70
        try:
            limit = MEMORY + max(0, _count_mapped() - AT_START)
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 5))
            for descriptor, file in ((1, printed), (2, said)):
                opened = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
                os.dup2(opened, descriptor)
            sys.stdout = open(1, "w", closefd=False)
            sys.stderr = open(2, "w", closefd=False)
            os.chdir(root)
            from labsim.cli import main

            main([str(each) for each in arguments])
        except SystemExit as left:
            status = left.code if isinstance(left.code, int) else 0
        except BaseException:
            traceback.print_exc()
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            os._exit(status)
    deadline = time.monotonic() + wall_seconds
    while True:
        done, result, usage = os.wait4(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            _done, result, usage = os.wait4(child, 0)
            break
        time.sleep(0.002)
    text = said.read_text(errors="replace") if said.exists() else ""
    words = printed.read_text(errors="replace") if printed.exists() else ""
    after = _survey(root, out)
    strays = tuple(
        sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    )
    cpu = usage.ru_utime + usage.ru_stime
    return Attempt(os.waitstatus_to_exitcode(result), text, words, strays, usage.ru_maxrss * 1024, cpu)


def _survey(root: Path, out: str) -> dict[str, str]:
    found = {}
    for folder, _names, files in os.walk(root):
        for name in files:
            path = Path(folder, name)
            relative = path.relative_to(root)
            if relative.parts[0] == out:
                continue
            if path.is_symlink():
                found[str(relative)] = os.readlink(path)
            elif path.is_file():
                found[str(relative)] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def list_children(pid: int) -> list[int]:
    """Processes that a process has started, by all its threads: each worker is started by one of its own."""
    threads = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for thread in threads for child in thread.read_text().split()]
