"""Pictures of one simulated drop: its motion, and where the dust went. Records in, PNG files out; mm and ms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from ..records import FloatArray
from ..sph import DropRun, DropSetting
from ..sph.profile import outline
from ..sph.tips import make_profile
from .look import BLUE, GREY, INK, PHI, new_figure


def draw_run(run: DropRun, path: Path) -> Path:
    """Depth, velocity and force of one run, and where the dust went."""
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
            f"{setting.projectile.tip} R {setting.projectile.tip_radius * 1e3:g} mm at {setting.impact_speed:g} m/s, "
            f"p_m {setting.material.p_m / 1e3:.3g} kPa: depth {run.penetration_depth * 1e3:.3f} mm, "
            f"T_s {run.stopping_time * 1e3:.2f} ms"
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
            title or f"at the stop, {run.stopping_time * 1e3:.2f} ms",
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
    drawn = axes.pcolormesh(columns * 1e3, rows * 1e3, field, **PHI, rasterized=True)
    x, y = outline(make_profile(setting.projectile), max(2.0 * radius + depth, 2.0 * radius))
    x, y = np.concatenate([-x[::-1], x]), np.concatenate([y[::-1], y]) - depth
    axes.fill(x * 1e3, y * 1e3, facecolor="#DDDDDD", edgecolor=INK, lw=1.2)
    axes.axhline(0.0, color=INK, lw=0.6, ls=":")
    axes.set(aspect="equal", xlabel="mm", ylabel="height above the undisturbed surface (mm)")
    axes.set_xlim(-half * 1e3, half * 1e3)
    axes.set_ylim(-deep * 1e3, 1.2 * radius * 1e3)
    figure.colorbar(drawn, ax=axes, label="volume filling factor φ", extend="both", shrink=0.85)
    axes.set_title(
        f"{2e3 * radius:g} mm at {setting.impact_speed:g} m/s, p_m {setting.material.p_m / 1e3:.2f} kPa, {when}"
    )
