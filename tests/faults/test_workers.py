"""A sweep that cannot go on ends, whatever its workers are at: with a result longer than a pipe holds half sent, say."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, wait
from pathlib import Path

import pytest
import small_sweep
from attempts import list_children
from small_campaign import ROOT

from labsim.runs.processes import ProcessWorkers

LONG = 1 << 20  # bytes of a result, many buffers of a pipe


def run_sweep(*, stop: int = -1, deadly: int = -1, delay: float = 0.0) -> tuple[int, str, float]:
    """Exit status, what was said, and seconds."""
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, small_sweep.__file__, *map(str, (50, LONG, stop, deadly, delay))],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    return done.returncode, done.stderr, time.monotonic() - began


@pytest.mark.parametrize("stop", [1, 2, 3, 5, 8])
def test_an_error_within_a_sweep_ends_the_process(stop: int) -> None:
    """While the next results are under way, each of 1 MB."""
    status, said, seconds = run_sweep(stop=stop)
    assert status == 1 and "No space left" in said and seconds < 10.0


@pytest.mark.parametrize("delay", [0.0, 1e-4, 3e-4, 1e-3])
def test_a_worker_killed_within_its_result_ends_the_sweep(delay: float) -> None:
    status, said, seconds = run_sweep(deadly=7, delay=delay)
    assert seconds < 10.0
    assert status == 0 or "killed by SIGKILL" in said, said  # 0: the last one that it had to do was through


def test_workers_do_the_calls_and_say_what_went_wrong() -> None:
    workers = ProcessWorkers(2)
    try:
        calls = [workers.submit(pow, 2, k) for k in range(20)]
        assert [call.result(60) for call in calls] == [2**k for k in range(20)]
        with pytest.raises(ZeroDivisionError):
            workers.submit(pow, 0, -1).result(60)
        assert len(workers._processes) <= 2
    finally:
        workers.end()
    assert all(process.exitcode is not None for process in workers._processes)
    with pytest.raises(BrokenExecutor):
        workers.submit(pow, 2, 2)


def test_a_worker_follows_its_caller_into_another_folder(tmp_path: Path, monkeypatch) -> None:
    workers = ProcessWorkers(1)
    try:
        for name in ("one", "two"):
            (tmp_path / name).mkdir()
            monkeypatch.chdir(tmp_path / name)
            assert workers.submit(os.getcwd).result(60) == str(tmp_path / name)
    finally:
        workers.end()


def test_a_worker_compiles_into_the_cache() -> None:
    """And not into the folder that somebody works in, though the script that it imports again has imported labsim: Numba forgets
    a folder that is set where a variable of its own changes."""
    code = (
        "import labsim.sph, numba; from labsim.sph._jit import loop_folder; from labsim.runs.processes import _begin; "
        "kept = loop_folder(); _begin(); numba.config.reload_config(); assert loop_folder() == kept, loop_folder()"
    )
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_what_was_not_begun_is_cancelled() -> None:
    workers = ProcessWorkers(1)
    calls = [workers.submit(time.sleep, 60.0) for _ in range(3)]
    time.sleep(0.5)
    workers.end()
    assert wait(calls, timeout=10).not_done == set()
    assert isinstance(calls[0].exception(1) if not calls[0].cancelled() else BrokenExecutor(), BrokenExecutor)
    assert calls[1].cancelled() and calls[2].cancelled()


@pytest.mark.parametrize("whom", ["main", "group"])
def test_a_request_to_end_is_taken_as_ctrl_c(begin, tmp_path: Path, whom: str) -> None:
    """Of the main process alone (kill), or of all (a batch system): one line, nothing of the machinery's, no orphans."""
    soft = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3 --spacings 6".split()
    process = begin("simulate", *soft, "-o", tmp_path / "out", "--workers", 2, "--quiet")
    deadline = time.monotonic() + 60.0
    while not list((tmp_path / "store").glob("??/*.h5")):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.02)
    children = list_children(process.pid)
    assert len(children) >= 2
    began = time.monotonic()
    (os.killpg if whom == "group" else os.kill)(process.pid, signal.SIGTERM)
    _out, said = process.communicate(timeout=30)
    assert time.monotonic() - began < 10.0
    assert process.returncode == 143, said
    assert said.splitlines() == ["error: stopped; start the same command again to go on from the stored runs"]
    while left := [child for child in children if Path(f"/proc/{child}/cmdline").exists()]:
        # what counts Python's semaphores ends a moment after its parent
        assert time.monotonic() - began < 10.0, left
        time.sleep(0.05)


def test_a_command_says_what_went_wrong_in_its_own_words_only(
    capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    """Not numpy's, with its lines of source."""
    import numpy as np

    import labsim.cli

    def command(**how: object) -> int:
        assert np.isnan(np.mean(np.array([])))
        return 0

    monkeypatch.setattr(labsim.cli, "app", command)
    monkeypatch.setattr(sys, "warnoptions", [])
    with pytest.raises(SystemExit):
        labsim.cli.main(["check"])
    assert capsys.readouterr().err == ""
    with pytest.warns(RuntimeWarning):  # outside a command they stay
        np.mean(np.array([]))
