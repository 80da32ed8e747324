"""``labsim track``: a video, pictures or rows become a deceleration curve."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..errors import LabsimError, MeasurementError
from ..records import Measured
from ..tracking import SURFACE_SIGMA, Request, measure, read_request
from ..tracks.table import read_mapping
from . import options
from ._many import Item, finish_many, measure_many
from ._track_output import draw_failure, summarise, tell, tell_shortly, write_files

# what ``labsim.track`` calls it -> what the command line does
OPTIONS = {
    "frame_rate": "--fps",
    "pixel_size": "--pixel-um",
    "surface_row": "--surface-row",
    "row_sigma": "--row-sigma",
    "rod_diameter": "--rod-diameter-mm",
    "ruler_step": "--ruler-step-mm",
    "columns": "--columns",
    "particle": "--particle",
}
SEEN = "seen.png"  # of a record that could not be measured


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
        float | None, typer.Option("--ruler-step-mm", help="Distance of the ruler's ticks. Default: 1.")
    ] = None,
    surface_row: Annotated[
        float | None,
        typer.Option("--surface-row", help="Row of the undisturbed surface (px). Default: found."),
    ] = None,
    surface_row_sigma: Annotated[
        float | None, typer.Option("--surface-row-sigma", min=0.0, help="Its uncertainty. Default: 0.15.")
    ] = None,
    row_sigma: Annotated[
        float | None,
        typer.Option("--row-sigma", help="Uncertainty of a row of a track.csv (px). Default: measured."),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns", help="What a table's columns are: frame=Frame,row=Y or time_ms=t,depth_mm=z."
        ),
    ] = None,
    particle: Annotated[
        str | None,
        typer.Option("--particle", help="Name of the track, where a table or project holds several."),
    ] = None,
    rotate: Annotated[
        int, typer.Option("--rotate", help="Turn the picture anticlockwise: 90, 180, 270.")
    ] = 0,
    part: Annotated[
        str | None, typer.Option("--frames", help="FIRST-LAST: use only these pictures of the video.")
    ] = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    pictures: options.Pictures = None,
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
        "columns": columns,
        "particle": particle,
        "rotate": rotate,
        "part": part,
    }
    if (drop / "campaign.toml").is_file():
        for name, value in (("--ruler", ruler), ("--columns", columns), ("--particle", particle)):
            if value is not None:
                raise LabsimError("command line", name, "belongs to one drop; name its folder or file")
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
    request = ask(drop, given)  # before a folder is made
    folder = options.make_output_folder(out, drop, "track")
    with options.show_progress(quiet) as progress:
        try:
            summary, lines = _track(request, folder, progress)
        except MeasurementError as trouble:
            more = f"; {folder / SEEN} shows what was seen" if (folder / SEEN).is_file() else ""
            raise MeasurementError(trouble.where, trouble.key, trouble.message + more) from None
    options.finish(summary, lines, as_json=as_json, quiet=quiet, folder=folder)


def track_one(
    source: Path, folder: Path, given: dict[str, Any], progress: options.Progress | None = None
) -> tuple[dict[str, Any], str]:
    """Files of one drop; its summary and the lines for people."""
    return _track(ask(source, given), folder, progress)


def _track(request: Request, folder: Path, progress: options.Progress | None) -> tuple[dict[str, Any], str]:
    (folder / SEEN).unlink(missing_ok=True)
    try:
        found = measure(request, progress)
    except MeasurementError as trouble:
        draw_failure(request, folder / SEEN, trouble)
        raise
    written = write_files(folder, found)
    summary = summarise(found)
    options.write_json(folder / "drop.json", summary)
    return summary, tell(summary, found.curve, folder, [*written, "drop.json"])


def ask(source: Path, given: dict[str, Any]) -> Request:
    """The options of the command line as ``read_request`` takes them; its complaints in their names."""
    for of, what in (("ruler_step_mm", "ruler"), ("surface_row_sigma", "surface_row")):
        if given[of] is not None and given[what] is None:
            name, option = (f"--{each.replace('_', '-')}" for each in (of, what))
            raise LabsimError("command line", name, f"says more about {option}; give that too")
    step = 1.0 if given["ruler_step_mm"] is None else given["ruler_step_mm"]
    sigma = SURFACE_SIGMA if given["surface_row_sigma"] is None else given["surface_row_sigma"]
    mapping = None
    if given["columns"] is not None:
        try:
            mapping = read_mapping(given["columns"])
        except ValueError as trouble:
            raise LabsimError("command line", "--columns", str(trouble)) from None
    try:
        return read_request(
            source,
            frame_rate=given["fps"],
            pixel_size=_take(given["pixel_um"], given["pixel_um_sigma"], 1e-6),
            rod_diameter=_take(given["rod_diameter_mm"], given["rod_diameter_sigma_mm"], 1e-3),
            ruler=None if given["ruler"] is None else (given["ruler"], 1e-3 * step),
            surface_row=_take(given["surface_row"], sigma, 1.0),
            row_sigma=given["row_sigma"],
            rotate=given["rotate"],
            frames=None if given["part"] is None else read_range(given["part"]),
            columns=mapping,
            particle=given["particle"],
        )
    except MeasurementError as trouble:
        key = ", ".join(OPTIONS.get(name, name) for name in trouble.key.split(", "))
        raise MeasurementError(trouble.where, key, trouble.message) from None


def _take(value: float | None, sigma: float, unit: float) -> Measured | None:
    return None if value is None else Measured(unit * value, unit * sigma)


def read_range(text: str) -> tuple[int, int]:
    first, dash, last = text.partition("-")
    if not (dash and first.strip().isdecimal() and last.strip().isdecimal()):
        raise LabsimError("command line", "--frames", f"{text!r} is no range; write FIRST-LAST, as 118-201")
    return int(first), int(last)
