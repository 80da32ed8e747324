"""What a machine can do to a command: no room, no right to write, a clock that jumps, a signal, a kill, company.

Whatever happens, what is done is kept, nothing half-written is ever read, and the next start goes on.
"""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import filelock
import numpy as np
import pytest
from attempts import list_children

from labsim.errors import InferenceError
from labsim.records import Material, Projectile
from labsim.runs.run_file import HEAD, make_key, read_run_file, write_run_file
from labsim.runs.store import RunStore, require_runs
from labsim.sph import DropRun, DropSetting

SOFT = Material(bulk_modulus=4500.0)
SWEEP = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3 --spacings 3".split()
ONE = SWEEP[:-2]
LONG_SWEEP = [*ONE, "--spacings", "6"]  # its finest run still goes on, seconds after others are stored


def small_drop(speed: float = 0.3) -> DropSetting:
    cylinder = Projectile(tip="cylinder", tip_radius=5e-4, mass=2e-3)
    return DropSetting(
        cylinder, speed, SOFT, geometry="planar", spacing=1.25e-4, width=4e-3, depth=2e-3, gravity=0.0, after_stop=0.0
    )  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> DropRun:
    (found,) = require_runs(RunStore(tmp_path_factory.mktemp("one")).get_many([small_drop()], workers=1))
    return found


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 kB; only where this process may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)], capture_output=True, check=False
    )
    if made.returncode:
        pytest.skip("needs the right to mount a tmpfs")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


def wait_for(store: Path, count: int, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 120.0
    while len(list(store.glob("??/*.h5"))) < count:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.01)


def one_error(process: subprocess.Popen[str], status: int = 2) -> str:
    """The single line a command left with."""
    _out, said = process.communicate(timeout=120)
    lines = [line for line in said.splitlines() if line.strip() and not line.startswith("simulating")]
    assert process.returncode == status, said
    assert len(lines) == 1 and lines[0].startswith("error: "), said
    return lines[0]


# --- signals -----------------------------------------------------------------------------------------------------


