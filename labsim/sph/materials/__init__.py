"""One file a material law, found by listing this folder; a file of the same kind may lie anywhere else.

What a law's file holds is in docs/extend.md; ``porous_dust`` is the longest example.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from ...errors import SimulationError
from .._jit import SOLVER_HASH

FOLDER = Path(__file__).parent


def list_laws() -> list[str]:
    """Names of the laws that come with labsim."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def find_file(law: str) -> Path:
    """The source of a law: a name of ``list_laws``, or the path of a file."""
    path = Path(law) if law.endswith(".py") else FOLDER / f"{law}.py"
    if not path.is_file():
        raise SimulationError("simulation", "material.law", f"{law!r} is none of {', '.join(list_laws())}")
    return path


@functools.cache
def hash_law(law: str) -> str:
    """Hash of the name and the source of a law: part of the name of every run that it made."""
    path = find_file(law)
    return hashlib.sha256(path.stem.encode() + b"\n" + path.read_bytes()).hexdigest()[:16]


def solver_hash(law: str = "porous_dust") -> str:
    """Name of the solver with a law in it: every stored run carries it, and a run of another solver is never reused."""
    return f"{SOLVER_HASH[:10]}-{find_file(law).stem}-{hash_law(law)[:6]}"


def is_current(solver: str) -> bool:
    """Whether this solver could make a run of that name again. Of a law that did not come with labsim nobody knows."""
    name, _, rest = solver.partition("-")
    law, _, _ = rest.partition("-")
    return name == SOLVER_HASH[:10] and (law not in list_laws() or solver == solver_hash(law))


def list_numbers(law: str) -> set[str]:
    """What an effect may change of a law: its parameters, and the terms of a setting that it takes."""
    module = find_law(law)
    return {each.name for each in module.PARAMETERS} | set(getattr(module, "TERMS", ()))


@functools.cache
def find_law(law: str) -> ModuleType:
    """The module of a law. A file from elsewhere is loaded under the hash of its content, so an edited one is another law."""
    path = find_file(law)
    if path.parent == FOLDER:
        return importlib.import_module(f"{__name__}.{path.stem}")
    return load_module(path, f"labsim_law_{hash_law(law)}")


def load_module(path: Path, name: str) -> ModuleType:
    """Import a file under ``name``: compiled code on disk is found again by that name."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]
