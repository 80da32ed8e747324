"""A drop, a video or a table becomes a track and its curve: the one road of ``labsim.track`` and of the command line.

``read_request`` gathers what is stated and opens the record, ``measure`` follows the projectile, takes from the picture what was
not stated, and fits. A video gives its track also where no curve can be made of it; a table has nothing else to give.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from . import video
from .campaign import read_drop
from .errors import MeasurementError
from .records import Camera, DecelerationCurve, Drop, Measured, Track
from .tracks import Points, find_format, place_points, read_points
from .video.projectile.following import Progress

NOMINAL_PIXEL = (
    1e-5  # m, of the rows that stand for a table of lengths without a camera; the surface is its row 0
)
SURFACE_SIGMA = 0.15  # px, of a surface row that is stated without an error


@dataclass
class Request:
    """What is known about one drop; None where the file or the picture must tell.

    points : name and content of a table; frames : of a video; scale_source : "stated", "ruler", "rod diameter" or "table";
    scales : every pixel size (m) that was measured, by its source. region, left_out : as in ``Record``.
    """

    source: Path
    drop: Drop | None = None
    frame_rate: float | None = None
    pixel_size: Measured | None = None
    surface: Measured | None = None
    row_sigma: float | None = None
    rod_diameter: Measured | None = None
    points: tuple[str, Points] | None = None
    frames: video.Frames | None = None
    scale_source: str | None = None
    region: tuple[int, int, int, int] | None = None
    left_out: tuple[int, ...] = ()
    scales: dict[str, Measured] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def list_missing(self) -> list[str]:
        """What must be stated before anything can be measured, all of it."""
        missing = []
        if self.points is not None:
            points = self.points[1]
            missing += ["frame_rate"] if self.frame_rate is None and points.time is None else []
            missing += ["pixel_size"] if self.pixel_size is None and points.row is not None else []
            missing += ["surface_row"] if self.surface is None and points.row is not None else []
        elif self.frames is not None and self.frames.stamps is None:
            if self.frame_rate is None and not self.frames.header_rate:
                missing.append("frame_rate")
                # tracked without, but then asked for at the next attempt
                missing += ["pixel_size"] if self.pixel_size is None and self.rod_diameter is None else []
        return missing


@dataclass(frozen=True)
class Tracked:
    """track, and the curve or None with the reason among the track's warnings; seen : what a video told besides."""

    request: Request
    track: Track
    curve: DecelerationCurve | None
    seen: video.Tracking | None


def read_request(
    source: Path | str | Drop,
    *,
    frame_rate: float | None = None,
    pixel_size: Measured | None = None,
    rod_diameter: Measured | None = None,
    ruler: tuple[Path, float] | None = None,
    surface_row: Measured | None = None,
    row_sigma: float | None = None,
    rotate: int = 0,
    frames: tuple[int, int] | None = None,
    columns: Mapping[str, str] | None = None,
    particle: str | None = None,
) -> Request:
    """What the drop and the caller say, and the record opened; units as ``labsim.track`` has them. ruler : its picture, and how
    far its ticks are apart (m).

    Raises MeasurementError, which names everything that is missing at once.
    """
    for key, value in (
        ("frame_rate", frame_rate),
        ("pixel_size", None if pixel_size is None else pixel_size.value),
        ("rod_diameter", None if rod_diameter is None else rod_diameter.value),
        ("row_sigma", row_sigma),
        ("ruler_step", None if ruler is None else ruler[1]),
    ):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise MeasurementError("command line", key, f"{value:g} is not a positive number")
    drop = _find_drop(source)
    request = Request(
        source=Path(source) if not isinstance(source, Drop) else Path(),
        drop=drop,
        frame_rate=frame_rate,
        pixel_size=pixel_size,
        surface=surface_row,
        row_sigma=row_sigma,
        rod_diameter=rod_diameter,
        scale_source=None if pixel_size is None else "stated",
    )
    if drop is not None:
        if drop.camera is None or drop.record.path is None:
            holds = (
                "published figures hold" if drop.record.kind == "summary" else "the record of a sensor holds"
            )
            raise MeasurementError(
                drop.name,
                "record.kind",
                f"is {drop.record.kind}: {holds} nothing to track; labsim check says what there is",
            )
        camera = drop.camera
        request.source = drop.record.path
        request.frame_rate = frame_rate or camera.frame_rate
        request.pixel_size = pixel_size or Measured(camera.pixel_size, 0.0)
        request.surface = surface_row or Measured(camera.surface_row, camera.surface_row_sigma)
        request.row_sigma = row_sigma or drop.record.row_sigma
        request.scale_source = "stated"
        request.region, request.left_out = drop.record.region, drop.record.left_out
    if not request.source.exists():
        raise MeasurementError(
            request.source, "DROP", "does not exist; name a drop folder, a video or a track.csv"
        )
    if not (request.source.is_file() or request.source.is_dir()):
        raise MeasurementError(
            request.source, "DROP", "is no plain file and no folder; name a copy of the record"
        )
    if ruler is not None:
        _take_ruler(request, *ruler)
    if find_format(request.source) is not None:
        request.points = read_points(request.source, particle, columns)
    else:
        for key, stated in (("columns", columns is not None), ("particle", particle is not None)):
            if stated:
                raise MeasurementError(request.source, key, "is for tables; leave it out")
        request.frames = video.open_frames(request.source).turned(rotate)
        if frames is not None:
            request.frames = request.frames.section(*frames)
            there = set(request.frames.numbers.tolist())
            request.left_out = tuple(number for number in request.left_out if number in there)
    if missing := request.list_missing():
        are = "is not in the file; state it" if len(missing) == 1 else "are not in the file; state them all"
        raise MeasurementError(request.source, ", ".join(missing), are)
    return request


