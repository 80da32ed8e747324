"""``labsim track``: a video, pictures or rows become a deceleration curve."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .. import video
from ..campaign import read_campaign
from ..errors import LabsimError, MeasurementError
from ..records import Camera, DecelerationCurve, Measured, Track
from . import options
from ._many import Item, finish_many, measure_many
from ._track_output import summarise, tell, tell_shortly, write_files
from ._track_request import (
    Request,
    is_track_file,
    make_camera,
    need,
    read_range,
    read_request,
    take_from_video,
    take_ruler,
)


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
    pixel_um_sigma: Annotated[
        float, typer.Option("--pixel-um-sigma", min=0.0, help="Its uncertainty; it enters the depth's.")
    ] = 0.0,
    rod_diameter_mm: Annotated[
        float | None, typer.Option("--rod-diameter-mm", help="Scale from the rod's or bead's known diameter.")
    ] = None,
    rod_diameter_sigma_mm: Annotated[
        float, typer.Option("--rod-diameter-sigma-mm", min=0.0, help="Its uncertainty.")
    ] = 0.0,
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
        "pixel_um_sigma": pixel_um_sigma,
        "rod_diameter_mm": rod_diameter_mm,
        "rod_diameter_sigma_mm": rod_diameter_sigma_mm,
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
        finish_many(found, folder / "tracks.json", tell_shortly, as_json=as_json, quiet=quiet)
        return
    read_request(drop, given)  # before a folder is made
    folder = options.make_output_folder(out, drop, "track")
    with options.show_progress(quiet) as progress:
        summary, lines = track_one(drop, folder, given, progress)
    options.finish(summary, lines, as_json=as_json, quiet=quiet)


def track_one(
    source: Path, folder: Path, given: dict[str, Any], progress: options.Progress | None = None
) -> tuple[dict[str, Any], str]:
    """Files of one drop; its summary and the lines for people."""
    request, diameter = read_request(source, given), _read_diameter(given)
    if given["ruler"] is not None:
        take_ruler(request, given["ruler"], 1e-3 * given["ruler_step_mm"])
    seen: video.Tracking | None = None
    frames: video.Frames | None = None
    if is_track_file(request.source):
        rate = need(request.fps, request.source, "--fps", "give the frame rate with --fps")
        row = request.surface.value if request.surface else float("nan")
        pixel = request.pixel_size.value if request.pixel_size else float("nan")
        found = video.read_track(request.source, Camera(rate, pixel, row, 0.0), request.row_sigma)
    else:
        frames = video.open_frames(request.source).turned(given["rotate"])
        if given["part"] is not None:
            frames = frames.section(*read_range(given["part"]))
        seen = video.follow_projectile(
            frames,
            frame_rate=request.fps,
            surface_row=request.surface.value if request.surface else None,
            progress=progress,
        )
        found = seen.track
        take_from_video(request, seen, diameter)
    curve = _fit(request, found, followed=seen is not None)
    written = write_files(folder, request, found, curve, frames, seen)
    summary = summarise(request, found, curve, seen)
    options.write_json(folder / "drop.json", summary)
    return summary, tell(summary, curve, folder, [*written, "drop.json"])


def _read_diameter(given: dict[str, Any]) -> Measured | None:
    diameter, sigma = given["rod_diameter_mm"], given["rod_diameter_sigma_mm"]
    if diameter is None:
        return None
    if not diameter > 0:
        raise LabsimError("command line", "--rod-diameter-mm", f"{diameter} is not a positive number")
    return Measured(1e-3 * diameter, 1e-3 * sigma)


def _fit(request: Request, found: Track, *, followed: bool) -> DecelerationCurve | None:
    """The curve, or None with the reason among the warnings: scale or surface not known, or no contact to fit.

    A video that was ``followed`` has given a track, which is worth keeping without a curve; a table has not.
    """
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
    try:
        curve = video.fit_deceleration(found, make_camera(request, found), name=request.source)
    except MeasurementError as trouble:
        if not followed:
            raise
        request.warnings.append(f"no curve, the track alone is written: {trouble.message}")
        return None
    if request.drop is not None and request.drop.height is not None and request.drop.height.value > 0:
        doubt = video.check_drop_height(curve, request.drop.height)
        if doubt:
            request.warnings.append(doubt)
    return curve
