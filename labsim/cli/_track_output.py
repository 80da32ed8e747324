"""What ``labsim track`` writes and says: tables, pictures, drop.json and the lines for people."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import video
from ..errors import LabsimError
from ..records import STANDARD_GRAVITY, DecelerationCurve, Measured, Track
from ..tracking import Request, Tracked, make_camera
from . import options


def write_files(folder: Path, tracked: Tracked) -> list[str]:
    """Tables and pictures; their names."""
    from ..report.figures import tracks as track_figures

    request, found, curve, seen = tracked.request, tracked.track, tracked.curve, tracked.seen
    frames = request.frames

    video.write_track(found, folder / "track.csv")
    written = ["track.csv"]
    if curve is not None and curve.clock is not None:
        found = replace(found, time=curve.clock)  # pictures show the rows where the fit took them
    title = f"{request.drop.name if request.drop else request.source.name}"
    if curve is not None:
        camera = make_camera(request, found)
        video.write_curve(curve, folder / "curve.csv")
        local = video.fit_local_polynomial(found, camera, curve)
        pd.DataFrame(local).to_csv(folder / "curve_local.csv", index=False, float_format="%.8g")
        track_figures.draw_track(found, camera, curve, local, folder / "track.png", title)
        written += ["curve.csv", "curve_local.csv", "track.png"]
    else:
        track_figures.draw_rows(found, folder / "track.png", title)
        written.append("track.png")
    if frames is not None and seen is not None:
        row = request.surface.value if request.surface else None
        video.write_overlay(frames, found, seen.x, row, folder / "overlay.mp4")
        moments = _choose_moments(found, curve)
        sheet = video.draw_contact_sheet(frames, found, seen.x, row, moments)
        zero = curve.contact_time.value if curve is not None else 0.0
        captions = [f"{1e3 * (found.time[i] - zero):+.2f} ms" for i in moments]
        track_figures.draw_frames(sheet, captions, folder / "overlay.png")
        written += ["overlay.mp4", "overlay.png"]
    return written


def _choose_moments(found: Track, curve: DecelerationCurve | None) -> list[int]:
    """Six frames: two in free flight, contact, half way, stop, end."""
    valid = np.flatnonzero(found.valid)
    first, last = int(valid[0]), int(valid[-1])
    if curve is None or not np.isfinite(curve.stopping_time.value):
        return sorted({int(valid[k]) for k in np.linspace(0, len(valid) - 1, 6).round().astype(int)})

    def near(time: float) -> int:
        return int(valid[np.argmin(np.abs(found.time[valid] - time))])

    t0, ts = curve.contact_time.value, curve.stopping_time.value
    return sorted(
        {first, near(0.5 * (found.time[first] + t0)), near(t0), near(t0 + 0.4 * ts), near(t0 + ts), last}
    )


def draw_failure(request: Request, path: Path, trouble: LabsimError) -> None:
    """What was seen of a record that could not be measured, with the reason; nothing where nothing can be shown."""
    from ..report.figures import tracks as track_figures

    if request.frames is not None:
        with suppress(LabsimError):
            track_figures.draw_frames(*video.draw_scene(request.frames), path, trouble.message)
    if request.points is not None:
        _name, points = request.points
        rows = points.row is not None
        position = points.row if rows else points.height
        columns = ("time (s)", points.time) if points.time is not None else ("frame", points.frame)
        surface = request.surface.value if request.surface and rows else 0.0
        track_figures.draw_table(columns, position, surface, path, trouble.message, rows=rows)  # type: ignore[arg-type]


def summarise(tracked: Tracked) -> dict[str, Any]:
    """What drop.json holds."""
    request, found, curve, seen = tracked.request, tracked.track, tracked.curve, tracked.seen
    summary: dict[str, Any] = {}
    figures: dict[str, Any] = {
        "contact_time_s": curve and curve.contact_time,
        "impact_speed_m_s": curve and curve.impact_speed,
        "penetration_depth_m": curve and curve.penetration_depth,
        "stopping_time_s": curve and curve.stopping_time,
        "stopping_time_2_percent_s": curve and curve.stopping_time_2_percent,
        "apparent_gravity_m_s2": curve and curve.apparent_gravity,
        "rebound_speed_m_s": curve and curve.rebound_speed,
        "surface_row_px": request.surface,
        "pixel_size_m": request.pixel_size,
        "rod_length_px": seen and seen.length,
        "rod_diameter_px": seen and seen.diameter,
        "camera_rotation_rad": seen and seen.camera_rotation,
    }
    for key, value in figures.items():
        summary[key] = value.value if value is not None else None
        summary[f"{key}_sigma"] = value.sigma if value is not None else None
    summary["pixel_size_source"] = request.scale_source
    summary["pixel_size_measured_m"] = {
        source: {"value": scale.value, "sigma": scale.sigma} for source, scale in request.scales.items()
    }
    summary["stop_definition"] = (
        "stopping_time_s: first v = 0; stopping_time_2_percent_s: v = 2 % of the impact speed"
    )
    summary["polynomial_degree"] = curve.degree if curve is not None else None
    summary["row_sigma_px"] = float(np.median(found.sigma[found.valid]))
    summary["tilt_rad"] = seen.tilt if seen is not None else None
    summary["edge_difference_px"] = seen.edge_difference if seen is not None else None
    summary["lossy"] = seen.lossy if seen is not None else None
    summary["frames"] = len(found.frame)
    summary["frames_rejected"] = int(np.sum(~found.valid)) + (
        int(np.sum(np.isfinite(curve.residual) & ~curve.used)) if curve is not None else 0  # type: ignore[arg-type, operator]
    )
    summary["warnings"] = list(curve.warnings if curve is not None else found.warnings)
    return summary


def tell(summary: dict[str, Any], curve: DecelerationCurve | None, folder: Path, written: list[str]) -> str:
    """The lines for people."""

    def line(text: str, value: Measured | None, factor: float, unit: str, digits: int) -> str:
        if value is None or not np.isfinite(value.value):
            return f"  {text:<22} unknown"
        return f"  {text:<22} {factor * value.value:.{digits}f} ± {factor * value.sigma:.{digits}f} {unit}"

    lines = [
        f"{summary['frames']} frames, {summary['frames_rejected']} rejected, rows to {summary['row_sigma_px']:.3f} px"
    ]
    if curve is not None:
        lines += [
            line("contact", curve.contact_time, 1e3, "ms on the record's clock", 3),
            line("impact speed", curve.impact_speed, 1.0, "m/s", 4),
            line("penetration depth", curve.penetration_depth, 1e3, "mm", 4),
            line("stopping time (v = 0)", curve.stopping_time, 1e3, "ms", 3),
            line("  (v = 2 %)", curve.stopping_time_2_percent, 1e3, "ms", 3),
        ]
        if curve.rebound_speed is not None:
            lines.append(line("rebound speed", curve.rebound_speed, 1e3, "mm/s", 1))
        if curve.apparent_gravity is not None:
            lines.append(
                line(
                    "apparent gravity",
                    curve.apparent_gravity,
                    1.0,
                    f"m/s² (check of the scales: {STANDARD_GRAVITY})",
                    2,
                )
            )
    if summary["pixel_size_m"] is not None:
        pixel = Measured(summary["pixel_size_m"], summary["pixel_size_m_sigma"])
        source = summary["pixel_size_source"]
        where = source if source == "stated" else f"from the {source}"
        if pixel.sigma > 0.0:
            lines.append(line("pixel size", pixel, 1e6, f"µm ({where}, in the errors above)", 3))
        else:
            lines.append(f"  {'pixel size':22s} {1e6 * pixel.value:.3f} µm ({where}, without an uncertainty)")
    lines += [f"warning: {text}" for text in summary["warnings"]]
    lines.append(f"written to {options.shorten_path(folder)}: {', '.join(written)}")
    return "\n".join(lines)


def tell_shortly(name: str, summary: dict[str, Any]) -> str:
    def pair(key: str, factor: float, unit: str) -> str:
        value, sigma = summary.get(key), summary.get(f"{key}_sigma")
        return (
            "unknown"
            if value is None or sigma is None
            else f"{factor * value:.4f} ± {factor * sigma:.4f} {unit}"
        )

    return (
        f"{name}: {pair('impact_speed_m_s', 1.0, 'm/s')}, depth {pair('penetration_depth_m', 1e3, 'mm')}, "
        f"stop {pair('stopping_time_s', 1e3, 'ms')}, {len(summary['warnings'])} warnings"
    )
