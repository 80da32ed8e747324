"""The extended model as a file: p_m, keys of the material that differ from the nominal ones, effects with their values.

    format = 1

    [material]
    p_m_Pa = 1012.0

    [effects.strength_rate]
    eta = 0.052
    n = 0.5

    [law]
    inertial_drag = 120.0
    force_of_depth = [[0.0, 0.0], [1.0, 80.0], [2.0, 0.0]]

Of another law than the dust's, ``law = "von_mises"`` and what is calibrated of it (``cohesion_Pa``) stand under [material].

Under [law] stand coefficients of terms (effects/terms/), and tables at knots, as ``force_of_depth`` (tip radii, Pa): one for
every place of effects/law_places.py, its name with underscores.

``labsim diagnose`` writes it, ``labsim simulate --model`` and ``labsim calibrate --model`` take it, people may write it.
"""

from __future__ import annotations

import difflib
import itertools
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..calibrated import find_limits, name_column, set_value
from ..campaign_tables import MATERIAL_KEYS
from ..errors import EffectError
from ..own_keys import DUST
from ..records import Campaign, Material
from ..sph import DropSetting
from ..sph.materials import list_laws
from ..text_files import load_toml
from .contract import Effect, Instrument, Place, Values
from .law_places import LAW_PLACES, Knots
from .loading import list_effects
from .terms import Law, apply_law, list_terms, see_term

FORMAT = 1
P_M_RANGE = (1.0, 1.0e8)  # Pa
NO_LAW = Law()


@dataclass(frozen=True)
class Model:
    """p_m in Pa, or what is calibrated of another law (``matter``), SI; effects as (name, values by parameter); material as
    (field of Material, value) besides p_m; law : what stands in the equations beside them."""

    p_m: float
    effects: tuple[tuple[str, Values], ...] = ()
    material: tuple[tuple[str, float], ...] = ()
    law: Law = NO_LAW
    matter: str = DUST


def read_model(path: Path | str, effects: Mapping[str, Effect] | None = None) -> Model:
    """Read a model.toml. effects: what list_effects gives for the campaign; the catalogue if None. Raises EffectError."""
    path = Path(path)
    known = effects if effects is not None else list_effects()
    document = load_toml(path, EffectError, "name a model.toml as labsim diagnose writes it")
    _refuse_others(path, "", document, ("format", "material", "effects", "law"))
    if document.get("format", FORMAT) != FORMAT:
        raise EffectError(
            path, "format", f"{document['format']!r} is not a format this labsim reads; write {FORMAT}"
        )
    material = _table(path, "material", document.get("material", {}))
    matter = material.get("law", DUST)
    if matter not in list_laws():
        raise EffectError(path, "material.law", f"{matter!r} is not a law; use {', '.join(list_laws())}")
    column = name_column(matter)
    _refuse_others(path, "material", material, ("law", column, *(MATERIAL_KEYS if matter == DUST else ())))
    if column not in material:
        raise EffectError(path, f"material.{column}", f"is missing; write {column} = ... under [material]")
    limits = P_M_RANGE if matter == DUST else find_limits(matter)
    p_m = _number(path, f"material.{column}", material[column], *limits)
    fields = tuple(
        (field, _number(path, f"material.{key}", material[key], low, high))
        for key, (field, low, high) in MATERIAL_KEYS.items()
        if key in material
    )
    chosen = []
    for name, values in _table(path, "effects", document.get("effects", {})).items():
        key = f"effects.{name}"
        if name not in known:
            raise EffectError(path, key, f"is not an effect{_guess(name, known)}; labsim effects lists them")
        effect = known[name]
        values = _table(path, key, values)
        _refuse_others(path, key, values, [parameter.name for parameter in effect.parameters])
        for parameter in effect.amplitudes:
            if parameter.name not in values:
                raise EffectError(
                    path,
                    f"{key}.{parameter.name}",
                    f"is missing; write it in {parameter.unit} ({parameter.null:g} is off)",
                )
        chosen.append(
            (
                name,
                {
                    parameter.name: _number(
                        path, f"{key}.{parameter.name}", values[parameter.name], *parameter.limits
                    )
                    for parameter in effect.parameters
                    if parameter.name in values
                },
            )
        )
    law = _read_law(path, _table(path, "law", document.get("law", {})))
    return Model(p_m, tuple(chosen), fields, law, matter)


def _read_law(path: Path, table: Mapping[str, Any]) -> Law:
    known = list_terms()
    places = {place.key: place for place in LAW_PLACES.values() if place.add}
    _refuse_others(path, "law", table, [*places, *known])
    terms = []
    for name, value in table.items():
        if name in known:
            terms.append((name, _number(path, f"law.{name}", value, *known[name].limits)))
    tables = []
    for key in table:
        if key not in places:
            continue
        place = places[key]
        tables.append((place.name, _read_knots(path, f"law.{key}", table[key])))
        for knot, value in tables[-1][1]:
            if value < place.least:
                said = f"{_show(value, place.value_unit)} at {_show(knot, place.unit)} {place.breaks}"
                raise EffectError(path, f"law.{key}", f"{said}; write {place.least:g} or more")
        for (_, before), (knot, after) in itertools.pairwise(tables[-1][1]) if place.rising else ():
            if after < before:
                said = f"falls to {_show(after, place.value_unit)} at {_show(knot, place.unit)}, which pushes along the motion"
                raise EffectError(path, f"law.{key}", f"{said}; write {before:g} or more there")
    return Law(tuple(terms), tuple(tables))