def _find_drop(source: Path | str | Drop) -> Drop | None:
    if isinstance(source, Drop):
        return source
    path = Path(source)
    if path.name == "drop.toml" or (path.is_dir() and (path / "drop.toml").is_file()):
        return read_drop(path)
    return None


def measure(request: Request, progress: Progress | None = None) -> Tracked:
    """Follow or read, and fit. Raises MeasurementError where nothing can be tracked."""
    seen: video.Tracking | None = None
    if request.points is not None:
        found = _read_table(request)
    else:
        assert request.frames is not None
        seen = video.follow_projectile(
            request.frames,
            frame_rate=request.frame_rate,
            surface_row=request.surface.value if request.surface else None,
            region=request.region,
            left_out=request.left_out,
            progress=progress,
        )
        found = seen.track
        _take_from_video(request, seen)
    curve = _fit(request, found, followed=seen is not None)
    if curve is None:
        found = replace(found, warnings=tuple(dict.fromkeys((*found.warnings, *request.warnings))))
    else:
        curve = replace(curve, warnings=tuple(dict.fromkeys((*curve.warnings, *request.warnings))))
    return Tracked(request, found, curve, seen)


def _read_table(request: Request) -> Track:
    assert request.points is not None
    name, points = request.points
    if points.row is None and (request.pixel_size is None or request.surface is None):
        request.scale_source = "stated" if request.pixel_size else "table"
        request.pixel_size = request.pixel_size or Measured(NOMINAL_PIXEL, 0.0)
        request.surface = request.surface or Measured(0.0, SURFACE_SIGMA)
        request.warnings.append(
            f"the table gives lengths: as rows, 1 px is {1e6 * request.pixel_size.value:g} µm and the surface is row "
            f"{request.surface.value:g} ± {request.surface.sigma:g}"
        )
    assert request.pixel_size is not None and request.surface is not None
    camera = Camera(
        request.frame_rate or float("nan"),
        request.pixel_size.value,
        request.surface.value,
        request.surface.sigma,
    )
    return video.make_track(
        request.source,
        place_points(request.source, name, points, camera),
        request.row_sigma,
        request.left_out,
    )


def _take_ruler(request: Request, picture: Path, step: float) -> None:
    """Pixel size from the picture of a ruler with ticks every ``step`` (m)."""
    frames = video.open_frames(picture) if picture.is_dir() or picture.suffix.lower() != ".png" else None
    image = next(iter(frames)) if frames is not None else video.read_picture(picture)
    measured, warnings = video.measure_ruler(image, step, name=picture)
    request.warnings.extend(warnings)
    _take_scale(request, measured, "ruler")


def _take_from_video(request: Request, seen: video.Tracking) -> None:
    """Scale and surface that the picture itself knows, used where nothing was stated, compared where it was."""
    if (diameter := request.rod_diameter) is not None:
        if seen.diameter is None:
            request.warnings.append(
                "the rod's sides are not seen well enough to take the scale from its diameter"
            )
        else:
            measured = video.scale_from_diameter(diameter.value, diameter.sigma, seen.diameter)
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
