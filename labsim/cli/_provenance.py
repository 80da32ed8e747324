"""What made a result: command, versions, solver, inputs, seed; every summary file carries it, ``labsim rerun`` reads it."""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
import inspect
import os
import platform
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

KEY = "made_by"
LIBRARIES = ("numpy", "scipy", "numba", "emcee", "h5py", "opencv-python-headless", "scikit-image", "arviz")
OUTPUTS = ("--out", "-o", "--store")  # options whose value is no input
FLAGS = ("--quiet", "-q", "--json")  # say nothing about the numbers

_arguments: list[str] = []


def remember(arguments: Sequence[str]) -> None:
    """Keep the command line of this process; ``main`` does it before a command begins."""
    _arguments[:] = [str(each) for each in arguments]


def specify(option: str, value: str) -> None:
    """Say an option of this command line that repeats a part of what it makes."""
    if _arguments:
        _arguments.extend((option, value))


def describe() -> dict[str, Any] | None:
    """What makes the result that is being written, or None outside the command line."""
    if not _arguments:
        return None
    from ..sph import solver_hash

    return {
        "command": ["labsim", *_arguments],
        "folder": os.getcwd(),
        "seed": _find_seed(),
        "versions": list_versions(),
        "solver": solver_hash(),
        "processor": _name_processor(),
        "inputs": {str(path): hash_input(path) for path in list_inputs(_arguments, Path.cwd())},
    }


def list_versions() -> dict[str, str]:
    from .. import __version__

    found = {"labsim": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def list_inputs(arguments: Sequence[str], folder: Path) -> list[Path]:
    """Files and folders named on a command line, but for those that it writes to."""
    found, before = [], ""
    for argument in arguments[1:]:
        value = argument.partition("=")[2] if argument.startswith("--") else argument
        named = argument.partition("=")[0] if argument.startswith("--") and "=" in argument else before
        if value and named not in OUTPUTS and (folder / value).exists():
            found.append((folder / value).resolve())
        before = argument
    return list(dict.fromkeys(found))


def hash_input(path: Path) -> str:
    """sha256 of a file; of a folder, over the names and contents of all that is in it."""
    digest = hashlib.sha256()
    for file in _walk(path):
        digest.update(file.relative_to(path).as_posix().encode() + b"\0")
        with file.open("rb") as stream:
            digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()


def _walk(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
        return
    for file in sorted(path.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            yield file


def _find_seed() -> int | None:
    for place, argument in enumerate(_arguments):
        if argument.startswith("--seed="):
            return int(argument.removeprefix("--seed="))
        if argument == "--seed":
            return int(_arguments[place + 1])
    name = _arguments[0].replace("-", "_")
    command = getattr(importlib.import_module(f"{__package__}.{name}"), name, None)
    stated = inspect.signature(command).parameters.get("seed") if command else None
    return stated.default if stated is not None else None


def _name_processor() -> str:
    """The processor that kernels are compiled for: another one may round differently in the last bit."""
    from llvmlite import binding

    return f"{platform.machine()} {binding.get_host_cpu_name()}"
