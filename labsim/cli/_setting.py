"""What ``labsim simulate`` is asked for -> the setting of the drop: defaults, a campaign's drop, options on top of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..campaign import read_campaign
from ..campaign_tables import MATERIAL_KEYS
from ..effects import (
    Effect,
    Model,
    apply_effects,
    check_model,
    list_effects,
    list_places,
    read_model,
    reference_campaign,
)
from ..effects.model import apply_material
from ..effects.terms import apply_law, list_terms
from ..errors import CampaignError, LabsimError
from ..inference.published.figures import impact_speed
from ..inference.published.planar import planar_setting
from ..own_keys import DUST, find_name, read_motion, read_own, set_law
from ..records import STANDARD_GRAVITY, Campaign, Drop, Material, Motion, Projectile
from ..sph import DropSetting
from ..sph.tips import find_tip
from ..tables import Table

COMMAND = "labsim simulate"
GLASS = 2540.0  # kg/m^3, of the default bead


@dataclass(frozen=True)
class Asked:
    """The options, in their units; None where one was not given."""

    geometry: str | None = None
    tip: str | None = None
    motion: str | None = None
    law: str | None = None
    tip_radius_mm: float | None = None
    mass_mg: float | None = None
    speed_m_s: float | None = None
    p_m_pa: float | None = None
    filling_factor: float | None = None
    settings: tuple[str, ...] = ()
    model: Path | None = None
    spacing_um: float | None = None
    time_ms: float | None = None
    campaign: Path | None = None
    drop: str | None = None


def make_setting(asked: Asked) -> tuple[DropSetting, list[str]]:
    """The setting, and a line about each effect or term of --model that acts on the measurement only. Raises LabsimError."""
    read = read_campaign(asked.campaign) if asked.campaign is not None else None
    drop = _choose_drop(read, asked.drop)
    known = list_effects(read)
    model = read_model(asked.model, known) if asked.model is not None else None
    material, phi, density, gravity = _dust(read)
    if model is not None:
        material = apply_material(material, model)
    if asked.p_m_pa is not None:
        material = material.replace(p_m=_between("--p-m-Pa", asked.p_m_pa, 1.0, 1e8))
    groups = _group(asked.settings)
    beside = read.folder if read else None
    material = _choose_material(asked, material, groups["material"], beside)
    if asked.filling_factor is not None:
        phi = _between("--filling-factor", asked.filling_factor, 0.01, 0.74)
    geometry = asked.geometry or (read.geometry if read else "axisymmetric")
    projectile = _choose_projectile(asked, drop, geometry, groups["projectile"], beside)
    motion = _choose_motion(asked, drop, groups["motion"], beside)
    speed = impact_speed(drop, read) if drop and read and motion.kind == "free" else 0.65
    if asked.speed_m_s is not None:
        speed = _between("--speed-m-s", asked.speed_m_s, 1e-3, 100.0)
    spacing = None
    if asked.spacing_um is not None:
        spacing = _between("--spacing-um", asked.spacing_um, 1.0, 1e4) * 1e-6
    if geometry == "planar":
        setting = planar_setting(
            projectile,
            speed,
            material,
            filling_factor=phi,
            monomer_density=density,
            gravity=gravity,
            box=read.planar if read else None,
            spacing=spacing,
        )
        if projectile.tip != "cylinder":
            setting = setting.replace(
                projectile=replace(setting.projectile, tip=projectile.tip, shape=projectile.shape)
            )
        if motion != Motion():
            setting = setting.replace(width=None, depth=None)
    else:
        setting = DropSetting(
            projectile=projectile,
            impact_speed=speed,
            material=material,
            filling_factor=phi,
            monomer_density=density,
            gravity=gravity,
            geometry="axisymmetric",
            spacing=spacing or projectile.tip_radius / 8.0,
            depth=None,
        )
    setting = setting.replace(motion=motion)
    if (times := setting.path[0]).size:
        setting = setting.replace(duration=float(times[-1]))
    unseen: list[str] = []
    if model is not None and asked.model is not None:
        setting, unseen = _extend(setting, model, asked.model, read, drop, known)
    if asked.time_ms is not None:
        setting = setting.replace(duration=_between("--time-ms", asked.time_ms, 1e-3, 1e4) * 1e-3)
    return setting, unseen


def _choose_drop(read: Campaign | None, name: str | None) -> Drop | None:
    if read is None:
        if name is not None:
            raise LabsimError(COMMAND, "--drop", f"{name} belongs to a campaign; add --campaign CAMPAIGN")
        return None
    names = [each.name for each in read.drops]
    if name is None:
        raise LabsimError(COMMAND, "--drop", f"is missing; name one of {', '.join(names)}")
    if name not in names:
        raise CampaignError(read.folder, "--drop", f"{name} is not a drop; name one of {', '.join(names)}")
    return read.drops[names.index(name)]


def _dust(read: Campaign | None) -> tuple[Material, float, float, float]:
    """Material, filling factor, density of the monomers, gravity."""
    if read is None:
        return Material(), 0.15, 2000.0, STANDARD_GRAVITY
    return read.material, read.sample.filling_factor, read.sample.monomer_density, read.gravity


def _choose_projectile(
    asked: Asked, drop: Drop | None, geometry: str, given: dict[str, Any], beside: Path | None
) -> Projectile:
    if asked.tip in ("sphere", "cylinder") and (geometry == "planar") != (asked.tip == "cylinder"):
        raise LabsimError(
            COMMAND, "--tip", f"{asked.tip} and {geometry} do not go together; planar is a cylinder"
        )
    tip, shape = "cylinder" if geometry == "planar" else "hemisphere", {}
    if drop and geometry != "planar":
        tip, shape = drop.projectile.tip, dict(drop.projectile.shape)
    if asked.tip is not None:
        tip, shape = find_name(_options("--tip", asked.tip), "--tip", asked.tip, "tips", beside), {}
    if given:
        table = Table(Path(COMMAND), "--set projectile", given)
        shape |= dict(read_own(table, f'tip = "{Path(tip).stem}"', find_tip(tip).PARAMETERS))
        table.close()
    radius = drop.projectile.tip_radius if drop else 5e-4
    if asked.tip_radius_mm is not None:
        radius = _between("--tip-radius-mm", asked.tip_radius_mm, 0.05, 50.0) * 1e-3
    mass = drop.projectile.mass if drop else GLASS * 4.0 / 3.0 * math.pi * radius**3
    if asked.mass_mg is not None:
        mass = _between("--mass-mg", asked.mass_mg, 1e-3, 1e7) * 1e-6
    return Projectile(tip=tip, tip_radius=radius, mass=mass, shape=tuple(shape.items()))


def _choose_motion(asked: Asked, drop: Drop | None, given: dict[str, Any], beside: Path | None) -> Motion:
    motion = drop.motion if drop else Motion()
    if asked.motion is not None or given:
        if asked.motion is None and drop is not None and motion != Motion():
            raise LabsimError(
                COMMAND,
                "--set motion",
                f"{drop.name} states its own [motion]; give --motion too, to replace it",
            )
        table = Table(Path(COMMAND), "--set motion", {"kind": asked.motion or "free", **given})
        motion = read_motion(table, beside)
        table.close()
    if motion.kind != "free" and asked.speed_m_s is not None:
        raise LabsimError(
            COMMAND, "--speed-m-s", "is that of a drop; leave it out, or give --set motion.speed_m_s=VALUE"
        )
    return motion


def _choose_material(
    asked: Asked, material: Material, given: dict[str, Any], beside: Path | None
) -> Material:
    if asked.law is not None:
        law = find_name(_options("--law", asked.law), "--law", asked.law, "materials", beside)
        if law != material.law:
            material = material.replace(law=law, constants=())
    if material.law == DUST:
        return _apply(given, material)
    for option, value in (("--p-m-Pa", asked.p_m_pa), ("--model", asked.model)):
        if value is not None:
            raise LabsimError(
                COMMAND, option, f'is of {DUST}; leave it out with law "{Path(material.law).stem}"'
            )
    table = Table(Path(COMMAND), "--set material", given)
    material = set_law(material, table)
    table.close()
    return material


def _options(option: str, value: str) -> Table:
    return Table(Path(COMMAND), "", {option: value})


def _between(option: str, value: float, low: float, high: float) -> float:
    Table(Path(COMMAND), "", {}).check_number(option, value, low, high)
    return value


def _group(settings: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """What every ``TABLE.KEY=VALUE`` says, by table and key."""
    groups: dict[str, dict[str, Any]] = {"material": {}, "projectile": {}, "motion": {}}
    for setting in settings:
        key, sign, text = setting.partition("=")
        group, dot, name = key.strip().partition(".")
        if not sign or not dot or group not in groups:
            raise LabsimError(
                COMMAND,
                "--set",
                f"{setting!r} is not material.KEY=VALUE; write for example material.delta=0.5, "
                "projectile.half_angle_deg=30 or motion.speed_m_s=0.1",
            )
        if (group, name) == ("motion", "file"):
            groups[group][name] = text
            continue
        try:
            groups[group][name] = float(text)
        except ValueError:
            raise LabsimError(COMMAND, f"--set {key}", f"{text!r} is not a number") from None
    return groups


def _apply(given: dict[str, float], material: Material) -> Material:
    """The dust with every key that is given."""
    for name, value in given.items():
        key = f"material.{name}"
        if name not in MATERIAL_KEYS:
            raise LabsimError(
                COMMAND, f"--set {key}", f"is not a key of [material]; use one of {', '.join(MATERIAL_KEYS)}"
            )
        field, low, high = MATERIAL_KEYS[name]
        material = material.replace(**{field: _between(f"--set {key}", value, low, high)})
    return material


def _extend(
    setting: DropSetting,
    model: Model,
    file: Path,
    read: Campaign | None,
    chosen: Drop | None,
    known: dict[str, Effect],
) -> tuple[DropSetting, list[str]]:
    """The setting with the model's effects and its law, and a line about each part that acts on the measurement only."""
    if read is None or chosen is None:
        usual = reference_campaign()
        drop = replace(usual.drops[0], projectile=setting.projectile)
        read = replace(
            usual, gravity=setting.gravity, geometry=setting.geometry, drops=(drop,) * len(usual.drops)
        )
        place = replace(list_places(read)[drop.name], sequence_fraction=0.0)
    else:
        place = list_places(read)[chosen.name]
    check_model(model, read, known, file)
    seen = [name for name, _ in model.effects if not known[name].affects_simulation]
    seen += [name for name, _ in model.law.terms if list_terms()[name].acts.add is None]
    lines = [
        f"{name} acts on what is measured, not on the drop; this run is the true motion without it"
        for name in seen
    ]
    return apply_law(apply_effects(setting, model.effects, place, known), model.law), lines
