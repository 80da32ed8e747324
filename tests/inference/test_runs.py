"""Stored runs: each is done once, whatever is killed, whoever asks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from labsim.effects.terms import add_term, list_terms
from labsim.errors import InferenceError, SimulationError
from labsim.inference.emulation.curves import extract_curve
from labsim.records import Material, Projectile
from labsim.runs import run_file
from labsim.runs.parts import Compaction, Motion
from labsim.runs.run_file import FailedRun, canonical, make_key, read_run_file, write_run_file
from labsim.runs.store import RunStore, require_runs
from labsim.sph import DropRun, DropSetting, Numerics

SOFT = Material(bulk_modulus=4500.0)
CYLINDER = Projectile(tip="cylinder", tip_radius=5e-4, mass=2e-3)


def small_drop(speed: float = 0.3, **changes: object) -> DropSetting:
    """A coarse planar drop that takes a fraction of a second."""
    setting = DropSetting(
        CYLINDER,
        speed,
        SOFT,
        geometry="planar",
        spacing=1.25e-4,
        width=4e-3,
        depth=2e-3,
        gravity=0.0,
        after_stop=0.0,
    )
    return setting.replace(**changes)


def same(a: DropRun, b: DropRun) -> bool:
    curves = all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ("time", "depth", "velocity", "force"))
    dust = np.array_equal(a.particles.filling_factor, b.particles.filling_factor)
    return curves and dust and a.penetration_depth == b.penetration_depth and a.energies == b.energies


def test_a_run_comes_back_as_it_was_stored(tmp_path: Path) -> None:
    store = RunStore(tmp_path)
    (first,) = store.get_many([small_drop()], workers=1)
    (again,) = RunStore(tmp_path).get_many([small_drop()], workers=1)
    assert isinstance(first, DropRun) and isinstance(again, DropRun)
    assert same(first, again) and again.setting == small_drop() and again.warnings == first.warnings
    assert (store.new, store.reused) == (1, 0)


def test_a_run_file_carries_its_setting(tmp_path: Path) -> None:
    setting = small_drop(force_of_depth=((0.0, 0.0), (1e-3, 0.2)))
    (run,) = require_runs(RunStore(tmp_path / "store").get_many([setting], workers=1))
    read = read_run_file(write_run_file(tmp_path / "run.h5", run))
    assert isinstance(read, DropRun) and read.setting == setting and same(read, run)
    (tmp_path / "text.h5").write_text("no run")
    with pytest.raises(InferenceError, match=r"text\.h5.*not a stored run"):
        read_run_file(tmp_path / "text.h5")


def test_keys_depend_on_every_value_and_on_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    base = small_drop()
    changed = [
        base.replace(impact_speed=np.nextafter(0.3, 1.0)),
        base.replace(material=SOFT.replace(delta=0.6)),
        base.replace(numerics=Numerics(alpha=0.2)),
        base.replace(strength_shape=((0.2, 1.1),)),
    ]
    keys = {make_key(setting) for setting in [base, *changed]}
    assert len(keys) == 5
    assert canonical(base.replace(gravity=0)) == canonical(base)  # 0 is 0.0
    before = make_key(base)
    monkeypatch.setattr(run_file, "solver_hash", lambda law: "another solver")
    assert make_key(base) != before


def test_every_law_has_runs_of_its_own() -> None:
    """No two terms of one coefficient, and no two coefficients of one term, are taken for one another in the store."""
    base = DropSetting(Projectile("hemisphere", 5e-4, 1.33e-6), 0.6, Material())
    terms = {name: term for name, term in list_terms().items() if term.acts.add is not None}
    assert all(term.limits[0] < 0.04 < 0.05 < term.limits[1] for term in terms.values())
    named: dict[str, list[str]] = {make_key(base): ["no law"]}
    for name, term in terms.items():
        for coefficient in (0.04, 0.05):
            named.setdefault(make_key(add_term(base, term, coefficient)), []).append(f"{name} {coefficient}")
    assert not [alike for alike in named.values() if len(alike) > 1]


def test_many_workers_give_the_numbers_of_one(tmp_path: Path) -> None:
    settings = [small_drop(speed) for speed in (0.2, 0.3, 0.25, 0.3)]
    seen: list[tuple[float, float]] = []
    two = RunStore(tmp_path / "two")
    many = two.get_many(settings, workers=2, progress=lambda done, total, text: seen.append((done, total)))
    one = RunStore(tmp_path / "one").get_many(settings, workers=1)
    assert two.new == 3 and len(seen) == 4 and seen[0][0] == 0.0 and seen[-1][0] == seen[-1][1]
    for a, b, setting in zip(require_runs(many), require_runs(one), settings, strict=True):
        assert same(a, b) and a.setting == setting


def test_parts_of_a_stored_run_are_those_of_the_whole(tmp_path: Path) -> None:
    store, settings = RunStore(tmp_path), [small_drop(0.2), small_drop(0.3)]
    first, second = require_runs(store.get_many(settings, workers=1))
    motion, dust = store.get_parts(settings, [Motion, Compaction], workers=1)
    times = np.linspace(-1e-4, 1.2 * first.stopping_time, 50)
    assert isinstance(motion, Motion) and np.array_equal(motion.depth_at(times), first.depth_at(times))
    assert np.array_equal(extract_curve(motion), extract_curve(first))
    assert isinstance(dust, Compaction) and dust.penetration_depth == second.penetration_depth
    for name in ("r", "z", "volume", "filling_factor"):
        assert np.array_equal(getattr(dust.particles, name), getattr(second.particles, name))
    both = store.get_parts([small_drop()] * 2, [Motion, Compaction], workers=1)
    assert all(isinstance(run, DropRun) for run in both)  # asked for as two parts, and new
    both = store.get_parts([small_drop()] * 2, [Motion, Compaction], workers=1)
    assert all(isinstance(run, DropRun) and same(run, second) for run in both)


def test_a_run_that_blows_up_is_kept_as_failed_and_named(tmp_path: Path) -> None:
    wild = small_drop(numerics=Numerics(alpha=50.0))
    store = RunStore(tmp_path)
    (failed,) = store.get_many([wild], workers=1)
    assert isinstance(failed, FailedRun)
    assert "impact_speed=0.3" in failed.message and "alpha=50.0" in failed.message
    (again,) = store.get_many([wild], workers=1)
    assert isinstance(again, FailedRun) and (store.new, store.reused) == (1, 1)
    assert [entry.status for entry in store.index()] == ["failed"]
    with pytest.raises(SimulationError, match="alpha=50"):
        require_runs([failed])
    assert store.prune(failed=True) == 1 and store.index() == []


def test_a_damaged_file_is_found_and_done_again(tmp_path: Path) -> None:
    store = RunStore(tmp_path)
    (run,) = require_runs(store.get_many([small_drop()], workers=1))
    path = store.path(make_key(small_drop()))
    path.write_bytes(path.read_bytes()[:-3000])
    assert [file for file, _reason in store.verify()] == [path]
    (again,) = require_runs(store.get_many([small_drop()], workers=1))
    assert store.new == 2 and same(run, again) and store.verify() == []


def test_the_index_is_made_again_from_the_files(tmp_path: Path) -> None:
    store = RunStore(tmp_path)
    store.get_many([small_drop(0.2), small_drop(0.3)], workers=1)
    listed = store.index()
    (tmp_path / "index.json").write_text("{ not json")
    assert store.index() == listed and len(listed) == 2
    assert "0.3 m/s" in listed[0].label or "0.3 m/s" in listed[1].label


def test_pruning_removes_runs_of_other_solvers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = RunStore(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(run_file, "solver_hash", lambda law: "old")
        store.get_many([small_drop()], workers=1)
    store.get_many([small_drop()], workers=1)
    assert store.new == 2 and store.prune() == 1
    assert len(store.index()) == 1 and store.find(small_drop()) is not None


SCRIPT = """
import sys
sys.path.insert(0, {here!r})
from test_runs import RunStore, small_drop
if __name__ == "__main__":
    store = RunStore({folder!r})
    store.get_many([small_drop(0.2 + 0.02 * i) for i in range({count})], workers={workers})
    print(store.new, flush=True)
