"""What is known about a drop before and after its video is opened: rate, scale, surface, and where each comes from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .. import video
from ..campaign import read_drop
from ..errors import LabsimError, MeasurementError
from ..records import Camera, Drop, Measured, Track
from ..tracks import find_format


@dataclass
class Request:
    """What is known about one drop; None where the file or the picture must tell.

    scale_source : "stated", "ruler" or "rod diameter"; scales : every pixel size (m) that was measured, by its source.
    """

    source: Path
    drop: Drop | None
    fps: float | None
    pixel_size: Measured | None
    surface: Measured | None
    row_sigma: float | None
    warnings: list[str]
    scale_source: str | None = None
    scales: dict[str, Measured] = field(default_factory=dict)


def read_request(path: Path, given: dict[str, Any]) -> Request:
    """What drop.toml and the command line say. Raises LabsimError."""
    fps, pixel_um, row_sigma = given["fps"], given["pixel_um"], given["row_sigma"]
    surface_row, surface_row_sigma = given["surface_row"], given["surface_row_sigma"]
    if not path.exists():
        raise LabsimError(path, "DROP", "does not exist; name a drop folder, a video or a track.csv")
    for key, value in (("--fps", fps), ("--pixel-um", pixel_um), ("--row-sigma", row_sigma)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise LabsimError("command line", key, f"{value} is not a positive number")
    pixel = None if pixel_um is None else Measured(1e-6 * pixel_um, 1e-6 * given["pixel_um_sigma"])
    stated_by = None if pixel is None else "stated"
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
            "stated",
        )
    return Request(path, None, fps, pixel, surface, row_sigma, [], stated_by)


def is_track_file(path: Path) -> bool:
    return path.is_file() and (path.suffix.lower() in {".csv", ".txt"} or find_format(path) is not None)


def read_range(text: str) -> tuple[int, int]:
    first, dash, last = text.partition("-")
    if not (dash and first.strip().isdigit() and last.strip().isdigit()):
        raise LabsimError("command line", "--frames", f"{text!r} is no range; write FIRST-LAST, as 118-201")
    return int(first), int(last)


def need(value: Any, where: Path, key: str, remedy: str) -> Any:
    if value is None:
        raise MeasurementError(where, key, f"is not known; {remedy}")
    return value


def take_ruler(request: Request, picture: Path, step: float) -> None:
    """Pixel size from the picture of a ruler with ticks every ``step`` (m)."""
    frames = video.open_frames(picture) if picture.is_dir() or picture.suffix.lower() != ".png" else None
    image = next(iter(frames)) if frames is not None else video.read_picture(picture)
    measured, warnings = video.measure_ruler(image, step, name=picture)
    request.warnings.extend(warnings)
    _take_scale(request, measured, "ruler")


def take_from_video(request: Request, seen: video.Tracking, rod_diameter: Measured | None) -> None:
    """Scale and surface that the picture itself knows, used where nothing was stated, compared where it was."""
    if rod_diameter is not None:
        if seen.diameter is None:
            request.warnings.append(
                "the rod's sides are not seen well enough to take the scale from its diameter"
            )
        else:
            measured = video.scale_from_diameter(rod_diameter.value, rod_diameter.sigma, seen.diameter)
            _take_scale(request, measured, "rod diameter")
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


def _take_scale(request: Request, measured: Measured, source: str) -> None:
    """Use a measured pixel size where none was known, else compare it with the one that is."""
    request.scales[source] = measured
    known = request.pixel_size
    if known is None:
        request.pixel_size, request.scale_source = measured, source
        return
    # a stated size comes without an error bar: 0.2 % is what two rulers differ by
    own = max(known.sigma, 0.002 * known.value) if request.scale_source == "stated" else known.sigma
    if abs(measured.value - known.value) > 3 * np.hypot(measured.sigma, own):
        before = "stated are" if request.scale_source == "stated" else f"the {request.scale_source} gave"
        request.warnings.append(
            f"the {source} gives {1e6 * measured.value:.3f} ± {1e6 * measured.sigma:.3f} µm per pixel, "
            f"{before} {1e6 * known.value:.3f}"
        )


def make_camera(request: Request, found: Track) -> Camera:
    """The camera of a track whose scale and surface are known."""
    assert request.pixel_size is not None and request.surface is not None
    steps = np.diff(found.time) / np.maximum(np.diff(found.frame), 1)
    return Camera(
        1.0 / float(np.median(steps)),
        request.pixel_size.value,
        request.surface.value,
        request.surface.sigma,
        request.pixel_size.sigma,
    )