def test_an_interrupt_keeps_what_is_done_and_says_one_line(begin, tmp_path: Path) -> None:
    process = begin("simulate", *LONG_SWEEP, "-o", tmp_path / "out", "--workers", 2)
    wait_for(tmp_path / "store", 1, process)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
    assert "start the same command again" in one_error(process, 130)
    store = RunStore(tmp_path / "store")
    assert store.verify() == [] and len(store.index()) >= 1
    again = begin("simulate", *LONG_SWEEP, "-o", tmp_path / "out", "--workers", 2, "--quiet")
    assert again.wait(timeout=120) == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_sweep_killed_at_a_random_instant_goes_on(begin, tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    process = begin("simulate", *SWEEP, "-o", tmp_path / "out", "--workers", 2, "--quiet")
    time.sleep(chance.uniform(1.0, 8.0))
    process.kill()
    process.communicate()
    assert RunStore(tmp_path / "store").verify() == [], "a damaged run lies in the store"
    before = len(list((tmp_path / "store").glob("??/*.h5")))
    again = begin("simulate", *SWEEP, "-o", tmp_path / "out", "--workers", 1, "--quiet")
    assert again.wait(timeout=120) == 0
    after = RunStore(tmp_path / "store")
    assert after.verify() == [] and len(after.index()) == 3 and before <= 3
    alone = begin("simulate", *SWEEP, "-o", tmp_path / "alone", "--quiet", store=tmp_path / "other")
    assert alone.wait(timeout=120) == 0
    assert (tmp_path / "out" / "curve.csv").read_bytes() == (tmp_path / "alone" / "curve.csv").read_bytes()


def test_a_killed_worker_is_said_and_costs_what_was_in_flight(begin, tmp_path: Path) -> None:
    process = begin("simulate", *SWEEP, "-o", tmp_path / "out", "--workers", 2)
    wait_for(tmp_path / "store", 1, process)
    children = list_children(process.pid)
    workers = [int(c) for c in children if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]
    os.kill(workers[0], signal.SIGKILL)
    process.communicate(timeout=120)
    assert process.returncode in (0, 2)  # 0: that worker had nothing left to do
    kept = len(RunStore(tmp_path / "store").index())
    assert kept >= 1 and RunStore(tmp_path / "store").verify() == []


# --- disks -------------------------------------------------------------------------------------------------------


def test_a_full_store_is_said_and_leaves_nothing_half(small_disk: Path, run: DropRun) -> None:
    store = RunStore(small_disk / "store")
    with pytest.raises(InferenceError, match=r"No space left.*start again, finished runs are kept"):
        for speed in np.linspace(0.3, 0.4, 50):
            store.save(DropRun(**{**run.__dict__, "setting": small_drop(float(speed))}))
    files = list(store.folder.glob("??/*"))
    assert store.verify() == [] and all(file.suffix == ".h5" for file in files), files


@pytest.mark.parametrize("where", ["output", "store"])
def test_a_full_disk_is_one_line(begin, small_disk: Path, tmp_path: Path, where: str) -> None:
    out = small_disk / "out" if where == "output" else tmp_path / "out"
    store = small_disk / "store" if where == "store" else tmp_path / "store"
    (small_disk / "filler").write_bytes(bytes(40_000))
    line = one_error(begin("simulate", *ONE, "-o", out, "--workers", 1, store=store))
    assert "No space left" in line and str(small_disk) in line
    (small_disk / "filler").unlink()
    subprocess.run(["mount", "-o", "remount,size=50m", str(small_disk)], check=True)
    assert begin("simulate", *ONE, "-o", out, "--quiet", store=store).wait(timeout=120) == 0
    json.loads((out / "run.json").read_text())


def test_a_file_that_may_not_grow_is_said(tmp_path: Path, run: DropRun) -> None:
    """A quota, without a disk of its own: no file of this process may pass 20 kB."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    store = RunStore(tmp_path / "store")
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
        with pytest.raises(InferenceError, match="File too large"):
            store.save(run)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert list(store.folder.glob("??/*")) == [] and store.find(small_drop()) is None


def test_output_that_cannot_be_written_is_one_line(begin, small_disk: Path, tmp_path: Path) -> None:
    (small_disk / "kept").mkdir()
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    line = one_error(begin("simulate", *ONE, "-o", small_disk / "out", "--workers", 1))
    assert "--out" in line and "Read-only" in line
    line = one_error(begin("simulate", *ONE, "-o", small_disk / "kept", "--workers", 1))
    assert str(small_disk) in line and "Read-only" in line
    line = one_error(
        begin("simulate", *ONE, "-o", tmp_path / "out", "--workers", 1, store=small_disk / "store")
    )
    assert "--store" in line


def test_a_store_that_can_only_be_read_gives_its_runs(small_disk: Path, run: DropRun) -> None:
    subprocess.run(["mount", "-o", "remount,size=1m", str(small_disk)], check=True)
    RunStore(small_disk / "store").save(run)
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    store = RunStore(small_disk / "store")
    (found,) = require_runs(store.get_many([small_drop()], workers=1))
    assert np.array_equal(found.depth, run.depth) and len(store.index()) == 1
    with pytest.raises(InferenceError, match="Read-only"):
        store.get_many([small_drop(0.2)], workers=1)


# --- files that are not what they were ---------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_run_is_never_read(tmp_path: Path, run: DropRun, seed: int) -> None:
    """Cut anywhere, or any byte flipped: made again, never half-read."""
    chance = random.Random(seed)
    store = RunStore(tmp_path)
    path = store.save(run)
    content = bytearray(path.read_bytes())
    if seed % 2:
        content = content[: chance.randrange(len(content))]
    else:
        place = chance.randrange(len(content))
        content[place] ^= 1 << chance.randrange(8)
    path.write_bytes(content)
    assert store.find(run.setting) is None
    assert [file for file, _reason in store.verify()] == [path]
    with pytest.raises(InferenceError, match="not a stored run"):
        read_run_file(path)
    assert store.prune() == 1 and not path.exists()


def test_a_run_under_another_name_is_not_taken_for_it(tmp_path: Path, run: DropRun) -> None:
    store = RunStore(tmp_path)
    other = store.path(make_key(small_drop(0.31)))
    other.parent.mkdir(parents=True)
    shutil.copy(store.save(run), other)
    assert store.find(small_drop(0.31)) is None and store.find(small_drop()) is not None
    assert [file for file, _reason in store.verify()] == [other]


def test_any_hdf5_reader_opens_a_run(tmp_path: Path, run: DropRun) -> None:
    import h5py

    path = write_run_file(tmp_path / "run.h5", run)
    with h5py.File(path) as stored:
        assert stored.userblock_size == HEAD
        assert np.array_equal(stored["run/depth"][()], run.depth)
    assert b"sha256" in path.read_bytes()[:HEAD]


# --- clocks and company ------------------------------------------------------------------------------------------


def test_time_stamps_decide_nothing(tmp_path: Path, run: DropRun, monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock stands in 1971, jumps to 2100 and back: the same runs are found, and only left-overs are removed."""
    store = RunStore(tmp_path)
    monkeypatch.setattr(time, "time", lambda: 4.1e9)
    path = store.save(run)
    monkeypatch.setattr(time, "time", lambda: 4e7)
    os.utime(path, (0, 0))
    found = RunStore(tmp_path).find(small_drop())
    assert isinstance(found, DropRun) and np.array_equal(found.depth, run.depth)
    key = make_key(small_drop(0.2))
    (tmp_path / key[:2]).mkdir(exist_ok=True)
    written = tmp_path / key[:2] / f".{key}.1.part"
    for when in (0, 4_000_000_000):
        written.write_bytes(b"half")
        os.utime(written, (when, when))
        with filelock.FileLock(tmp_path / "locks" / key):  # somebody is writing it
            assert store.prune() == 0 and written.exists()
    assert store.prune() == 1 and not written.exists() and path.exists()


def test_two_commands_share_one_store(begin, tmp_path: Path) -> None:
    pair = [
        begin("simulate", *SWEEP, "-o", tmp_path / f"out{k}", "--workers", 1, "--quiet") for k in range(2)
    ]
    assert [process.wait(timeout=200) for process in pair] == [0, 0]
    store = RunStore(tmp_path / "store")
    assert len(store.index()) == 3 and store.verify() == []
    first, second = (tmp_path / f"out{k}" / "curve.csv" for k in range(2))
    assert first.read_bytes() == second.read_bytes()


def test_errors_cross_processes() -> None:
    import pickle

    error = InferenceError("file", "key", "what")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is InferenceError and (again.where, again.key, again.message) == (
        "file",
        "key",
        "what",
    )


def test_nothing_is_unpickled_and_nothing_unsafe_is_loaded() -> None:
    """No code of labsim reads a pickle from a file, loads arrays with pickles allowed, or YAML other than safely."""
    import ast

    found = []
    for file in (Path(__file__).parents[2] / "labsim").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if not isinstance(node, ast.Call):
                continue
            name = ast.unparse(node.func)
            keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
            unsafe = name in {
                "pickle.load",
                "pickle.loads",
                "joblib.load",
                "dill.load",
                "marshal.load",
                "pd.read_pickle",
            }
            unsafe |= name in {"np.load", "numpy.load"} and keywords.get("allow_pickle", "False") != "False"
            unsafe |= name in {"yaml.load", "yaml.full_load", "yaml.unsafe_load"}
            unsafe |= name.endswith((".extractall", ".unpack_archive"))
            if unsafe:
                found.append(f"{file.name}:{node.lineno}: {name}")
    assert found == []
