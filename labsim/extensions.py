"""The modules of a folder, and those that other packages add to it by entry points.

A package joins with a table in its pyproject.toml, here for a video format:

    [project.entry-points."labsim.video_formats"]
    my_camera = "my_package.my_camera"

Groups: ``labsim.track_formats``, ``labsim.video_formats``, ``labsim.ct_formats``, ``labsim.force_formats``,
``labsim.acceleration_formats``, ``labsim.observations``, ``labsim.effects``, ``labsim.terms``.
"""

from __future__ import annotations

import functools
import importlib
import logging
import pkgutil
import sys
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from .errors import LabsimError


def list_modules(package: str, group: str) -> dict[str, ModuleType]:
    """Modules of ``package`` (a dotted name) in the order of their names, then those of other packages, by name.

    Raises LabsimError where one of another package cannot be loaded or has the name of one that is there.
    """
    folder = importlib.import_module(package)
    names = sorted(info.name for info in pkgutil.iter_modules(folder.__path__))
    found = {name: importlib.import_module(f"{package}.{name}") for name in names}
    for entry in _list_entries(group, found):
        try:
            module = entry.load()
        except Exception as trouble:
            raise _refuse(
                entry, group, f"cannot be loaded ({type(trouble).__name__}: {trouble})"
            ) from trouble
        if not isinstance(module, ModuleType):
            raise _refuse(entry, group, f"is {module!r}, no module")
        found[entry.name] = module
    return found


log = logging.getLogger(__name__)


@functools.cache
def announce_code(file: Path) -> None:
    """Say, once, that a file which a campaign brings along is run: somebody else's code, also where little else is said."""
    log.warning("runs %s/%s of this campaign (%s)", file.parent.name, file.name, file.parent.parent)


def list_files(group: str, known: dict[str, Path]) -> dict[str, Path]:
    """Source files that other packages add, by name; none of them is run. known : names that are taken.

    Raises LabsimError.
    """
    found = {}
    for entry in _list_entries(group, known):
        try:
            spec = find_spec(entry.module)
        except ImportError:
            spec = None
        if spec is None or spec.origin is None or not Path(spec.origin).is_file():
            raise _refuse(entry, group, "is no file")
        found[entry.name] = Path(spec.origin)
    return found


def _list_entries(group: str, known: dict[str, ModuleType] | dict[str, Path]) -> list[EntryPoint]:
    entries = sorted(_read_entries(group, tuple(sys.path)), key=lambda entry: entry.name)
    for entry in entries:
        if entry.name in known:
            raise _refuse(entry, group, "has the name of one that comes with labsim")
    return entries


@functools.cache
def _read_entries(group: str, path: tuple[str, ...]) -> EntryPoints:
    """Those that are installed on ``path`` (sys.path), looked for once a process: it takes tens of ms."""
    return entry_points(group=group)


def _refuse(entry: EntryPoint, group: str, what: str) -> LabsimError:
    package = entry.dist.name if entry.dist is not None else entry.value
    return LabsimError(package, f"{group}: {entry.name}", f"{what}; mend or uninstall that package")
