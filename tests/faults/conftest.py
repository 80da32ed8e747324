"""A campaign of two drops, and commands in processes of their own that can be killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from small_campaign import ROOT, copy_campaign

Begin = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return copy_campaign(tmp_path / "campaign")


@pytest.fixture
def begin(tmp_path: Path) -> Begin:
    """begin("calibrate", ..., store=...) starts ``labsim calibrate ...`` in a process group of its own."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: object, store: Path | None = None, **changes: str) -> subprocess.Popen[str]:
        environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "LABSIM_STORE": str(store or tmp_path / "store"),
            "OMP_NUM_THREADS": "1",
            **changes,
        }
        process = subprocess.Popen(
            [sys.executable, "-m", "labsim", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=tmp_path,
            start_new_session=True,
            # what a shell starts with & ignores interrupts, and so would all that it starts
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait()
