"""What is found by listing a folder: one file a law, one a tip, one a motion, each with its own declared numbers.

What a tip or a motion makes is numbers (a profile, a path), and these are part of a run's key: its text is in no hash. The text
of a law is in the hash of its own runs.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from ..errors import SimulationError

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


@dataclass(frozen=True)
class Parameter:
    """One number of a law, a tip or a motion: its limits are those of what a setting may give, both included."""

    name: str
    unit: str
    low: float
    high: float
    default: float
    source: str


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

    def locate(self, name: str) -> Path:
        """The source of one: a name of ``list``, or the path of a file. Raises SimulationError."""
        path = Path(name) if name.endswith(".py") else self.folder / f"{name}.py"
        if not path.is_file() or path.stem.startswith("_"):
            raise SimulationError("simulation", self.key, f"{name!r} is none of {', '.join(self.list())}")
        return path

    def hash_source(self, name: str) -> str:
        """Hash of the name and the source of one, as they are now."""
        path = self.locate(name)
        return hashlib.sha256(path.stem.encode() + b"\n" + path.read_bytes()).hexdigest()[:16]

    def find(self, name: str) -> ModuleType:
        """The module of one. A file from elsewhere is loaded under the hash of its content, so an edited one is another."""
        known = sys.modules.get(f"{self.package}.{name}")
        if known is not None:
            return known
        path = self.locate(name)
        if path.parent == self.folder:
            return importlib.import_module(f"{self.package}.{path.stem}")
        return load_module(path, f"labsim_{self.folder.name}_{self.hash_source(name)}")

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
    """The shelf of a folder here: ``materials``, ``tips`` or ``motions``."""
    return Shelf(f"{__package__}.{kind}", Path(__file__).parent / kind, key)


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
