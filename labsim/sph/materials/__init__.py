"""One file a material law, found by listing this folder; a file of the same kind may lie anywhere else.

What a law's file holds is in docs/extend.md; ``porous_dust`` is the longest example.
"""

from __future__ import annotations

from .._jit import SOLVER_HASH
from ..plugins import shelf

SHELF = shelf("materials", "material.law")
list_laws, find_law, hash_law = SHELF.list, SHELF.find, SHELF.hash_source


def solver_hash(law: str = "porous_dust") -> str:
    """Name of the solver with a law in it: every stored run carries it, and a run of another solver is never reused."""
    return f"{SOLVER_HASH[:10]}-{SHELF.locate(law).stem}-{hash_law(law)[:6]}"


def is_current(solver: str) -> bool:
    """Whether this solver could make a run of that name again. Of a law that did not come with labsim nobody knows."""
    name, _, rest = solver.partition("-")
    law, _, _ = rest.partition("-")
    return name == SOLVER_HASH[:10] and (law not in list_laws() or solver == solver_hash(law))


def list_numbers(law: str) -> set[str]:
    """What an effect may change of a law: its parameters, and the terms of a setting that it takes."""
    module = find_law(law)
    return {each.name for each in module.PARAMETERS} | set(getattr(module, "TERMS", ()))
