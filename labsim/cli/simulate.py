"""``labsim simulate``: one drop."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..campaign import MATERIAL_KEYS, read_campaign
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
from ..inference.convergence import extrapolate, refine
from ..inference.planar import planar_setting
from ..inference.published import impact_speed
from ..inference.runs import RunStore, require_runs, write_run_file
from ..records import Campaign, Drop, Material, Projectile
from ..sph import DropRun, DropSetting, check_setting
from ..tables import Table
from . import options

GLASS = 2540.0  # kg/m^3, of the default bead


class Geometry(StrEnum):
    planar = "planar"
    axisymmetric = "axisymmetric"


class Tip(StrEnum):
    hemisphere = "hemisphere"
    sphere = "sphere"
    cylinder = "cylinder"


def simulate(
    out: options.Out = None,
    geometry: Annotated[
        Geometry | None, typer.Option(help="Default: axisymmetric, or the campaign's.")
    ] = None,
    tip: Annotated[
        Tip | None, typer.Option(help="Default: hemisphere; planar runs are of a cylinder.")
    ] = None,
    tip_radius_mm: Annotated[float | None, typer.Option("--tip-radius-mm", help="Default: 0.5.")] = None,
    mass_mg: Annotated[
        float | None,
        typer.Option(
            "--mass-mg",
            help="Default: a glass bead of that radius. Planar: of the round bead that the cylinder stands for.",
        ),
    ] = None,
    speed_m_s: Annotated[float | None, typer.Option("--speed-m-s", help="At contact. Default: 0.65.")] = None,
    p_m_pa: Annotated[
        float | None, typer.Option("--p-m-Pa", help="Default: 1300, or the middle of the campaign's range.")
    ] = None,
    filling_factor: Annotated[float | None, typer.Option("--filling-factor", help="Default: 0.15.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="material.KEY=VALUE, any key of [material] in campaign.toml; repeatable."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="model.toml as labsim diagnose writes it: p_m, material and effects."),
    ] = None,
    spacing_um: Annotated[
        float | None,
        typer.Option("--spacing-um", help="Of the particles. Default: tip radius / 8, planar / 5.5."),
    ] = None,
    spacings: Annotated[
        int | None,
        typer.Option("--spacings", help="Run N spacings from --spacing-um down by √2, and extrapolate."),
    ] = None,
    time_ms: Annotated[
        float | None, typer.Option("--time-ms", help="The run ends here at the latest.")
    ] = None,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="Take the setting from this campaign.")
    ] = None,
    drop: Annotated[str | None, typer.Option("--drop", help="Name of the campaign's drop, as D01.")] = None,
    movie: Annotated[bool, typer.Option("--movie", help="Write run.mp4 too (simulates once more).")] = False,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    store: options.Store = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Simulate one drop: run.h5, curve.csv, run.json, fields/, run.png, field.png."""
    read = read_campaign(campaign) if campaign is not None else None
    chosen = _choose_drop(read, drop)
    material, phi, density, gravity = _dust(read)
    known = list_effects(read)
    extended = read_model(model, known) if model is not None else None
    if extended is not None:
        material = material.replace(p_m=extended.p_m, **dict(extended.material))
    if p_m_pa is not None:
        material = material.replace(p_m=_between("--p-m-Pa", p_m_pa, 1.0, 1e8))
    material = _apply(settings or [], material)
    if filling_factor is not None:
        phi = _between("--filling-factor", filling_factor, 0.01, 0.74)
    shape = geometry.value if geometry else read.geometry if read else "axisymmetric"
    radius = _between("--tip-radius-mm", tip_radius_mm, 0.05, 50.0) * 1e-3 if tip_radius_mm is not None else (
        chosen.projectile.tip_radius if chosen else 5e-4
    )  # fmt: skip
    mass = _between("--mass-mg", mass_mg, 1e-3, 1e7) * 1e-6 if mass_mg is not None else (
        chosen.projectile.mass if chosen else GLASS * 4.0 / 3.0 * math.pi * radius**3
    )  # fmt: skip
    speed = _between("--speed-m-s", speed_m_s, 1e-3, 100.0) if speed_m_s is not None else (
        impact_speed(chosen, read) if chosen and read else 0.65
    )  # fmt: skip
    if (shape == "planar") != (tip is Tip.cylinder) and tip is not None:
        raise LabsimError(
            "labsim simulate", "--tip", f"{tip.value} and {shape} do not go together; planar is a cylinder"
        )
    form = tip.value if tip else chosen.projectile.tip if chosen and shape != "planar" else "hemisphere"
    projectile = Projectile(tip=form, tip_radius=radius, mass=mass)  # type: ignore[arg-type]
    spacing = _between("--spacing-um", spacing_um, 1.0, 1e4) * 1e-6 if spacing_um is not None else None
    if shape == "planar":
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
            spacing=spacing or radius / 8.0,
            depth=None,
        )
    unseen: list[str] = []
    if extended is not None and model is not None:
        setting, unseen = _extend(setting, extended, model, read, chosen, known)
    if time_ms is not None:
        setting = setting.replace(duration=_between("--time-ms", time_ms, 1e-3, 1e4) * 1e-3)
    plan = refine(setting, spacings) if spacings is not None else [setting]
    for each in plan:
        check_setting(each)  # before a folder is made
    source = campaign if campaign is not None else Path.cwd() / "drop"
    folder = options.make_output_folder(out, source, f"simulate-{drop}" if drop else "simulate")
    with options.show_progress(quiet) as progress:
        found = RunStore(store).get_many(plan, workers=workers, scheduler=scheduler, progress=progress)
    runs = require_runs(found)
    summary, lines = write_run(runs, folder)
    if movie:
        from ..report.movie import draw_movie

        draw_movie(min(runs, key=lambda each: each.setting.spacing), folder / "run.mp4")
    lines = "\n".join([lines, *unseen])
    options.finish(summary, f"{lines}\nwritten to {folder}", as_json=as_json, quiet=quiet)


