"""Pictures of one simulated drop: its motion, and where the dust went. Records in, PNG files out; mm and ms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from ...records import FloatArray
from ...sph import DropRun, DropSetting
from ...sph.profile import outline
from ...sph.setting import base_area, say_material, say_motion, say_projectile
from ...sph.tips import make_profile
from .style import BLUE, GREY, INK, PHI, new_figure


def draw_run(run: DropRun, path: Path) -> Path:
    """Depth, velocity and force of one drop against time; of a projectile that is led, force and pressure against depth."""
    if run.setting.path[0].size:
        return _draw_push(run, path)
    with new_figure(path, 7.2, 6.4) as figure:
        panels = figure.subplots(3, 1, sharex=True)
        planar = run.setting.geometry == "planar"
        for axes, values, label in zip(
            panels,
            (run.depth * 1e3, run.velocity, run.force),
            ("depth (mm)", "velocity (m/s)", "force (N/m)" if planar else "force (N)"),
            strict=True,
        ):
            axes.plot(run.time * 1e3, values, color=BLUE)
            axes.set_ylabel(label)
            axes.axvline(run.stopping_time * 1e3, color=INK, lw=0.8, ls="--")
        panels[0].invert_yaxis()
        panels[1].axhline(0.0, color=GREY, lw=0.6)
        panels[2].set_xlabel("time since contact (ms)")
        setting = run.setting
        panels[0].set_title(
            f"{say_projectile(setting)} at {say_motion(setting)}, {say_material(setting.material)}\n"
            f"depth {run.penetration_depth * 1e3:.3f} mm, T_s {run.stopping_time * 1e3:.2f} ms",
            fontsize=9,
        )
    return path


def _draw_push(run: DropRun, path: Path) -> Path:
    setting = run.setting
    planar = setting.geometry == "planar"
    area = base_area(setting)
    with new_figure(path, 7.2, 4.4) as figure:
        axes = figure.subplots()
        # time goes along the line: on a way there and back the loop is the work that is lost
        axes.plot(run.depth * 1e3, run.force, color=BLUE)
        axes.axhline(0.0, color=GREY, lw=0.6)
        axes.set(xlabel="depth of the tip (mm)", ylabel="force (N/m)" if planar else "force (N)")
        pressure = axes.secondary_yaxis(
            "right",
            functions=(
                lambda force: np.divide(force, area * 1e3),
                lambda kilo: np.multiply(kilo, area * 1e3),
            ),
        )
        pressure.set_ylabel("force over the tip's largest section (kPa)")
        axes.set_title(
            f"{say_projectile(setting)}, {say_motion(setting)}\n{say_material(setting.material)}", fontsize=9
        )
    return path


def draw_density_field(run: DropRun, path: Path, title: str | None = None) -> Path:
    """Filling factor of every particle at the stop of a run, with the projectile's outline."""
    dust = run.particles
    with new_figure(path, 6.8, 4.4) as figure:
        fill_density_field(
            figure,
            run.setting,
            (dust.r, dust.z, dust.filling_factor),
            run.penetration_depth,
            run.penetration_depth,
            title
            or f"at the {'end' if run.setting.path[0].size else 'stop'}, {run.stopping_time * 1e3:.2f} ms",
        )
    return path


def fill_density_field(
    figure: Figure,
    setting: DropSetting,
    dust: tuple[FloatArray, FloatArray, FloatArray],
    depth: float,
    deepest: float,
    when: str,
) -> None:
    """The field into a figure. dust: r (or x), z in m and filling factor, (n,) each; depth of the tip now and at most."""
    across, z, phi = dust
    radius = setting.projectile.tip_radius
    if setting.geometry == "axisymmetric":
        across, z, phi = np.concatenate([-across, across]), np.tile(z, 2), np.tile(phi, 2)
    half = 4.5 * radius
    deep = deepest + 3.0 * radius
    # each point shows the nearest particle; a spacing away, above the surface half of one, there is no dust
    step = setting.spacing / 3.0
    columns = np.arange(-half, half + step, step)
    rows = np.arange(-deep, 1.2 * radius, step)
    distance, nearest = KDTree(np.column_stack([across, z])).query(
        np.stack(np.meshgrid(columns, rows), axis=-1)
    )
    reach = np.where(rows > 0.0, 0.5, 1.0)[:, None] * setting.spacing
    field = np.where(distance < reach, phi[nearest], np.nan)
    axes = figure.add_subplot()
    scale = PHI
    if setting.material.law != "porous_dust":  # others hardly change their volume, at any filling factor
        scale = {**PHI, "vmin": 0.95 * setting.filling_factor, "vmax": 1.05 * setting.filling_factor}
    drawn = axes.pcolormesh(columns * 1e3, rows * 1e3, field, **scale, rasterized=True)
    x, y = outline(make_profile(setting.projectile), max(2.0 * radius + depth, 2.0 * radius))
    x, y = np.concatenate([-x[::-1], x]), np.concatenate([y[::-1], y]) - depth
    axes.fill(x * 1e3, y * 1e3, facecolor="#DDDDDD", edgecolor=INK, lw=1.2)
    axes.axhline(0.0, color=INK, lw=0.6, ls=":")
    axes.set(aspect="equal", xlabel="mm", ylabel="height above the undisturbed surface (mm)")
    axes.set_xlim(-half * 1e3, half * 1e3)
    axes.set_ylim(-deep * 1e3, 1.2 * radius * 1e3)
    figure.colorbar(drawn, ax=axes, label="volume filling factor φ", extend="both", shrink=0.85)
    axes.set_title(
        f"{say_projectile(setting)}, {say_motion(setting)}\n{say_material(setting.material)}, {when}",
        fontsize=9,
    )
