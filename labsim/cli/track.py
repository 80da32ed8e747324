"""``labsim track``: a video, a folder of pictures or a table of rows becomes a track and a deceleration curve."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from .. import video
from ..campaign import read_campaign, read_drop
from ..errors import LabsimError, MeasurementError
from ..records import Camera, DecelerationCurve, Drop, Measured, Track
from ..tracks import find_format
from . import options
from ._many import Item, finish_many, measure_many


@dataclass
class Request:
    """What is known before the video is opened; None where the file or the picture must tell."""

    source: Path
    drop: Drop | None
    fps: float | None
    pixel_size: Measured | None
    surface: Measured | None
    row_sigma: float | None
    warnings: list[str]


def track(
    drop: Annotated[
        Path,
        typer.Argument(
            help="Drop folder (with drop.toml), video file, folder of pictures, track.csv, or another program's track."
        ),
    ],
    out: options.Out = None,
    fps: Annotated[float | None, typer.Option("--fps", help="Frames per second of the recording.")] = None,
    pixel_um: Annotated[
        float | None, typer.Option("--pixel-um", help="Pixel size in the plane of the fall.")
    ] = None,
    rod_diameter_mm: Annotated[
        float | None, typer.Option("--rod-diameter-mm", help="Scale from the rod's known diameter.")
    ] = None,
    ruler: Annotated[
        Path | None, typer.Option("--ruler", help="Picture of a ruler in the plane of the fall.")
    ] = None,
    ruler_step_mm: Annotated[
        float, typer.Option("--ruler-step-mm", help="Distance of the ruler's ticks.")
    ] = 1.0,
    surface_row: Annotated[
        float | None,
        typer.Option("--surface-row", help="Row of the undisturbed surface (px). Default: found."),
    ] = None,
    surface_row_sigma: Annotated[
        float, typer.Option("--surface-row-sigma", min=0.0, help="Its uncertainty.")
    ] = 0.15,
    row_sigma: Annotated[
        float | None,
        typer.Option("--row-sigma", help="Uncertainty of a row of a track.csv (px). Default: measured."),
    ] = None,
    rotate: Annotated[
        int, typer.Option("--rotate", help="Turn the picture anticlockwise: 90, 180, 270.")
    ] = 0,
    part: Annotated[
        str | None, typer.Option("--frames", help="FIRST-LAST: use only these pictures of the video.")
    ] = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Follow the projectile and measure contact, impact speed, depth and stopping time."""
    given = {
        "fps": fps,
        "pixel_um": pixel_um,
        "rod_diameter_mm": rod_diameter_mm,
        "ruler": ruler,
        "ruler_step_mm": ruler_step_mm,
        "surface_row": surface_row,
        "surface_row_sigma": surface_row_sigma,
        "row_sigma": row_sigma,
        "rotate": rotate,
        "part": part,
    }
    if (drop / "campaign.toml").is_file():
        if ruler is not None:
            raise LabsimError("command line", "--ruler", "belongs to one drop; name its folder")
        items = [
            Item(each.name, drop / "drops" / each.name, given)
            for each in read_campaign(drop).drops
            if each.record.kind != "summary"
        ]
        if not items:
            raise LabsimError(drop, "record.kind", "is summary in every drop: there is nothing to track")
        folder = options.make_output_folder(out, drop, "track")
        with options.show_progress(quiet) as progress:
            found = measure_many(
                track_one, "drop.json", items, folder, workers=workers, scheduler=scheduler, progress=progress
            )
        finish_many(found, folder / "tracks.json", _tell_shortly, as_json=as_json, quiet=quiet)
        return
    _read_request(drop, given)  # before a folder is made
    folder = options.make_output_folder(out, drop, "track")
    with options.show_progress(quiet) as progress:
        summary, lines = track_one(drop, folder, given, progress)
    options.finish(summary, lines, as_json=as_json, quiet=quiet)