def write_run(runs: list[DropRun], folder: Path) -> tuple[dict, str]:
    """Files of the finest run; with several spacings the extrapolated values and their sigma."""
    from ..report.fields import run_summary, write_curve, write_fields
    from ..report.run_figures import draw_density_field, draw_run

    run = min(runs, key=lambda each: each.setting.spacing)
    write_run_file(folder / "run.h5", run)
    write_curve(run, folder / "curve.csv")
    write_fields(run, folder / "fields")
    draw_run(run, folder / "run.png")
    draw_density_field(run, folder / "field.png")
    summary = run_summary(run)
    depth = f"{run.penetration_depth * 1e3:.4f}"
    stop = f"{run.stopping_time * 1e3:.3f}"
    if len(runs) > 1:
        for key, name in (("penetration_depth_m", "penetration_depth"), ("stopping_time_s", "stopping_time")):
            value = extrapolate(runs, name)
            summary[key], summary[f"{key}_sigma"] = value.value, value.sigma
        summary["spacing_study"] = [
            {
                "spacing_m": each.setting.spacing,
                "penetration_depth_m": each.penetration_depth,
                "stopping_time_s": each.stopping_time,
            }
            for each in runs
        ]
        depth = (
            f"{summary['penetration_depth_m'] * 1e3:.4f} ± {summary['penetration_depth_m_sigma'] * 1e3:.4f}"
        )
        stop = f"{summary['stopping_time_s'] * 1e3:.3f} ± {summary['stopping_time_s_sigma'] * 1e3:.3f}"
    options.write_json(folder / "run.json", summary)
    raw = "raw planar " if run.setting.geometry == "planar" else ""
    lines = [
        f"{raw}depth {depth} mm, stopping time {stop} ms"
        + (f" (extrapolated from {len(runs)} spacings)" if len(runs) > 1 else ""),
        f"{run.particles.r.size} particles, {run.steps} steps, {run.wall:.1f} s, {run.updates_per_s / 1e6:.2f} million "
        f"updates/s; momentum {run.momentum_error:.1e}, energy {run.energy_error:.1e}, artificial viscosity took "
        f"{run.viscous_share:.1%} of the energy",
        *(f"warning: {warning}" for warning in run.warnings),
    ]
    return summary, "\n".join(lines)


def _choose_drop(read: Campaign | None, name: str | None) -> Drop | None:
    if read is None:
        if name is not None:
            raise LabsimError(
                "labsim simulate", "--drop", f"{name} belongs to a campaign; add --campaign CAMPAIGN"
            )
        return None
    names = [each.name for each in read.drops]
    if name is None:
        raise LabsimError("labsim simulate", "--drop", f"is missing; name one of {', '.join(names)}")
    if name not in names:
        raise CampaignError(read.folder, "--drop", f"{name} is not a drop; name one of {', '.join(names)}")
    return read.drops[names.index(name)]


def _dust(read: Campaign | None) -> tuple[Material, float, float, float]:
    if read is None:
        return Material(), 0.15, 2000.0, 9.81
    return read.material, read.sample.filling_factor, read.sample.monomer_density, read.gravity


def _between(option: str, value: float, low: float, high: float) -> float:
    Table(Path("labsim simulate"), "", {}).check_number(option, value, low, high)
    return value


def _apply(settings: list[str], material: Material) -> Material:
    for setting in settings:
        key, sign, text = setting.partition("=")
        name = key.strip().removeprefix("material.")
        if not sign or not key.strip().startswith("material."):
            raise LabsimError("labsim simulate", "--set", f"{setting!r} is not material.KEY=VALUE")
        if name not in MATERIAL_KEYS:
            raise LabsimError(
                "labsim simulate",
                f"--set {key}",
                f"is not a key of [material]; use one of {', '.join(MATERIAL_KEYS)}",
            )
        field, low, high = MATERIAL_KEYS[name]
        try:
            value = float(text)
        except ValueError:
            raise LabsimError("labsim simulate", f"--set {key}", f"{text!r} is not a number") from None
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
