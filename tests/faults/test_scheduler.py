"""A real scheduler with two worker processes, one of which is killed within the study: the same numbers as here."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from small_campaign import ROOT, add_videos_and_scans, copy_campaign

from labsim.cli._compare import compare_folders
from labsim.errors import InferenceError
from labsim.records import Material, Projectile
from labsim.runs import workers
from labsim.runs.store import RunStore, require_runs
from labsim.runs.workers import run_with_solver
from labsim.sph import DropSetting

pytest.importorskip("distributed")


class Cluster:
    """``dask scheduler`` and ``dask worker`` as anybody would start them, each in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        self.scheduler = self._start(
            "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file)
        )
        deadline = time.monotonic() + 120.0
        while not self.file.exists() or not self.file.read_text().strip():
            assert time.monotonic() < deadline and self.scheduler.poll() is None
            time.sleep(0.05)
        import json

        self.address = json.loads(self.file.read_text())["address"]
        self.workers = [self.add_worker() for _ in range(2)]
        self.wait_for(2)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments]
        log = (self.folder / f"{arguments[0]}-{time.monotonic_ns()}.log").open("wb")
        return subprocess.Popen(command, env=self.environment, stdout=log, stderr=log, start_new_session=True)

    def add_worker(self) -> subprocess.Popen[bytes]:
        """One process, one run at a time, no nanny that would start it again, and no disk in common."""
        own = self.folder / f"worker-{time.monotonic_ns()}"
        own.mkdir()
        return self._start(
            "worker",
            self.address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
            "--local-directory",
            str(own),
        )

    def wait_for(self, count: int) -> None:
        from distributed import Client

        with Client(self.address, timeout=60) as client:
            client.wait_for_workers(count, timeout=180)

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            if process.poll() is None:
                process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    made = Cluster(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


def small_drop(speed: float) -> DropSetting:
    cylinder = Projectile(tip="cylinder", tip_radius=5e-4, mass=2e-3)
    return DropSetting(
        cylinder,
        speed,
        Material(bulk_modulus=4500.0),
        geometry="planar",
        spacing=1.0e-4,
        width=4e-3,
        depth=2e-3,
        gravity=0.0,
        after_stop=0.0,
    )


def test_a_worker_killed_within_a_sweep_changes_nothing(cluster: Cluster, tmp_path: Path) -> None:
    settings = [small_drop(0.2 + 0.01 * k) for k in range(8)]
    killed: list[int] = []

    def kill_one(done: float, total: float, text: str) -> None:
        if done > 0 and not killed:
            victim = cluster.workers.pop()
            os.kill(victim.pid, signal.SIGKILL)
            victim.wait()
            killed.append(victim.pid)

    store = RunStore(tmp_path / "dask")
    there = require_runs(store.get_many(settings, scheduler=cluster.address, progress=kill_one))
    assert killed and store.new == len(settings) and store.verify() == []
    here = require_runs(RunStore(tmp_path / "here").get_many(settings, workers=1))
    for a, b in zip(there, here, strict=True):
        assert a.setting == b.setting and a.energies == b.energies
        for name in ("time", "depth", "velocity", "force"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
    cluster.workers.append(cluster.add_worker())
    cluster.wait_for(2)


def run(*arguments: object, store: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "LABSIM_STORE": str(store), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "labsim", *map(str, arguments), "--quiet"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_scheduler_without_workers_is_said_and_then_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """With the times of workers.py in seconds instead of minutes."""
    monkeypatch.setattr(workers, "LOOK_EVERY", 0.5)
    monkeypatch.setattr(workers, "SAID_AFTER", 1.0)
    monkeypatch.setattr(workers, "GIVEN_UP_AFTER", 4.0)
    own = Cluster(tmp_path)
    try:

        def kill_all(done: float, total: float, text: str) -> None:
            for worker in own.workers if done > 0 else ():
                if worker.poll() is None:
                    worker.kill()
                    worker.wait()

        store = RunStore(tmp_path / "store")
        began = time.monotonic()
        with pytest.raises(InferenceError, match="has had no workers for") as found:
            settings = [small_drop(0.2 + 0.01 * k) for k in range(8)]
            store.get_many(settings, scheduler=own.address, progress=kill_all)
        assert time.monotonic() - began < 60.0
    finally:
        own.close()
    said = [record.getMessage() for record in caplog.records if record.name == workers.log.name]
    assert len(said) == 1 and f"all workers of {own.address} are gone" in said[0]
    assert "\n" not in str(found.value) and own.address in str(found.value)


@pytest.mark.parametrize("command", ["track", "ct"])
def test_measurements_of_a_campaign_are_the_same_there(
    cluster: Cluster, tmp_path: Path, command: str
) -> None:
    campaign = add_videos_and_scans(copy_campaign(tmp_path / "campaign"), videos=1)
    there, here = tmp_path / "there", tmp_path / "here"
    run(command, campaign, "-o", there, "--scheduler", cluster.address, store=tmp_path / "store")
    run(command, campaign, "-o", here, "--workers", 1, store=tmp_path / "store")
    found = compare_folders(here, there)
    assert found.same and found.numbers > 100, found.differences
    shutil.rmtree(campaign)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["calibrate", "diagnose"])
def test_a_study_is_the_same_there(cluster: Cluster, tmp_path: Path, command: str) -> None:
    campaign = copy_campaign(tmp_path / "campaign")
    there, here = tmp_path / "there", tmp_path / "here"
    run(command, campaign, "-o", there, "--scheduler", cluster.address, store=tmp_path / "dask")
    run(command, campaign, "-o", here, "--workers", 2, store=tmp_path / "processes")
    found = compare_folders(here, there)
    assert found.same and found.numbers > 100, found.differences


def test_another_solver_on_a_worker_is_refused() -> None:
    with pytest.raises(InferenceError, match="another version is installed on this worker"):
        run_with_solver("another", len, [])


def test_a_scheduler_that_dies_is_said_in_one_line(tmp_path: Path) -> None:
    own = Cluster(tmp_path)
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "LABSIM_STORE": str(tmp_path / "store"),
        "OMP_NUM_THREADS": "1",
    }
    quick = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 110 --speed-m-s 0.3 --spacings 4".split()
    try:
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "labsim",
                "simulate",
                *quick,
                "-q",
                "-o",
                tmp_path / "out",
                "--scheduler",
                own.address,
            ],
            env=environment,
            stderr=subprocess.PIPE,
            text=True,
        )
        deadline = time.monotonic() + 120.0
        while not list((tmp_path / "store").glob("??/*.h5")):
            assert time.monotonic() < deadline and process.poll() is None
            time.sleep(0.02)
        own.scheduler.kill()
        _out, said = process.communicate(timeout=120)
    finally:
        own.close()
    errors = [line for line in said.splitlines() if line.startswith("error: ")]
    assert process.returncode == 2 and len(errors) == 1 and "Traceback" not in said, said
    assert own.address in errors[0] and "does not answer any more" in errors[0] and "memory" not in errors[0]
    assert RunStore(tmp_path / "store").verify() == []
