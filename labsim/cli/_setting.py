"""What ``labsim simulate`` is asked for -> the setting of the drop: defaults, a campaign's drop, options on top of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

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
from ..errors import CampaignError, LabsimError
from ..inference.planar import planar_setting
from ..inference.published import impact_speed
from ..records import STANDARD_GRAVITY, Campaign, Drop, Material, Projectile
from ..sph import DropSetting
from ..tables import Table

COMMAND = "labsim simulate"
GLASS = 2540.0  # kg/m^3, of the default bead


@dataclass(frozen=True)
class Asked:
    """The options, in their units; None where one was not given."""

    geometry: str | None = None
    tip: str | None = None
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
    """The setting, and a line about each effect of --model that acts on the measurement only. Raises LabsimError."""
    read = read_campaign(asked.campaign) if asked.campaign is not None else None
    drop = _choose_drop(read, asked.drop)
    known = list_effects(read)
    model = read_model(asked.model, known) if asked.model is not None else None
    material, phi, density, gravity = _dust(read)
    if model is not None:
        material = material.replace(p_m=model.p_m, **dict(model.material))
    if asked.p_m_pa is not None:
        material = material.replace(p_m=_between("--p-m-Pa", asked.p_m_pa, 1.0, 1e8))
    material = _apply(asked.settings, material)
    if asked.filling_factor is not None:
        phi = _between("--filling-factor", asked.filling_factor, 0.01, 0.74)
    geometry = asked.geometry or (read.geometry if read else "axisymmetric")
    projectile = _choose_projectile(asked, drop, geometry)
    speed = impact_speed(drop, read) if drop and read else 0.65
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


def _choose_projectile(asked: Asked, drop: Drop | None, geometry: str) -> Projectile:
    if asked.tip is not None and (geometry == "planar") != (asked.tip == "cylinder"):
        raise LabsimError(
            COMMAND, "--tip", f"{asked.tip} and {geometry} do not go together; planar is a cylinder"
        )
    tip = asked.tip or (drop.projectile.tip if drop and geometry != "planar" else "hemisphere")
    radius = drop.projectile.tip_radius if drop else 5e-4
    if asked.tip_radius_mm is not None:
        radius = _between("--tip-radius-mm", asked.tip_radius_mm, 0.05, 50.0) * 1e-3
    mass = drop.projectile.mass if drop else GLASS * 4.0 / 3.0 * math.pi * radius**3
    if asked.mass_mg is not None:
        mass = _between("--mass-mg", asked.mass_mg, 1e-3, 1e7) * 1e-6
    return Projectile(tip=tip, tip_radius=radius, mass=mass)  # type: ignore[arg-type]


def _between(option: str, value: float, low: float, high: float) -> float:
    Table(Path(COMMAND), "", {}).check_number(option, value, low, high)
    return value


def _apply(settings: tuple[str, ...], material: Material) -> Material:
    """The material with every ``material.KEY=VALUE``."""
    for setting in settings:
        key, sign, text = setting.partition("=")
        name = key.strip().removeprefix("material.")
        if not sign or not key.strip().startswith("material."):
            raise LabsimError(
                COMMAND,
                "--set",
                f"{setting!r} is not material.KEY=VALUE; write for example material.delta=0.5",
            )
        if name not in MATERIAL_KEYS:
            raise LabsimError(
                COMMAND, f"--set {key}", f"is not a key of [material]; use one of {', '.join(MATERIAL_KEYS)}"
            )
        field, low, high = MATERIAL_KEYS[name]
        try:
            value = float(text)
        except ValueError:
            raise LabsimError(COMMAND, f"--set {key}", f"{text!r} is not a number") from None
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
    """The setting with the model's effects, and a line about each that acts on the measurement only."""
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
    lines = [
        f"{name} acts on what is measured, not on the drop; this run is the true motion without it"
        for name, _ in model.effects
        if not known[name].costs_runs
    ]
    return apply_effects(setting, model.effects, place, known), lines
