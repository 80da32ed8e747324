"""What is found by listing a folder: one file a tip, one file a motion, each with its own declared numbers.

What such a file makes is numbers (a profile, a path), and these are part of a run's key: its text is in no hash.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import math
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from ..errors import SimulationError
from .materials import load_module
from .materials._parts import Parameter

# SI unit of a number -> how a key of a TOML file ends, and that unit in SI
KEY_UNITS = {
    "m": ("_mm", 1e-3),
    "rad": ("_deg", math.pi / 180),
    "°": ("_deg", 1.0),
    "m/s": ("_m_s", 1.0),
    "s": ("_ms", 1e-3),
    "kg": ("_mg", 1e-6),
    "Pa": ("_Pa", 1.0),
    "kg/m^3": ("_kg_m3", 1.0),
    "1/s": ("_per_s", 1.0),
    "s^n": ("", 1.0),
    "1": ("", 1.0),
}


def key_of(parameter: Parameter) -> tuple[str, float]:
    """The key that a parameter has in a TOML file, and the key's unit in SI."""
    ending, unit = KEY_UNITS.get(parameter.unit, (f"_{parameter.unit.replace('/', '_per_')}", 1.0))
    return parameter.name + ending, unit


@dataclass(frozen=True)
class Shelf:
    """A folder of files of one kind; a file of the same kind may lie anywhere else.

    key: what names one of them in a setting, as ``projectile.tip``.
    """

    package: str
    folder: Path
    key: str

    def list(self) -> list[str]:
        """Names of those that come with labsim."""
        return sorted(path.stem for path in self.folder.glob("*.py") if not path.stem.startswith("_"))

    def find(self, name: str) -> ModuleType:
        """The module of one: a name of ``list``, or the path of a file. Raises SimulationError."""
        path = Path(name) if name.endswith(".py") else self.folder / f"{name}.py"
        if not path.is_file() or path.stem.startswith("_"):
            raise SimulationError("simulation", self.key, f"{name!r} is none of {', '.join(self.list())}")
        if path.parent == self.folder:
            return importlib.import_module(f"{self.package}.{path.stem}")
        text = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        return load_module(path, f"labsim_{self.folder.name}_{path.stem}_{text}")

    def read_values(self, name: str, given: tuple[tuple[str, float], ...]) -> dict[str, float]:
        """All numbers of one, in SI: those given, the others at their defaults. Raises SimulationError where one is unknown or
        beyond its limits."""
        parameters, own = self.find(name).PARAMETERS, dict(given)
        group = self.key.partition(".")[0]
        for unknown in own.keys() - {each.name for each in parameters}:
            known = ", ".join(each.name for each in parameters) or "no number of its own"
            raise SimulationError(
                "simulation", f"{group}.{unknown}", f"is nothing that {Path(name).stem} has; it has {known}"
            )
        for each in parameters:
            value = own.setdefault(each.name, each.default)
            if not (math.isfinite(value) and each.low <= value <= each.high):
                raise SimulationError(
                    "simulation",
                    f"{group}.{each.name}",
                    f"is {value!r} {each.unit}; use {each.low:g} to {each.high:g}",
                )
        return own


@functools.cache
def shelf(kind: str, key: str) -> Shelf:
    """The shelf of ``tips`` or ``motions``."""
    return Shelf(f"{__package__}.{kind}", Path(__file__).parent / kind, key)