"""


def begin(script: Path, folder: Path, count: int, workers: int) -> subprocess.Popen[str]:
    here = str(Path(__file__).parent)
    script.write_text(SCRIPT.format(here=here, folder=str(folder), count=count, workers=workers))
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment)


def test_a_killed_study_goes_on_where_it_was(tmp_path: Path) -> None:
    folder, count = tmp_path / "store", 8
    process = begin(tmp_path / "study.py", folder, count, workers=2)
    deadline = time.monotonic() + 120.0
    while len(list(folder.glob("??/*.h5"))) < 2:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    store = RunStore(folder)
    assert store.verify() == []
    finished = len(list(folder.glob("??/*.h5")))
    results = store.get_many([small_drop(0.2 + 0.02 * i) for i in range(count)], workers=1)
    assert len(require_runs(results)) == count
    assert (store.new, store.reused) == (count - finished, finished)
    assert store.verify() == []


def test_two_processes_share_the_work(tmp_path: Path) -> None:
    folder, count = tmp_path / "store", 6
    processes = [begin(tmp_path / f"study{i}.py", folder, count, workers=1) for i in range(2)]
    done = [int(process.communicate(timeout=120)[0]) for process in processes]
    assert sum(done) == count, "a run was made twice, or not at all"


def test_a_scheduler_that_is_not_there_is_named(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(InferenceError, match=r"--scheduler.*tcp://127\.0\.0\.1:1"):
        RunStore(tmp_path).get_many([small_drop()], scheduler="tcp://127.0.0.1:1")


def test_a_dask_scheduler_does_the_same_runs(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        store = RunStore(tmp_path / "dask")
        settings = [small_drop(0.2), small_drop(0.3)]
        found = require_runs(store.get_many(settings, scheduler=cluster.scheduler_address))
    here = require_runs(RunStore(tmp_path / "here").get_many(settings, workers=1))
    assert store.new == 2 and all(same(a, b) for a, b in zip(found, here, strict=True))