def track_one(
    source: Path, folder: Path, given: dict[str, Any], progress: options.Progress | None = None
) -> tuple[dict[str, Any], str]:
    """Files of one drop; its summary and the lines for people."""
    request = _read_request(source, given)
    if given["ruler"] is not None:
        _take_ruler(request, given["ruler"], 1e-3 * given["ruler_step_mm"])
    seen: video.Tracking | None = None
    frames: video.Frames | None = None
    if _is_track_file(request.source):
        rate = _need(request.fps, request.source, "--fps", "give the frame rate with --fps")
        row = request.surface.value if request.surface else float("nan")
        pixel = request.pixel_size.value if request.pixel_size else float("nan")
        found = video.read_track(request.source, Camera(rate, pixel, row, 0.0), request.row_sigma)
    else:
        frames = video.open_frames(request.source).turned(given["rotate"])
        if given["part"] is not None:
            frames = frames.section(*_read_range(given["part"]))
        seen = video.follow_projectile(
            frames,
            frame_rate=request.fps,
            surface_row=request.surface.value if request.surface else None,
            progress=progress,
        )
        found = seen.track
        _take_from_video(request, seen, given["rod_diameter_mm"])
    curve = _fit(request, found)
    written = _write(folder, request, found, curve, frames, seen)
    summary = _summarise(request, found, curve, seen)
    options.write_json(folder / "drop.json", summary)
    return summary, _tell(summary, curve, folder, [*written, "drop.json"])


def _tell_shortly(name: str, summary: dict[str, Any]) -> str:
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


