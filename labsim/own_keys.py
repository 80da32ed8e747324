"""Keys that a tip, a motion or a law brings with it: read from its own file's list of parameters, in the units of the key.

The solver's files are imported only where something else than a plain drop of a round tip into porous dust is asked for.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from .errors import CampaignError, LabsimError
from .extensions import announce_code
from .records import Material, Motion
from .tables import Table

ROUND = ("hemisphere", "sphere")  # tips that have been known from the first day
DUST = "porous_dust"

Values = tuple[tuple[str, float], ...]


def read_tip(table: Table, known: tuple[str, ...], beside: Path | None = None) -> tuple[str, Values]:
    """``tip`` and the tip's own numbers. known : the keys of every projectile; beside : a campaign that may
    hold it in ``tips/``."""
    name = table.text("tip")
    if name in ROUND and set(table.values) <= {"tip", *known}:
        return name, ()
    from .sph.tips import SHELF

    name = find_name(table, "tip", name, "tips", beside)
    module = SHELF.find(name)
    if "axisymmetric" not in getattr(module, "GEOMETRIES", ("axisymmetric",)):
        raise table.wrong("tip", f"{name!r} is planar; write one of " + _quote(SHELF.list()))
    return name, read_own(table, f'tip = "{Path(name).stem}"', module.PARAMETERS)


def read_motion(table: Table, beside: Path | None = None, folder: Path = Path()) -> Motion:
    """[motion]. folder : where a ``file`` lies."""
    if not table.values:
        return Motion()
    from .sph.motions import SHELF

    kind = find_name(table, "kind", table.text("kind", "free"), "motions", beside)
    module = SHELF.find(kind)
    start = table.number("start_depth_mm", 0.0, 1000.0, unit=1e-3, default=0.0)
    sigma = table.number("speed_sigma_m_s", 0.0, 100.0, default=0.0)
    path: tuple[tuple[float, float], ...] = ()
    if getattr(module, "TAKES_TABLE", False):
        path = _read_path(table, folder)
    values = read_own(table, f'kind = "{Path(kind).stem}"', module.PARAMETERS)
    motion = Motion(kind, start, values, path, sigma)
    try:
        from .sph.motions import make_path

        make_path(motion)
    except LabsimError as trouble:
        raise CampaignError(table.file, trouble.key, trouble.message) from None
    return motion


def read_law(table: Table, beside: Path | None = None) -> tuple[Material, str, tuple[float, float]]:
    """Material of a law that is not the dust's, what of it is calibrated, and its range (SI), whose middle is in force."""
    from .sph.materials import find_law
    from .sph.plugins import key_of

    law = find_name(table, "law", table.text("law"), "materials", beside)
    module = find_law(law)
    what = f'law = "{Path(law).stem}"'
    by_name = {each.name: each for each in module.PARAMETERS}
    first = by_name[module.CALIBRATED.name]
    ending, unit = key_of(first)[0].removeprefix(first.name), key_of(first)[1]
    low, high = read_range(table, f"{first.name}_range{ending}", first.low / unit, first.high / unit)
    friction = table.number("contact_friction", 0.0, 5.0, default=0.0)
    others = tuple(each for each in module.PARAMETERS if each is not first)
    values = ((first.name, math.sqrt(low * high) * unit), *read_own(table, what, others))
    return (
        Material(contact_friction=friction, law=law, constants=values),
        first.name,
        (low * unit, high * unit),
    )


def read_range(table: Table, key: str, least: float, most: float) -> tuple[float, float]:
    """Two numbers between which a strength is looked for, in the key's unit."""
    return table.span(
        key, least, most, write="two pressures in Pa as [300.0, 6000.0]", first="smaller pressure"
    )


def set_law(material: Material, table: Table) -> Material:
    """The material with the keys of a law's own, or ``contact_friction``, changed."""
    from .sph.materials import find_law

    what = f'law = "{Path(material.law).stem}"'
    friction = table.number("contact_friction", 0.0, 5.0, default=material.contact_friction)
    values = dict(material.constants) | dict(read_own(table, what, find_law(material.law).PARAMETERS))
    return material.replace(contact_friction=friction, constants=tuple(values.items()))


def find_name(table: Table, key: str, name: str, folder: str, beside: Path | None) -> str:
    """A name of labsim's own ``tips``, ``motions`` or ``materials``, or the file of that name in the campaign's folder. Raises
    CampaignError where there is none or it cannot be loaded."""
    from .sph import materials, motions, tips

    shelves: dict[str, tuple[Any, Any]] = {
        "tips": (tips.list_tips, tips.find_tip),
        "motions": (motions.list_motions, motions.find_motion),
        "materials": (materials.list_laws, materials.find_law),
    }
    there, find = shelves[folder]
    own = beside / folder / f"{name}.py" if beside is not None else None
    if own is not None and own.is_file():
        name = str(own)
        announce_code(own.resolve())
    elif name not in there() and not (name.endswith(".py") and Path(name).is_file()):
        where = f", or put {name}.py into the campaign's {folder}/" if beside is not None else ""
        raise table.wrong(key, f"{name!r} is not known; write one of {_quote(there())}{where}")
    try:
        module = find(name)
    except Exception as trouble:
        raise table.wrong(key, f"{name}: cannot be loaded ({type(trouble).__name__}: {trouble})") from None
    if not isinstance(getattr(module, "PARAMETERS", None), tuple):
        raise table.wrong(key, f"{name}: has no PARAMETERS; write a tuple of them, () where there are none")
    return name


def read_own(table: Table, what: str, parameters: tuple[Any, ...]) -> Values:
    """The numbers of one that are written down, in SI; others are left to its defaults."""
    from .sph.plugins import key_of

    found, keys = [], []
    for each in parameters:
        key, unit = key_of(each)
        keys.append(key)
        # in whole digits of the key's unit: 85 degrees are no more than 85 degrees
        low, high = float(f"{each.low / unit:.12g}"), float(f"{each.high / unit:.12g}")
        value = table.number(key, low, high, unit=unit, default=None)
        if value is not None:
            found.append((each.name, min(max(value, each.low), each.high)))
    table.note = f"{what} has " + (", ".join(keys) if keys else "no key of its own")
    return tuple(found)


def _read_path(table: Table, folder: Path) -> tuple[tuple[float, float], ...]:
    """Columns time_s and depth_m of a CSV, as ``labsim simulate`` writes them in curve.csv."""
    import pandas as pd

    path = folder / table.text("file")
    try:
        read = pd.read_csv(path)
        return tuple(zip(read["time_s"].astype(float), read["depth_m"].astype(float), strict=True))
    except FileNotFoundError:
        raise table.wrong("file", f"{path} is not there; name the path relative to {folder}") from None
    except (KeyError, ValueError) as trouble:
        raise table.wrong(
            "file", f"{path} has no numbers in the columns time_s and depth_m ({trouble})"
        ) from None


def _quote(names: list[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)