def _show(value: float, unit: str) -> str:
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def _read_knots(path: Path, key: str, value: Any) -> Knots:
    if (
        not isinstance(value, list)
        or len(value) < 2
        or not all(isinstance(k, list) and len(k) == 2 for k in value)
    ):
        raise EffectError(path, key, f"{value!r} is no table; write [[place, value], [place, value], ...]")
    knots = tuple((_number(path, key, x, 0.0, 1e3), _number(path, key, y, -1e6, 1e6)) for x, y in value)
    if any(after <= before for (before, _), (after, _) in itertools.pairwise(knots)):
        raise EffectError(path, key, "has places that do not grow; sort them, each once")
    return knots


def write_model(
    path: Path | str,
    model: Model,
    effects: Mapping[str, Effect] | None = None,
    comments: Sequence[str] = (),
) -> Path:
    """Write a model.toml that read_model gives back exactly; comments stand at its top."""
    path = Path(path)
    known = effects if effects is not None else list_effects()
    keys = {field: key for key, (field, _, _) in MATERIAL_KEYS.items()}
    lines = [f"# {line}" for comment in comments for line in comment.splitlines()]
    lines += [f"format = {FORMAT}", "", "[material]"]
    lines += [f'law = "{model.matter}"'] * (model.matter != DUST)
    lines += [f"{name_column(model.matter)} = {float(model.p_m)!r}"]
    lines += [f"{keys[field]} = {float(value)!r}" for field, value in model.material]
    for name, values in model.effects:
        if name not in known:
            raise EffectError(path, f"effects.{name}", f"is not an effect{_guess(name, known)}")
        effect = known[name]
        lines += ["", f"[effects.{name}]  # {effect.title}"]
        for key, value in values.items():
            lines.append(f"{key} = {float(value)!r}  # {effect.parameter(key).unit}")
    if model.law != NO_LAW:
        lines += ["", "[law]"]
    for name, value in model.law.terms:
        term = list_terms()[name]
        lines.append(f"{name} = {float(value)!r}  # {term.unit}, times {term.formula}: {term.title}")
    for place, knots in model.law.tables:
        rows = ", ".join(f"[{float(x)!r}, {float(y)!r}]" for x, y in knots)
        there = LAW_PLACES[place]
        lines.append(f"{there.key} = [{rows}]  # {there.unit}, {there.value_unit}")
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    os.replace(aside, path)
    return path


def check_model(
    model: Model, campaign: Campaign, effects: Mapping[str, Effect], file: Path | str = "model"
) -> None:
    """Raise EffectError where an effect of the model cannot be at work in this campaign."""
    for name, _ in model.effects:
        if reason := effects[name].applies(campaign):
            raise EffectError(file, f"effects.{name}", f"does not apply here: {reason}; remove it")


def apply_effects(
    setting: DropSetting,
    chosen: Iterable[tuple[str, Values]],
    place: Place,
    effects: Mapping[str, Effect] | None = None,
) -> DropSetting:
    """The drop with the effects that touch it; the geometry changes first, the others in the order given."""
    known = effects if effects is not None else list_effects()
    for name, values in sorted(chosen, key=lambda each: each[0] != "planar_geometry"):
        setting = known[name].apply(setting, values, place)
    return setting


def apply_model(
    setting: DropSetting, model: Model, place: Place, effects: Mapping[str, Effect] | None = None
) -> DropSetting:
    """The drop as the model has it: its p_m and material, then its effects, then its law."""
    material = apply_material(setting.material, model)
    return apply_law(
        apply_effects(setting.replace(material=material), model.effects, place, effects), model.law
    )


def apply_material(material: Material, model: Model) -> Material:
    """The material as the model has it. Raises EffectError where it is another law's."""
    if material.law != model.matter:
        raise EffectError(
            "model",
            "material.law",
            f'is "{model.matter}", what is simulated is "{material.law}"; make them the same',
        )
    return set_value(material, model.p_m).replace(**dict(model.material))


def make_instrument(model: Model, place: Place, effects: Mapping[str, Effect] | None = None) -> Instrument:
    """What the model says of the measurement."""
    known = effects if effects is not None else list_effects()
    instrument = Instrument()
    for name, values in model.effects:
        instrument = known[name].apply_to_instrument(instrument, values, place)
    for name, coefficient in model.law.terms:
        instrument = see_term(instrument, list_terms()[name], coefficient, place)
    return instrument


def _table(path: Path, key: str, values: Any) -> dict[str, Any]:
    if not isinstance(values, dict):
        raise EffectError(path, key, f"{values!r} is not a table; write [{key}] on a line of its own")
    return values


def _number(path: Path, key: str, value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise EffectError(path, key, f"{value!r} is not a finite number; write a plain one")
    if not low <= value <= high:
        raise EffectError(path, key, f"{value:g} is outside {low:.4g} to {high:.4g}; write one between them")
    return float(value)


def _refuse_others(path: Path, table: str, values: Mapping[str, Any], allowed: Iterable[str]) -> None:
    for key in values:
        if key not in (allowed := list(allowed)):
            where = f"{table}.{key}" if table else key
            use = ", ".join(allowed) or "nothing, it has no parameter"
            raise EffectError(path, where, f"is not a key of a model{_guess(key, allowed)}; use {use}")


def _guess(word: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, sorted(known), n=1, cutoff=0.6)
    return f" (did you mean {near[0]}?)" if near else ""
