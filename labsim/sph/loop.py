"""The loop over time steps with one law compiled into it.

Numba keeps no compiled code on disk for a function that is passed as an argument. So the source of ``advance`` is written once
more into the cache folder, under the hash of all it is made of, with another law in its import; that copy is an ordinary module.
"""

from __future__ import annotations

import functools
import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path

from ._jit import SOLVER_HASH, loop_folder
from .materials import find_law, hash_law
from .plugins import load_module

TEMPLATE = Path(__file__).with_name("kernels") / "advance.py"
LAW_IMPORT = re.compile(r"^from \.\.materials\.porous_dust import update\b.*$", re.MULTILINE)


def load_loop(law: str) -> Callable[..., int]:
    """``advance`` with the update of ``law`` in it, as its file is now."""
    return _load_loop(law, hash_law(law))


@functools.cache
def _load_loop(law: str, source_hash: str) -> Callable[..., int]:
    module = find_law(law)
    name = f"labsim_loop_{SOLVER_HASH}_{source_hash}"
    source, found = LAW_IMPORT.subn(
        f"from {module.__name__} import update", TEMPLATE.read_text(encoding="utf-8")
    )
    assert found == 1
    for dots, package in ((r"\.\.", __package__), (r"\.", f"{__package__}.kernels")):
        source = re.sub(
            rf"^from {dots}(\w+) import", rf"from {package}.\1 import", source, flags=re.MULTILINE
        )
    return load_module(_write_once(source, name), name).advance


def _write_once(source: str, name: str) -> Path:
    """The file of that source; its time is that of all others of its name, for Numba knows compiled code by it."""
    for folder in (loop_folder(), None):
        try:
            # the cache folder may be one that cannot be written
            folder = folder or Path(tempfile.mkdtemp(prefix="labsim"))
            path = folder / f"{name}.py"
            if path.exists() and path.read_text(encoding="utf-8") == source:
                return path
            folder.mkdir(parents=True, exist_ok=True)
            handle, aside = tempfile.mkstemp(dir=folder, suffix=".part")
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                stream.write(source)
            os.utime(aside, (0, 0))
            os.replace(aside, path)
            return path
        except OSError:
            if folder is None:
                raise
    raise AssertionError
