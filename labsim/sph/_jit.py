"""The decorators of all compiled code, and a cache that cannot go stale.

Numba checks only the file of the cached function, not the files it calls into, so an edit of one kernel could leave
another one with old code inside. The cache folder is therefore named by a hash of all solver sources.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import platformdirs

_SOURCES = Path(__file__).parent
# a law's file is in the hash of its own runs; a tip's and a motion's numbers are in the key of theirs
ONE_FILE_EACH = ("materials", "tips", "motions")


def hash_sources() -> str:
    """Hash of every source of the solver but the laws', tips' and motions', and the version of the compiler: changes when any
    result could change."""
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(_SOURCES.rglob("*.py")):
        if path.parent.name in ONE_FILE_EACH and not path.name.startswith("_"):
            continue
        digest.update(path.relative_to(_SOURCES).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


SOLVER_HASH = hash_sources()

if "NUMBA_CACHE_DIR" not in os.environ:
    numba.config.CACHE_DIR = str(  # type: ignore[attr-defined]  # set when numba is imported
        Path(platformdirs.user_cache_dir("labsim")) / "compiled" / SOLVER_HASH
    )

# A loop over particles reads and writes two dozen rows, and each pair of them needs a test that they do not overlap before the
# loop may be vectorised; by default the compiler gives up at eight tests. Rows never overlap, a test costs a nanosecond.
llvmlite.binding.set_option("labsim", "-runtime-memory-check-threshold=2000")
# A particle has some 24 neighbours, three vectors of eight. Loops that take two vectors at a time leave one for slow code behind.
llvmlite.binding.set_option("labsim", "-force-vector-interleave=1")

# not fastmath=True: "nnan" and "ninf" make NaN checks inside kernels return False in silence
FAST = {"reassoc", "contract", "arcp", "nsz"}


def compiled(function: Callable) -> Callable:
    """Compile a kernel that other kernels call: serial (one run a core), NaN kept visible.

    Inlined, never cached by itself: a kernel linked from a cache is optimised differently from one compiled afresh, and
    the last bits of a run would depend on which of the two happened.
    """
    return numba.njit(inline="always", error_model="numpy", fastmath=FAST, boundscheck=False)(function)


def compiled_entry(function: Callable) -> Callable:
    """Compile a kernel that Python calls, with everything it calls, and keep the whole on disk."""
    return numba.njit(cache=True, error_model="numpy", fastmath=FAST, boundscheck=False)(function)


def compiled_loop(function: Callable) -> Callable:
    """The same for a kernel that allocates nothing and takes records of arrays: no reference is counted, or every inlined call
    would count those of a whole record up and down, a tenth of the time."""
    choices: dict[str, Any] = dict(
        cache=True, error_model="numpy", fastmath=FAST, boundscheck=False, _nrt=False
    )
    return numba.njit(**choices)(function)


def loop_folder() -> Path:
    """Where copies of the loop with a law in them lie, beside their compiled code."""
    return Path(numba.config.CACHE_DIR) / "loops"  # type: ignore[attr-defined]


def is_compiled() -> bool:
    """Whether compiled code of this solver lies on disk, so that a process need not wait for it."""
    return any(Path(numba.config.CACHE_DIR).glob("**/*.nbi"))  # type: ignore[attr-defined]
