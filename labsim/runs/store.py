"""Stored runs: a simulation is a pure function of its setting and the solver, so it is done once.

Input: drop settings (pure data). Output: the runs, in the same order, from the store where they are there and
simulated where they are not. Files are written aside and renamed: whatever is killed, a file that is there is whole. A lock
per run (freed by the operating system when its process dies) keeps two processes from doing the same run. A run that blew up
is stored as failed. No time stamp decides anything: clocks jump.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any, cast

import filelock
import platformdirs

from ..errors import InferenceError, LabsimError, SimulationError
from ..sph import DropRun, DropSetting, simulate
from ..sph._jit import is_compiled
from ..sph.materials import is_current
from ..text_files import load_json
from .parts import AnyPart, Part
from .run_file import (
    DAMAGE,
    FailedRun,
    Stored,
    check_run_file,
    make_key,
    read_label,
    read_run,
    say_setting,
    write_run_file,
)
from .workers import explain_loss, open_executor, wait_for_any

Progress = Callable[[float, float, str], None]  # work done, all work (in any unit), what is done


def default_store() -> Path:
    """LABSIM_STORE, or ``runs`` in the user's cache folder."""
    named = os.environ.get("LABSIM_STORE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("labsim")) / "runs"


class RunStore:
    """A folder of runs. Any number of processes may use it at once.

    ``new`` and ``reused`` count what ``get_many`` simulated and found since the store was opened.

    Parameters
    ----------
    folder : Path or str, optional
        It is made where it is missing. Default: LABSIM_STORE, or the user's cache.

    Raises
    ------
    InferenceError
        Where the folder cannot be made.
    """

    def __init__(self, folder: Path | str | None = None) -> None:
        self.folder = Path(folder) if folder is not None else default_store()
        self.new = 0
        self.reused = 0
        try:
            (self.folder / "locks").mkdir(parents=True, exist_ok=True)
        except OSError as trouble:
            raise InferenceError(
                self.folder, "--store", f"cannot be made ({trouble.strerror}); name a folder you may write to"
            ) from None

    def path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.h5"

    def find(self, setting: DropSetting) -> DropRun | FailedRun | None:
        """The stored run of this setting and this solver, or None (also where its file is damaged)."""
        return cast("DropRun | FailedRun | None", self._read(make_key(setting), setting))

    def _read(self, key: str, setting: DropSetting, part: Part = DropRun) -> AnyPart | FailedRun | None:
        try:
            return read_run(self.path(key), setting, key, part)
        except DAMAGE:
            return None

    def save(self, run: DropRun | FailedRun, wall: float = 0.0) -> Path:
        """Write aside, flush to the disk, rename: there is never half a file under a run's name. Raises InferenceError."""
        key = make_key(run.setting)
        path = self.path(key)
        aside = path.with_name(f".{key}.{os.getpid()}.part")
        try:
            path.parent.mkdir(exist_ok=True)
            write_run_file(aside, run, wall)
            with aside.open("rb") as stream:
                os.fsync(stream.fileno())
            os.replace(aside, path)
        except OSError as trouble:
            raise self._refused(trouble) from None
        finally:
            with contextlib.suppress(OSError):
                aside.unlink(missing_ok=True)
        return path

    def _refused(self, trouble: OSError) -> InferenceError:
        return InferenceError(
            self.folder,
            "--store",
            f"cannot be written ({trouble.strerror or trouble}); make room there or name another folder and start "
            "again, finished runs are kept",
        )

    def get_many(self, settings: Sequence[DropSetting], **how: Any) -> list[DropRun | FailedRun]:
        """Whole runs of all settings, as ``get_parts`` gives them."""
        found = self.get_parts(settings, [DropRun] * len(settings), **how)
        return cast("list[DropRun | FailedRun]", found)

    def get_parts(
        self,
        settings: Sequence[DropSetting],
        parts: Sequence[Part],
        *,
        workers: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
        text: str = "simulating",
    ) -> list[AnyPart | FailedRun]:
        """Runs of all settings, in their order; equal settings are run once, the longest first.

        parts : per setting, what is read of a run that is stored. progress is told the cost that is done and the cost of what
        was missing, so that the time left can be told.
        Raises InferenceError when a worker process dies; what was finished by then is stored.
        """
        report = progress or (lambda done, total, text: None)
        keys = [make_key(setting) for setting in settings]
        by_key = dict(zip(keys, settings, strict=True))
        part_by_key: dict[str, Part] = {}
        for key, part in zip(keys, parts, strict=True):
            # asked for twice, as different parts: whole
            part_by_key[key] = part if part_by_key.get(key, part) is part else DropRun
        results: dict[str, AnyPart | FailedRun] = {}
        for key, setting in by_key.items():
            if (stored := self._read(key, setting, part_by_key[key])) is not None:
                results[key] = stored
        self.reused += len(results)
        missing = sorted(set(by_key) - set(results), key=lambda key: -estimate_cost(by_key[key]))
        if missing:
            cost = {key: estimate_cost(by_key[key]) for key in missing}
            done, total = 0.0, sum(cost.values())
            if not is_compiled():
                report(0.0, 0.0, f"{text}, the solver is compiled first, once on a machine")
            text += f", {len(missing)} new"
            report(done, total, text)
            with open_executor(workers, scheduler, len(missing)) as (executor, slots):
                for key, run in self._run_missing(executor, slots, [(key, by_key[key]) for key in missing]):
                    results[key] = run
                    done += cost[key]
                    report(total if len(results) == len(by_key) else done, total, text)
        return [results[key] for key in keys]

    def _run_missing(
        self, executor: Executor, slots: int, todo: list[tuple[str, DropSetting]]
    ) -> Iterator[tuple[str, AnyPart | FailedRun]]:
        running: dict[Future, tuple[str, DropSetting, filelock.FileLock]] = {}
        elsewhere: list[tuple[str, DropSetting]] = []
        try:
            while todo or running or elsewhere:
                while todo and len(running) < slots:
                    key, setting = todo.pop(0)
                    lock = self._lock(key)
                    try:
                        lock.acquire()
                    except filelock.Timeout:
                        elsewhere.append((key, setting))  # another process is at it
                        continue
                    except OSError as trouble:
                        raise self._refused(trouble) from None
                    if (stored := self._read(key, setting)) is not None:  # finished elsewhere since we looked
                        lock.release()
                        self.reused += 1
                        yield key, stored
                        continue
                    try:
                        future = executor.submit(run_one, setting)
                    except BaseException:
                        lock.release()
                        raise
                    running[future] = (key, setting, lock)
                if not running:
                    todo, elsewhere = elsewhere, []
                    if todo:
                        time.sleep(0.2)
                    continue
                for future in wait_for_any(executor, running):
                    key, setting, lock = running.pop(future)
                    try:
                        run, wall = future.result()
                        self.save(run, wall)
                    finally:
                        lock.release()
                    self.new += 1
                    yield key, run
        except Exception as trouble:
            if (loss := explain_loss(executor, trouble, self.folder)) is None:
                raise
            raise loss from None
        finally:
            for _key, _setting, lock in running.values():
                lock.release()

    def _lock(self, key: str) -> filelock.FileLock:
        return filelock.FileLock(self.folder / "locks" / key, timeout=0)

    def index(self) -> list[Stored]:
        """All runs, newest first. ``index.json`` only saves reading every file and is made again whenever it is wrong."""
        cache: dict[str, dict] = {}
        path = self.folder / "index.json"
        with contextlib.suppress(LabsimError):
            kept = load_json(path, InferenceError, "it is made again")
            cache = {k: v for k, v in kept.items() if isinstance(v, dict)} if isinstance(kept, dict) else {}
        entries: dict[str, Stored] = {}
        for file in self.folder.glob("??/*.h5"):
            known = cache.get(file.stem)
            size = file.stat().st_size
            if known is not None and known.get("bytes") == size:
                with contextlib.suppress(TypeError):
                    entries[file.stem] = Stored(**known)
                    continue
            with contextlib.suppress(*DAMAGE):
                entries[file.stem] = read_label(file)
        fresh = {key: dataclasses.asdict(entry) for key, entry in entries.items()}
        if fresh != cache:
            aside = self.folder / f".index.{os.getpid()}.part"
            with contextlib.suppress(OSError):  # a store that can only be read is listed all the same
                aside.write_text(json.dumps(fresh))
                os.replace(aside, path)
        return sorted(entries.values(), key=lambda entry: -entry.created)

    def verify(self) -> list[tuple[Path, str]]:
        """Read every file whole; return those that are damaged, with the reason."""
        damaged = []
        for file in sorted(self.folder.glob("??/*.h5")):
            try:
                check_run_file(file)
            except DAMAGE as trouble:
                damaged.append((file, str(trouble)))
        return damaged

    def prune(self, *, other_solvers: bool = True, failed: bool = False, everything: bool = False) -> int:
        """Remove damaged files and left-overs, runs of other solvers, failed runs, or everything; return how many."""
        doomed = {file for file, _reason in self.verify()}
        for entry in self.index():
            old = other_solvers and not is_current(entry.solver)
            if everything or old or (failed and entry.status == "failed"):
                doomed.add(self.path(entry.key))
        for part in self.folder.glob("??/.*.part"):
            lock = self._lock(part.name.split(".")[1])
            with contextlib.suppress(filelock.Timeout, OSError), lock:  # nobody is writing it
                doomed.add(part)
        for file in doomed:
            file.unlink(missing_ok=True)
        self.index()
        return len(doomed)


def run_one(setting: DropSetting) -> tuple[DropRun | FailedRun, float]:
    """One run and its wall time; a run that blows up comes back as failed. This is what a worker does."""
    began = time.perf_counter()
    try:
        run: DropRun | FailedRun = simulate(setting)
    except SimulationError as trouble:
        run = FailedRun(setting, str(trouble))
    return run, time.perf_counter() - began


def require_runs(runs: Sequence[DropRun | FailedRun]) -> list[DropRun]:
    """The runs, or a SimulationError that names the first one that failed."""
    for run in runs:
        if isinstance(run, FailedRun):
            raise SimulationError("", "", run.message)
    return [run for run in runs if isinstance(run, DropRun)]


def require_stopped(runs: Sequence[DropRun | FailedRun]) -> list[DropRun]:
    """As ``require_runs``, and every projectile has come to rest: depth and stopping time mean what they say."""
    done = require_runs(runs)
    for run in done:
        if not run.stopped:
            key, given = "duration", f"{run.setting.duration:g} s was too short"
            if run.fell_through:
                key, given = "depth", f"{run.depth[-1] * 1e3:.3g} mm of dust did not stop the drop"
            raise SimulationError("simulation", key, f"{given} for {say_setting(run.setting)}; raise it")
    return done


def estimate_cost(setting: DropSetting) -> float:
    """Relative cost of a run: particles times steps (the sound speed goes with the root of the bulk modulus)."""
    width, depth = setting.extent
    slowness = setting.material.p_m**-0.3 * setting.projectile.tip_radius  # the stopping time goes with it
    if (time := setting.path[0]).size:
        slowness = time[-1] / 30.0  # a drop takes thirty times its slowness
    return width * depth * slowness * setting.material.bulk_modulus**0.5 / setting.spacing**3
