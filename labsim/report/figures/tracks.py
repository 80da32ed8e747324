"""Pictures of one drop: the track on its frames, depth, speed and deceleration with bands, residuals."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np

from ...records import Camera, DecelerationCurve, FloatArray, Track
from .style import BLUE, GREEN, GREY, INK, ORANGE, new_figure


def draw_track(
    track: Track,
    camera: Camera,
    curve: DecelerationCurve,
    local: dict[str, FloatArray],
    path: Path,
    title: str = "",
) -> Path:
    """Depth, speed, deceleration against time from contact, with 1 σ bands, and the residuals of the rows."""
    with new_figure(path, 7.2, 9.0) as figure:
        depth_axes, speed_axes, slowing_axes, residual_axes = figure.subplots(
            4, 1, sharex=True, height_ratios=[1.3, 1, 1, 0.8]
        )
        ms = 1e3 * (track.time - curve.contact_time.value)
        used = curve.used if curve.used is not None else track.valid
        shown = track.valid & (ms <= 1e3 * curve.time[-1] * 1.02)
        depth = 1e3 * (track.tip_row - camera.surface_row) * camera.pixel_size
        before = track.valid & (ms < 0)
        t = 1e3 * curve.time
        depth_axes.axhline(0, color=GREY, lw=0.8)
        depth_axes.plot(ms[shown & used], depth[shown & used], ".", ms=3, color=INK, label="frames", zorder=3)
        _band(depth_axes, t, 1e3 * curve.depth, 1e3 * curve.depth_sigma, "fit, 1 σ")
        left = shown & ~used
        span = max(t[-1], 1e-3)
        low = -1.2 * span
        top = -0.35 * np.nanmax(1e3 * curve.depth)
        if left.any():
            depth_axes.plot(ms[left], depth[left], "x", ms=4, color=ORANGE, label="left out")
        depth_axes.set_ylabel("depth of the tip (mm)")
        depth_axes.set_ylim(1.12 * np.nanmax(1e3 * curve.depth), top)
        depth_axes.legend(loc="lower left")
        if title:
            depth_axes.set_title(title)

        lt = 1e3 * local["time_s"]
        _points(speed_axes, lt, local["velocity_m_s"], local["velocity_sigma_m_s"])
        _band(speed_axes, t, curve.velocity, curve.velocity_sigma, None)
        speed_axes.axhline(0, color=GREY, lw=0.8)
        speed_axes.set_ylabel("speed (m/s)")

        _points(slowing_axes, lt, -local["acceleration_m_s2"], local["acceleration_sigma_m_s2"])
        _band(slowing_axes, t, -curve.acceleration, curve.acceleration_sigma, None)
        peak = float(np.nanmax(np.abs(curve.acceleration)))
        slowing_axes.set_ylim(-0.5 * peak, 1.6 * peak)
        slowing_axes.axhline(0, color=GREY, lw=0.8)
        slowing_axes.set_ylabel("deceleration (m/s²)")
        slowing_axes.plot([], [], ".", color=GREEN, label="local polynomial, 11 frames")
        slowing_axes.legend(loc="upper right")

        if curve.residual is not None:
            residual_axes.axhline(0, color=GREY, lw=0.8)
            residual_axes.errorbar(
                ms[used],
                curve.residual[used],
                track.sigma[used],
                fmt=".",
                ms=3,
                color=INK,
                ecolor=BLUE,
                elinewidth=0.7,
            )
            limit = 1.05 * float(np.nanmax(np.abs(curve.residual[used]) + track.sigma[used])) + 1e-6
            residual_axes.set_ylim(-limit, limit)
        residual_axes.set_ylabel("residual (px)")
        residual_axes.set_xlabel("time from contact (ms)")
        for axes in (depth_axes, speed_axes, slowing_axes, residual_axes):
            axes.axvline(0, color=GREY, lw=0.8, ls=":")
            if np.isfinite(curve.stopping_time.value):
                axes.axvline(1e3 * curve.stopping_time.value, color=ORANGE, lw=1.0, ls="--")
        if np.isfinite(curve.stopping_time.value):
            depth_axes.annotate(
                "first stop",
                (1e3 * curve.stopping_time.value, top),
                xytext=(4, -11),
                textcoords="offset points",
                color=ORANGE,
                fontsize=9,
            )
        residual_axes.set_xlim(max(low, float(ms[before].min()) if before.any() else low), 1.02 * span)
    return path


def draw_rows(track: Track, path: Path, title: str = "") -> Path:
    """Rows against time alone, where there is no scale or no surface to make a curve from."""
    with new_figure(path, 7.2, 4.4) as figure:
        axes = figure.subplots()
        axes.errorbar(
            1e3 * track.time[track.valid],
            track.tip_row[track.valid],
            track.sigma[track.valid],
            fmt=".",
            ms=3,
            color=INK,
            ecolor=BLUE,
        )
        axes.invert_yaxis()
        axes.set_xlabel("time (ms)")
        axes.set_ylabel("row of the tip (px)")
        axes.set_title(title)
    return path


def draw_frames(pictures: list[np.ndarray], captions: list[str], path: Path, title: str = "") -> Path:
    """Contact sheet of frames with the track on them."""
    if not pictures:
        return path
    tall = pictures[0].shape[0] / pictures[0].shape[1]
    columns = len(pictures) if tall > 1.4 else max(1, (len(pictures) + 1) // 2)
    rows = -(-len(pictures) // columns)
    wide = 9.0
    with new_figure(path, wide, rows * (wide / columns * tall + 0.35) + (0.6 if title else 0.0)) as figure:
        if title:
            figure.suptitle(textwrap.fill(title, 110), fontsize=9)
        for k, axes in enumerate(np.ravel(figure.subplots(rows, columns, squeeze=False))):
            axes.axis("off")
            if k < len(pictures):
                axes.imshow(pictures[k])
                axes.set_title(captions[k], fontsize=8.5)
    return path


def draw_table(
    columns: tuple[str, FloatArray],
    position: FloatArray,
    surface: float,
    path: Path,
    title: str,
    *,
    rows: bool,
) -> Path:
    """The two columns of a table of which no motion could be made, and where the surface is said to be.

    columns : name and values of the first; position : rows (px) or heights (m).
    """
    with new_figure(path, 7.2, 4.4) as figure:
        axes = figure.subplots()
        axes.plot(columns[1], position, ".", ms=3, color=INK)
        axes.axhline(surface, color=BLUE, lw=1.0)
        place = (0.01, surface)
        axes.annotate(
            "surface", place, xycoords=("axes fraction", "data"), color=BLUE, fontsize=9, va="bottom"
        )
        axes.set_xlabel(columns[0])
        axes.set_ylabel("row (px)" if rows else "height (m)")
        if rows:
            axes.invert_yaxis()
        axes.set_title(textwrap.fill(title, 90), fontsize=9)
    return path


def _band(axes, t: FloatArray, value: FloatArray, sigma: FloatArray, label: str | None) -> None:
    axes.fill_between(t, value - sigma, value + sigma, color=BLUE, alpha=0.3, lw=0)
    axes.plot(t, value, color=BLUE, label=label)


def _points(axes, t: FloatArray, value: FloatArray, sigma: FloatArray) -> None:
    axes.errorbar(t, value, sigma, fmt=".", ms=3, color=GREEN, elinewidth=0.7, alpha=0.8)
