"""The tables of a campaign's TOML files as records in SI, each value checked; mistakes name file, key, value and remedy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from .errors import CampaignError, LabsimError
from .own_keys import DUST, ROUND, read_law, read_range, read_tip
from .records import Camera, Material, Planar, Projectile, Published, Sample
from .tables import Document, Table

# densities between which a projectile is believed, kg/m^3: a hollow tube up to osmium
LIGHTEST, HEAVIEST = 20.0, 23000.0
STEEL = 7850.0  # kg/m^3, of a ball in place of a tip whose mass plays no part
# key in [material] -> field of Material, and between what it is believed; all but p_m
MATERIAL_KEYS = {
    "phi_1": ("phi_1", 0.0, 0.74),
    "phi_2": ("phi_2", 0.01, 1.0),
    "delta": ("delta", 0.01, 5.0),
    "tensile_log10_a": ("tensile_log10_a", -5.0, 9.0),
    "tensile_log10_b": ("tensile_log10_b", -20.0, 20.0),
    "shear_factor": ("shear_factor", 0.0, 100.0),
    "bulk_modulus_Pa": ("bulk_modulus", 100.0, 1e9),
    "bulk_exponent": ("bulk_exponent", 0.0, 15.0),
    "shear_to_bulk": ("shear_to_bulk", 1e-3, 1.5),
    "contact_friction": ("contact_friction", 0.0, 5.0),
}


def read_sample(table: Table) -> Sample:
    return Sample(
        filling_factor=table.number("filling_factor", 0.01, 0.74),
        filling_factor_sigma=table.number("filling_factor_sigma", 0.0, 0.1),
        monomer_density=table.number("monomer_density_kg_m3", 100.0, 23000.0),
        diameter=table.number("diameter_mm", 1.0, 1e6, unit=1e-3),
        depth=table.number("depth_mm", 0.5, 1e5, unit=1e-3),
        gas_pressure=table.number("gas_pressure_Pa", 0.0, 1e6),
        scatter=table.number("scatter", 0.0, 1.0) if table.has("scatter") else None,
    )


def read_material(
    table: Table, sample: Sample, folder: Path | None = None
) -> tuple[Material, str, tuple[float, float]]:
    """Material, the parameter of its law that is calibrated, and the range of that, SI. folder : of the campaign."""
    if table.text("law", DUST) != DUST:
        return read_law(table, folder)
    low, high = read_range(table, "p_m_range_Pa", 1.0, 1e8)
    material = Material(
        p_m=math.sqrt(low * high),
        **{field: table.number(key, least, most) for key, (field, least, most) in MATERIAL_KEYS.items()},
    )
    if material.phi_2 <= material.phi_1:
        raise table.wrong("phi_2", f"{material.phi_2:g} is not above phi_1 = {material.phi_1:g}; raise it")
    phi = sample.filling_factor
    where = CampaignError(table.file, "sample.filling_factor", "")
    if phi >= material.phi_2:
        raise CampaignError(
            where.where,
            where.key,
            f"{phi:g} is not below material.phi_2 = {material.phi_2:g}, where Σ diverges; lower it",
        )
    if phi <= material.phi_1:
        raise CampaignError(
            where.where,
            where.key,
            f"{phi:g} is not above material.phi_1 = {material.phi_1:g}, where Σ vanishes; raise it",
        )
    return material, "p_m", (low, high)


def read_planar(table: Table) -> Planar:
    default = Planar()
    names = table.get("calibration_drops", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise table.wrong("calibration_drops", f'{names!r} is not a list of drop names; write ["D01"]')
    return Planar(
        depth_reading=table.choice(
            "depth_reading", ("multiply_exp", "multiply_sim", "none"), default.depth_reading
        ),  # type: ignore[arg-type]
        calibration_drops=tuple(names),
        box_width=table.number("box_width_mm", 1.0, 500.0, unit=1e-3, default=default.box_width),
        box_depth=table.number("box_depth_mm", 1.0, 500.0, unit=1e-3, default=default.box_depth),
        box_radius=table.number("box_radius_mm", 0.05, 50.0, unit=1e-3, default=default.box_radius),
    )


def read_projectile(table: Table, folder: Path | None = None, *, led: bool = False) -> Projectile:
    """folder : of the campaign, whose ``tips/`` may hold the tip. led : by a driver, so that its mass may be left out."""
    sigma = table.sigma_key("mass_mg")
    if led and not table.has("mass_mg"):
        table.known.add("mass_mg")
        tip, shape = read_tip(table, ("tip_radius_mm", "tip_radius_sigma_mm", "length_mm"), folder)
        radius, radius_sigma = _read_radius(table)
        length = table.number("length_mm", 0.1, 1e5, unit=1e-3, default=0.0)
        mass = STEEL * 4 / 3 * math.pi * radius**3
        return Projectile(tip, radius, mass, length=length, radius_sigma=radius_sigma, shape=shape)
    keys = ("tip_radius_mm", "tip_radius_sigma_mm", "length_mm", "mass_mg", sigma)
    tip, shape = read_tip(table, keys, folder)
    radius, radius_sigma = _read_radius(table)
    projectile = Projectile(
        tip=tip,
        shape=shape,
        tip_radius=radius,
        length=table.number("length_mm", 0.1, 500.0, unit=1e-3, default=0.0),
        mass=table.number("mass_mg", 1e-3, 1e7, unit=1e-6),
        mass_sigma=table.number(sigma, 0.0, 1e6, unit=1e-6, default=0.0),
        radius_sigma=radius_sigma,
    )
    _check_density(table, projectile)
    if projectile.mass_sigma >= projectile.mass:
        raise table.wrong(
            "mass_sigma_mg", f"{projectile.mass_sigma * 1e6:g} is not below mass_mg; check the unit"
        )
    if tip != "sphere" and 0.0 < projectile.length < projectile.tip_radius:
        raise table.wrong(
            "length_mm", f"{projectile.length * 1e3:g} is shorter than the tip's radius; give the whole rod"
        )
    return projectile


def _read_radius(table: Table) -> tuple[float, float]:
    """Of a tip, m, with its standard deviation."""
    radius = table.number("tip_radius_mm", 0.05, 50.0, unit=1e-3)
    sigma = table.number("tip_radius_sigma_mm", 0.0, 50.0, unit=1e-3, default=0.0)
    if sigma >= radius:
        raise table.wrong(
            "tip_radius_sigma_mm", f"{sigma * 1e3:g} is not below tip_radius_mm; check the unit"
        )
    return radius, sigma


def read_bead(table: Table) -> Projectile:
    table.choice("shape", ("sphere",))
    bead = Projectile(
        tip="sphere",
        tip_radius=table.number("radius_mm", 0.05, 50.0, unit=1e-3),
        mass=table.number("mass_mg", 1e-3, 1e7, unit=1e-6),
    )
    _check_density(table, bead)
    return bead


def _check_density(table: Table, projectile: Projectile) -> None:
    """Mass and size must make a body that exists: this finds a unit off by a thousand in either."""
    radius, length = projectile.tip_radius, projectile.length
    volume = 4.0 / 3.0 * math.pi * radius**3
    if projectile.tip not in ROUND:
        from .sph.profile import has_shaft, volume_below
        from .sph.tips import make_profile

        try:
            profile = make_profile(projectile)
        except LabsimError as trouble:
            raise CampaignError(table.file, trouble.key, trouble.message) from None
        if length == 0.0 and has_shaft(profile):
            return
        volume = volume_below(profile, length or math.inf)
    elif projectile.tip == "hemisphere":
        if length == 0.0:
            return  # a rod of unknown length
        volume = volume / 2.0 + math.pi * radius**2 * max(length - radius, 0.0)
    density = projectile.mass / volume
    if not LIGHTEST <= density <= HEAVIEST:
        raise table.wrong(
            "mass_mg",
            f"{projectile.mass * 1e6:g} in this size is a density of {density:.3g} kg/m³, outside {LIGHTEST:g} to "
            f"{HEAVIEST:g}; check the units of mass and radius",
        )


def read_camera(table: Table) -> Camera:
    return Camera(
        frame_rate=table.number("frame_rate_Hz", 10.0, 1e7),
        pixel_size=table.number("pixel_size_um", 0.1, 2000.0, unit=1e-6),
        surface_row=table.number("surface_row_px", 0.0, 1e5),
        surface_row_sigma=table.number(table.sigma_key("surface_row_px"), 0.0, 100.0, default=0.0),
    )


def read_published(table: Table, height_known: bool) -> Published:
    published = Published(
        penetration_depth=table.measured("penetration_depth_mm", 1e-4, 500.0, unit=1e-3, required=False),
        stopping_time=table.measured("stopping_time_ms", 1e-3, 1e4, unit=1e-3, required=False),
        impact_speed=table.measured("impact_speed_m_s", 1e-3, 100.0, required=not height_known),
    )
    if published.penetration_depth is None and published.stopping_time is None:
        raise table.wrong(
            "penetration_depth_mm", "and stopping_time_ms are both missing; give at least one of them"
        )
    return published


def read_source(document: Document) -> dict[str, Any]:
    """[source]: free text, one key a figure, kept as written."""
    table = document.table("source", required=False)
    return {key: table.text(key) for key in table.values}


def find_toml(path: Path, name: str) -> Path:
    if not path.exists():
        raise CampaignError(path, "", f"no such file or folder; give a folder that holds {name}")
    return path / name if path.is_dir() else path


def list_parts(folder: Path, name: str) -> list[Path]:
    """Sub-folders in the order of their names; each must hold the TOML file."""
    if not folder.is_dir():
        return []
    parts = sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith((".", "__")))
    for part in parts:
        if not (part / name).is_file():
            raise CampaignError(part, name, "is missing in this folder; add it or remove the folder")
    return parts
