"""``labsim simulate``: one drop or push."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..runs.run_file import write_run_file
from ..runs.store import RunStore, require_runs
from ..sph import DropRun, check_setting, extrapolate, refine
from ..sph.setting import base_area, say_motion, say_projectile
from . import options
from ._setting import Asked, make_setting


class Geometry(StrEnum):
    planar = "planar"
    axisymmetric = "axisymmetric"


def simulate(
    out: options.Out = None,
    geometry: Annotated[
        Geometry | None, typer.Option(help="Default: axisymmetric, or the campaign's.")
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            help="hemisphere, sphere, cone, flat, ogive or a file NAME.py. Default: hemisphere, in the plane cylinder."
        ),
    ] = None,
    motion: Annotated[
        str | None, typer.Option(help="free (a drop), pushed, prescribed or a file NAME.py. Default: free.")
    ] = None,
    law: Annotated[
        str | None, typer.Option(help="Of the material, or a file NAME.py. Default: porous_dust.")
    ] = None,
    tip_radius_mm: Annotated[float | None, typer.Option("--tip-radius-mm", help="Default: 0.5.")] = None,
    mass_mg: Annotated[
        float | None,
        typer.Option(
            "--mass-mg",
            help="Default: a glass bead of that radius. Planar: of the round bead that the cylinder stands for.",
        ),
    ] = None,
    speed_m_s: Annotated[
        float | None, typer.Option("--speed-m-s", help="Of a drop at contact. Default: 0.65.")
    ] = None,
    p_m_pa: Annotated[
        float | None, typer.Option("--p-m-Pa", help="Default: 1300, or the middle of the campaign's range.")
    ] = None,
    filling_factor: Annotated[float | None, typer.Option("--filling-factor", help="Default: 0.15.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="material.KEY=VALUE, projectile.KEY=VALUE or motion.KEY=VALUE: keys of [material] in campaign.toml, the "
            "tip's own in [projectile] and [motion] in drop.toml; repeatable.",
        ),
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
    pictures: options.Pictures = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Simulate one drop or push: run.h5, curve.csv, run.json, fields/, run.png, field.png."""
    setting, unseen = make_setting(
        Asked(
            geometry=geometry and geometry.value,
            tip=tip,
            motion=motion,
            law=law,
            tip_radius_mm=tip_radius_mm,
            mass_mg=mass_mg,
            speed_m_s=speed_m_s,
            p_m_pa=p_m_pa,
            filling_factor=filling_factor,
            settings=tuple(settings or ()),
            model=model,
            spacing_um=spacing_um,
            time_ms=time_ms,
            campaign=campaign,
            drop=drop,
        )
    )
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
        from ..report.figures.movie import draw_movie

        draw_movie(min(runs, key=lambda each: each.setting.spacing), folder / "run.mp4")
    lines = "\n".join([lines, *unseen])
    options.finish(
        summary,
        f"{lines}\nwritten to {options.shorten_path(folder)}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )


def write_run(runs: list[DropRun], folder: Path) -> tuple[dict, str]:
    """Files of the finest run; with several spacings the extrapolated values and their sigma."""
    from ..report.fields import run_summary, write_curve, write_fields
    from ..report.figures.runs import draw_density_field, draw_run

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
            value = extrapolate(
                [each.setting.spacing for each in runs], [getattr(each, name) for each in runs]
            )
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
    raw = "raw planar " if run.setting.geometry == "planar" else ""
    first = f"{raw}depth {depth} mm, stopping time {stop} ms" + (
        f" (extrapolated from {len(runs)} spacings)" if len(runs) > 1 else ""
    )
    if run.setting.path[0].size:
        first = _say_push(run, summary)
    options.write_json(folder / "run.json", summary)
    lines = [
        first,
        f"{run.particles.r.size} particles, {run.steps} steps, {run.wall:.1f} s, {run.updates_per_s / 1e6:.2f} million "
        f"updates/s; momentum off by {abs(run.momentum_error):.0e}, energy by {run.energy_error:+.1%}; artificial viscosity "
        f"took {run.viscous_share:.1%} of the energy",
        *(f"warning: {warning}" for warning in run.warnings),
    ]
    return summary, "\n".join(lines)


def _say_push(run: DropRun, summary: dict) -> str:
    """One line of a projectile that was led; its numbers go into the summary."""
    area = base_area(run.setting)
    last = run.force[run.depth > run.depth.max() - 0.2 * run.setting.projectile.tip_radius].mean()
    unit = "N/m" if run.setting.geometry == "planar" else "N"
    summary["driver_work_J"] = run.energies["driver"]
    summary["force_at_depth_N"] = float(last)
    summary["pressure_at_depth_Pa"] = float(last / area)
    summary["force_max_N"] = float(run.force.max())
    return (
        f"{say_projectile(run.setting)}, {say_motion(run.setting)}: {last:.4g} {unit} over the last fifth of a tip radius, "
        f"{last / area / 1e3:.4g} kPa of its section; largest {run.force.max():.4g} {unit}; "
        f"work of the driver {run.energies['driver']:.4g} J"
    )
