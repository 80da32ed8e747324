"""The file of one stored run: its name, its whole content behind a checksum, and back.

A run is one HDF5 file named by the hash of its setting and of the solver's sources. Its first 512 bytes (HDF5's user block) hold
the sha256 of the rest, so that no damaged file is ever taken for a run. Arrays are datasets, the rest attributes (JSON).
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import io
import json
import math
import time
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import InferenceError, LabsimError
from ..sph import DropRun, DropSetting, solver_hash
from ..sph.setting import say_material, say_motion, say_projectile
from ..sph.tips import make_profile
from .parts import AnyPart, Part

FORMAT = 1  # of the stored files; part of the key
HEAD = 512  # bytes before the HDF5 part, the smallest user block there is
SIGNATURE = b"\x89HDF\r\n\x1a\n"
LARGEST = 1 << 30  # bytes of one array; a damaged file may claim any size
PACKED = 1 << 16  # bytes; arrays that are larger are compressed, smaller ones would take more room
# whatever a file that was cut, flipped or swapped can make of its readers
DAMAGE = (
    OSError,
    KeyError,
    ValueError,
    TypeError,
    AttributeError,
    RuntimeError,
    StopIteration,
    OverflowError,
    MemoryError,
)


@dataclass(frozen=True)
class FailedRun:
    """A run that blew up: kept, named with its parameters, and not tried again by the same solver."""

    setting: DropSetting
    message: str


@dataclass(frozen=True)
class Stored:
    """One line of the index."""

    key: str
    solver: str
    status: str  # "done" or "failed"
    created: float  # s since 1970
    wall: float  # s
    bytes: int
    label: str


def canonical(setting: DropSetting) -> str:
    """The setting as JSON in which equal settings are equal texts (every number as an exact hexadecimal float).

    A law from elsewhere goes by its name: what is in its file is part of the solver's hash, where it lies changes nothing. The
    outline that a tip's file draws stands in place of the tip's own numbers, a driver's path in place of what made it.
    """
    values = dataclasses.asdict(setting)
    values["material"]["law"] = Path(setting.material.law).stem
    values["projectile"]["tip"] = Path(setting.projectile.tip).stem
    values["projectile"]["shape"] = make_profile(setting.projectile).tolist()
    path = setting.path
    values["motion"] = {"start_depth": setting.motion.start_depth, "path": [each.tolist() for each in path]}
    if path[0].size:
        values["impact_speed"] = 0.0
    return json.dumps(_exact(values), sort_keys=True, separators=(",", ":"))


def make_key(setting: DropSetting, solver: str | None = None) -> str:
    """sha256 over the file format, the solver's sources and the setting."""
    return _hash(solver or solver_hash(setting.material.law), canonical(setting))


def _hash(solver: str, setting: str) -> str:
    return hashlib.sha256(json.dumps([FORMAT, solver, setting]).encode()).hexdigest()