def _read_request(path: Path, given: dict[str, Any]) -> Request:
    fps, pixel_um, row_sigma = given["fps"], given["pixel_um"], given["row_sigma"]
    surface_row, surface_row_sigma = given["surface_row"], given["surface_row_sigma"]
    if not path.exists():
        raise LabsimError(path, "DROP", "does not exist; name a drop folder, a video or a track.csv")
    for key, value in (("--fps", fps), ("--pixel-um", pixel_um), ("--row-sigma", row_sigma)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise LabsimError("command line", key, f"{value} is not a positive number")
    pixel = None if pixel_um is None else Measured(1e-6 * pixel_um, 0.0)
    surface = None if surface_row is None else Measured(surface_row, surface_row_sigma)
    if (path.is_dir() and (path / "drop.toml").is_file()) or path.name == "drop.toml":
        stated = read_drop(path)
        if stated.record.kind == "summary" or stated.record.path is None or stated.camera is None:
            raise LabsimError(path, "record.kind", "is summary: published figures hold nothing to track")
        camera = stated.camera
        return Request(
            stated.record.path,
            stated,
            fps or camera.frame_rate,
            pixel or Measured(camera.pixel_size, 0.0),
            surface or Measured(camera.surface_row, camera.surface_row_sigma),
            row_sigma or stated.record.row_sigma,
            [],
        )
    return Request(path, None, fps, pixel, surface, row_sigma, [])


def _is_track_file(path: Path) -> bool:
    return path.is_file() and (path.suffix.lower() in {".csv", ".txt"} or find_format(path) is not None)


def _read_range(text: str) -> tuple[int, int]:
    first, dash, last = text.partition("-")
    if not (dash and first.strip().isdigit() and last.strip().isdigit()):
        raise LabsimError("command line", "--frames", f"{text!r} is no range; write FIRST-LAST, as 118-201")
    return int(first), int(last)


def _need(value: Any, where: Path, key: str, remedy: str) -> Any:
    if value is None:
        raise MeasurementError(where, key, f"is not known; {remedy}")
    return value


def _take_ruler(request: Request, picture: Path, step: float) -> None:
    frames = video.open_frames(picture) if picture.is_dir() or picture.suffix.lower() != ".png" else None
    image = next(iter(frames)) if frames is not None else video.read_picture(picture)
    measured, warnings = video.measure_ruler(image, step, name=picture)
    request.warnings.extend(warnings)
    if request.pixel_size is None:
        request.pixel_size = measured
    else:
        _compare_scales(request, measured, "the ruler")


def _take_from_video(request: Request, seen: video.Tracking, rod_diameter_mm: float | None) -> None:
    """Scale and surface that the picture itself knows, used where nothing was stated, compared where it was."""
    if rod_diameter_mm is not None:
        if seen.diameter is None:
            request.warnings.append(
                "the rod's sides are not seen well enough to take the scale from its diameter"
            )
        else:
            measured = video.scale_from_diameter(1e-3 * rod_diameter_mm, 0.0, seen.diameter)
            if request.pixel_size is None:
                request.pixel_size = measured
            else:
                _compare_scales(request, measured, "the rod's diameter")
    if seen.surface is not None:
        if request.surface is None:
            request.surface = seen.surface
        elif abs(seen.surface.value - request.surface.value) > 3 * np.hypot(
            seen.surface.sigma, request.surface.sigma
        ):
            request.warnings.append(
                f"the surface is seen at row {seen.surface.value:.2f} ± {seen.surface.sigma:.2f}, "
                f"stated at {request.surface.value:.2f} ± {request.surface.sigma:.2f}"
            )


def _compare_scales(request: Request, measured: Measured, source: str) -> None:
    stated = request.pixel_size
    assert stated is not None
    if abs(measured.value - stated.value) > 3 * np.hypot(
        measured.sigma, max(stated.sigma, 0.002 * stated.value)
    ):
        request.warnings.append(
            f"{source} gives {1e6 * measured.value:.3f} ± {1e6 * measured.sigma:.3f} µm per pixel, "
            f"stated are {1e6 * stated.value:.3f}"
        )


def _fit(request: Request, found: Track) -> DecelerationCurve | None:
    """The curve, or None with the reason among the warnings where scale or surface are not known."""
    missing = [
        text
        for value, text in (
            (request.pixel_size, "pixel size (--pixel-um, --rod-diameter-mm or --ruler)"),
            (request.surface, "surface row (--surface-row)"),
        )
        if value is None
    ]
    if missing:
        request.warnings.append("no curve: " + " and ".join(missing) + " not known")
        return None
    curve = video.fit_deceleration(found, _camera(request, found), name=request.source)
    if request.drop is not None and request.drop.height is not None and request.drop.height.value > 0:
        doubt = video.check_drop_height(curve, request.drop.height)
        if doubt:
            request.warnings.append(doubt)
    return curve


def _camera(request: Request, found: Track) -> Camera:
    assert request.pixel_size is not None and request.surface is not None
    steps = np.diff(found.time) / np.maximum(np.diff(found.frame), 1)
    return Camera(
        1.0 / float(np.median(steps)), request.pixel_size.value, request.surface.value, request.surface.sigma
    )


def _write(
    folder: Path,
    request: Request,
    found: Track,
    curve: DecelerationCurve | None,
    frames: video.Frames | None,
    seen: video.Tracking | None,
) -> list[str]:
    from ..report import track_figures

    video.write_track(found, folder / "track.csv")
    written = ["track.csv"]
    title = f"{request.drop.name if request.drop else request.source.name}"
    if curve is not None:
        camera = _camera(request, found)
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


def _summarise(
    request: Request, found: Track, curve: DecelerationCurve | None, seen: video.Tracking | None
) -> dict[str, Any]:
    summary: dict[str, Any] = {}
    figures = {
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
    summary["stop_definition"] = (
        "stopping_time_s: first v = 0; stopping_time_2_percent_s: v = 2 % of the impact speed"
    )
    summary["polynomial_degree"] = curve.degree if curve is not None else None
    summary["row_sigma_px"] = float(np.median(found.sigma[found.valid]))
    summary["tilt_rad"] = seen.tilt if seen is not None else None
    summary["edge_difference_px"] = seen.edge_difference if seen is not None else None
    summary["frames"] = len(found.frame)
    summary["frames_rejected"] = int(np.sum(~found.valid)) + (
        int(np.sum(np.isfinite(curve.residual) & ~curve.used)) if curve is not None else 0  # type: ignore[arg-type, operator]
    )
    warnings = [*(curve.warnings if curve is not None else found.warnings), *request.warnings]
    summary["warnings"] = list(dict.fromkeys(warnings))
    return summary


def _tell(summary: dict[str, Any], curve: DecelerationCurve | None, folder: Path, written: list[str]) -> str:
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
                line("apparent gravity", curve.apparent_gravity, 1.0, "m/s² (check of the scales: 9.81)", 2)
            )
    lines += [f"warning: {text}" for text in summary["warnings"]]
    lines.append(f"written to {folder}: {', '.join(written)}")
    return "\n".join(lines)
