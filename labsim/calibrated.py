"""The one parameter of a law that is calibrated: p_m of porous dust, cohesion of clay, or what else the law's file says."""

from __future__ import annotations

import math
from pathlib import Path

from .records import Material


def find_parameter(law: str) -> tuple[str, str]:
    """Name and unit of what is calibrated of a law, a name or the path of its file."""
    from .sph.materials import find_law

    module = find_law(law)
    name = module.CALIBRATED.name
    return name, next(each.unit for each in module.PARAMETERS if each.name == name)


def show_parameter(law: str) -> tuple[str, str, float]:
    """What people call it, their unit, and the factor from SI to that."""
    name, unit = find_parameter(law)
    label = name if name == "p_m" else name.replace("_", " ")
    return label, *{"Pa": ("kPa", 1e-3), "rad": ("°", 180.0 / math.pi)}.get(unit, (unit, 1.0))


def find_limits(law: str) -> tuple[float, float]:
    """Between what it makes sense, SI."""
    from .sph.materials import find_law

    module = find_law(law)
    return next((each.low, each.high) for each in module.PARAMETERS if each.name == module.CALIBRATED.name)


def name_column(law: str) -> str:
    """What a posterior calls it: ``p_m_Pa``, ``cohesion_Pa``."""
    return "_".join(find_parameter(law))


def read_value(material: Material) -> float:
    """Its value in SI, the law's default where nothing is stated."""
    return read_constant(material, find_parameter(material.law)[0])


def read_constant(material: Material, name: str) -> float:
    """A parameter of the material's law in SI, the law's default where nothing is stated."""
    from .sph.materials import find_law

    if hasattr(material, name):
        return float(getattr(material, name))
    default = next(each.default for each in find_law(material.law).PARAMETERS if each.name == name)
    return float(dict(material.constants).get(name, default))


def set_value(material: Material, value: float) -> Material:
    """The material with another value of it (SI)."""
    name, _ = find_parameter(material.law)
    if hasattr(material, name):
        return material.replace(**{name: value})
    return material.replace(constants=tuple((dict(material.constants) | {name: value}).items()))


def scale_value(material: Material, factor: float) -> Material:
    """The material with a multiple of it."""
    return set_value(material, read_value(material) * factor)


def say_law(law: str) -> str:
    """The law's name as people say it."""
    return Path(law).stem.replace("_", " ")