def _exact(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _exact(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_exact(item) for item in value]
    if isinstance(value, (bool, str)) or value is None:
        return value
    if isinstance(value, (int, float, np.floating, np.integer)):
        return float(value).hex()
    raise InferenceError(
        "", "setting", f"{value!r} is not pure data; a setting holds numbers, texts and records only"
    )


def write_run_file(path: Path, run: DropRun | FailedRun, wall: float = 0.0) -> Path:
    """A run with its setting as one HDF5 file: arrays as datasets, the rest as attributes (JSON)."""
    setting = run.setting
    solver, text = solver_hash(setting.material.law), canonical(setting)
    whole = io.BytesIO()  # HDF5 does not end well on a full disk; plain bytes do
    with h5py.File(whole, "w", userblock_size=HEAD) as stored:
        stored.attrs.update(
            format=FORMAT,
            key=_hash(solver, text),
            solver=solver,
            setting_key=text,
            setting=json.dumps(dataclasses.asdict(setting)),
            status="failed" if isinstance(run, FailedRun) else "done",
            created=time.time(),
            wall=wall,
            label=say_setting(setting),
        )
        if isinstance(run, FailedRun):
            stored.attrs["message"] = run.message
        else:
            _pack(stored.create_group("run"), run, skip={"setting"})
    content = memoryview(whole.getvalue())[HEAD:]
    path.write_bytes(_head(content) + bytes(content))
    return path


def _head(content: memoryview | bytes) -> bytes:
    text = f"labsim run; sha256 of what follows these {HEAD} bytes: {hashlib.sha256(content).hexdigest()}\n"
    return text.encode().ljust(HEAD, b"\0")


@contextlib.contextmanager
def _open(path: Path) -> Iterator[h5py.File]:
    """A stored file whose content is what was written; raises OSError or ValueError where it is not."""
    content = path.read_bytes()
    if not content.startswith(SIGNATURE):  # runs of the first days had no head
        if content[:HEAD] != _head(memoryview(content)[HEAD:]):
            raise ValueError("its content is not what was written (checksum)")
    with h5py.File(io.BytesIO(content), "r") as stored:
        yield stored


def _values(item: h5py.h5d.DatasetID) -> np.ndarray:
    """An array, (), (n,) ...; by HDF5's own calls, in half the time of h5py's: a warm diagnosis reads ten thousand."""
    if math.prod(item.shape) * item.dtype.itemsize > LARGEST:
        raise ValueError(f"an array of {item.shape} is no run's")
    values = np.empty(item.shape, item.dtype)
    if values.size:
        item.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
    return values


def read_run_file(path: Path | str) -> DropRun | FailedRun:
    """The run in a file, with its setting. Raises InferenceError where it is not a run."""
    try:
        with _open(Path(path)) as stored:
            setting = _build(DropSetting, json.loads(stored.attrs["setting"]))
        run = read_run(Path(path), setting)
    except LabsimError:
        raise
    except DAMAGE as trouble:
        raise InferenceError(path, "", f"is not a stored run ({trouble}); make it again") from None
    assert isinstance(run, DropRun | FailedRun)
    return run


def read_run(
    path: Path, setting: DropSetting, key: str | None = None, part: Part = DropRun
) -> AnyPart | FailedRun | None:
    """What a file holds of a run, or None where there is none; raises one of DAMAGE."""
    if not path.is_file():
        return None
    with _open(path) as stored:
        if key is not None and stored.attrs["key"] != key:
            raise ValueError("is another run under this name")
        if stored.attrs["status"] == "failed":
            return FailedRun(setting, str(stored.attrs["message"]))
        return _unpack(stored["run"], part, given={"setting": setting})


def read_label(path: Path) -> Stored:
    with _open(path) as stored:
        a = stored.attrs
        return Stored(
            key=str(a["key"]),
            solver=str(a["solver"]),
            status=str(a["status"]),
            created=float(a["created"]),
            wall=float(a["wall"]),
            bytes=path.stat().st_size,
            label=str(a["label"]),
        )


def check_run_file(path: Path) -> None:
    """Read a file whole; raises one of DAMAGE where it is not the run that its name says."""
    with _open(path) as stored:
        if (
            _hash(stored.attrs["solver"], stored.attrs["setting_key"]) != path.stem
            or stored.attrs["key"] != path.stem
        ):
            raise ValueError("its name is not the hash of its setting")
        stored.visititems(
            lambda name, item: _values(item.id).size if isinstance(item, h5py.Dataset) else None
        )


def say_setting(setting: DropSetting) -> str:
    """A setting in one line."""
    return (
        f"{setting.geometry} {say_projectile(setting)}, {say_motion(setting)}, {say_material(setting.material)}, "
        f"spacing {setting.spacing * 1e6:.4g} µm"
    )


def _pack(group: h5py.Group, record: Any, skip: set[str] = frozenset()) -> None:  # type: ignore[assignment]
    """A dataclass of arrays, numbers, texts and further dataclasses into a group."""
    for field in dataclasses.fields(record):
        if field.name in skip:
            continue
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray):
            options = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
            group.create_dataset(field.name, data=value, **(options if value.nbytes > PACKED else {}))
        elif dataclasses.is_dataclass(value):
            _pack(group.create_group(field.name), value)
        else:
            group.attrs[field.name] = json.dumps(value, default=lambda item: item.item())


def _build(kind: type, values: dict[str, Any]) -> Any:
    """A record of plain data from what ``dataclasses.asdict`` made of it."""
    hints = _hints(kind)
    built = {}
    for name, value in values.items():
        if dataclasses.is_dataclass(hints[name]):
            built[name] = _build(hints[name], value)
        else:
            built[name] = _as_tuple(value)
    return kind(**built)


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    """Types of a record's fields; working them out takes as long as reading an array."""
    return typing.get_type_hints(kind)


def _as_tuple(value: Any) -> Any:
    return tuple(_as_tuple(item) for item in value) if isinstance(value, list) else value


def _unpack(group: h5py.Group, kind: type, given: dict[str, Any] | None = None) -> Any:
    hints, members = _hints(kind), {name.decode() for name in group.id}
    values = dict(given or {})
    for field in dataclasses.fields(kind):
        if field.name in values:
            continue
        if field.name in members:
            item = h5py.h5o.open(group.id, field.name.encode())
            if isinstance(item, h5py.h5d.DatasetID):
                values[field.name] = _values(item)[()]
            else:
                nested = [hints[field.name], *typing.get_args(hints[field.name])]
                record = next(option for option in nested if dataclasses.is_dataclass(option))
                values[field.name] = _unpack(h5py.Group(item), record)  # type: ignore[arg-type]
        else:
            values[field.name] = _as_tuple(json.loads(group.attrs[field.name]))
    return kind(**values)
