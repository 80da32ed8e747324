"""A drop on the page: frames with the tip that was found, and the keys of drop.toml that a look can correct."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path
from typing import Any

import numpy as np

from .. import video
from ..campaign import read_drop
from ..errors import LabsimError, MeasurementError
from ..records import STANDARD_GRAVITY, Drop, Measured
from ..tables import Document
from ..tracking import SURFACE_SIGMA, Request, Tracked, measure, read_request
from .record import RecordView, say, take_finite

WAIT = 60.0  # s for a frame that is still being read


class DropView(RecordView):
    """A drop folder with drop.toml, or a video or a folder of pictures alone, whose corrections are then kept nowhere."""

    KIND = "drop"
    KEYS = frozenset(
        {
            "camera.frame_rate_Hz", "camera.pixel_size_um", "camera.surface_row_px", "camera.surface_row_sigma_px",
            "camera.surface_row_px_sigma", "record.frames_left_out", "record.region_px",
        }
    )  # fmt: skip

    def __init__(self, path: Path) -> None:
        file = path / "drop.toml" if path.is_dir() else path
        self.alone = file.name != "drop.toml" or not file.is_file()
        super().__init__(path.name if self.alone else file.parent.name, None if self.alone else file)
        self.path = path
        # the file may have the unit before the word sigma
        camera = (Document.of(file, {}) if self.alone else Document(file)).table("camera", required=False)
        self._sigma_key = "camera." + camera.sigma_key("surface_row_px")
        drop = None if self.alone else read_drop(file)
        if drop is not None and (drop.record.path is None or drop.camera is None):
            raise LabsimError(
                file, "record.kind", f"is {drop.record.kind}: only videos and tracks are shown here"
            )
        pictures = path if drop is None else drop.record.path if drop.record.kind == "video" else None
        self.pictures = None if pictures is None else Pictures(video.open_frames(pictures))

    def describe(self) -> dict[str, Any]:
        values = self._read_alone() if self.alone else self._read_values(self._read_drop())
        fields = [
            {"key": "camera.surface_row_px", "label": "surface row (px)", "digits": 2},
            {"key": self._sigma_key, "label": "its sigma (px)", "digits": 2},
            {"key": "camera.pixel_size_um", "label": "pixel size (µm)", "digits": 4},
            {"key": "camera.frame_rate_Hz", "label": "frame rate (Hz)", "digits": 1},
        ]
        shown = self.pictures
        return {
            "shape": None if shown is None else list(shown.shape),
            "numbers": [] if shown is None else shown.numbers,
            "fields": [{**field, "value": values.get(str(field["key"]))} for field in fields],
            "region": values.get("record.region_px"),
            "left_out": values.get("record.frames_left_out") or [],
        }

    def draw(self, number: int) -> bytes:
        if self.pictures is None:
            raise IndexError(number)
        return self.pictures.read(number)

    def close(self) -> None:
        if self.pictures is not None:
            self.pictures.close()

    def _read_drop(self) -> Drop:
        return read_drop(self.path, given=self.edits.as_given())

    def _read_values(self, drop: Drop) -> dict[str, Any]:
        camera, record = drop.camera, drop.record
        assert camera is not None
        return {
            "camera.frame_rate_Hz": camera.frame_rate,
            "camera.pixel_size_um": round(1e6 * camera.pixel_size, 9),
            "camera.surface_row_px": camera.surface_row,
            self._sigma_key: camera.surface_row_sigma,
            "record.region_px": record.region,
            "record.frames_left_out": record.left_out,
        }

    def _read_alone(self) -> dict[str, Any]:
        """The corrections of a video without drop.toml, checked as those of a drop are."""
        document = Document.of(Path("labsim view"), self.edits.as_given())
        camera, record = (document.table(name, required=False) for name in ("camera", "record"))
        return {
            "camera.frame_rate_Hz": camera.number("frame_rate_Hz", 10.0, 1e7, default=None),
            "camera.pixel_size_um": camera.number("pixel_size_um", 0.1, 2000.0, default=None),
            "camera.surface_row_px": camera.number("surface_row_px", 0.0, 1e5, default=None),
            self._sigma_key: camera.number("surface_row_sigma_px", 0.0, 100.0, default=None),
            "record.region_px": record.numbers("region_px", 0, 1e5, count=4, whole=True),
            "record.frames_left_out": record.numbers("frames_left_out", 0, 1e9, whole=True),
        }

    def _ask(self) -> Request:
        if not self.alone:
            return read_request(self._read_drop())
        values = self._read_alone()
        pixel, surface = values["camera.pixel_size_um"], values["camera.surface_row_px"]
        sigma = values[self._sigma_key]
        request = read_request(
            self.path,
            frame_rate=values["camera.frame_rate_Hz"],
            pixel_size=None if pixel is None else Measured(1e-6 * pixel, 0.0),
            surface_row=None
            if surface is None
            else Measured(surface, SURFACE_SIGMA if sigma is None else sigma),
        )
        request.region = values["record.region_px"]
        request.left_out = values["record.frames_left_out"] or ()
        return request

    def _measure(self) -> dict[str, Any]:
        return show_track(measure(self._ask(), self.tell))


def show_track(tracked: Tracked) -> dict[str, Any]:
    """A track for the page, one entry a frame: rows, columns and sigmas in px, times in s."""
    track, curve, seen = tracked.track, tracked.curve, tracked.seen
    surface = tracked.request.surface
    lines: list[tuple[str, str]] = []
    if curve is not None:
        g = curve.apparent_gravity
        for label, value, factor, unit, digits in (
            ("contact", curve.contact_time, 1e3, "ms", 3),
            ("impact speed", curve.impact_speed, 1.0, "m/s", 4),
            ("penetration depth", curve.penetration_depth, 1e3, "mm", 4),
            ("stopping time", curve.stopping_time, 1e3, "ms", 3),
            (f"apparent gravity ({STANDARD_GRAVITY} expected)", g, 1.0, "m/s²", 2),
        ):
            known = value is not None and np.isfinite(value.value)
            lines.append(
                (label, say(value.value, value.sigma, factor, unit, digits) if known and value else "unknown")
            )
    if surface is not None:
        lines.append(("surface row", say(surface.value, surface.sigma, 1.0, "px", 2)))
    if seen is not None and seen.surface is not None:
        lines.append(("surface as seen", say(seen.surface.value, seen.surface.sigma, 1.0, "px", 2)))
    used = track.valid if curve is None or curve.used is None else curve.used
    return {
        "frame": track.frame.tolist(),
        "time": take_finite(track.time, 7),
        "row": take_finite(track.tip_row, 3),
        "sigma": take_finite(track.sigma, 4),
        "column": take_finite(seen.x, 2) if seen is not None else [None] * len(track.frame),
        "used": np.asarray(used, bool).tolist(),
        "reason": list(track.reason),
        "residual": take_finite(curve.residual, 4)
        if curve is not None and curve.residual is not None
        else None,
        "surface": None if surface is None else [surface.value, surface.sigma],
        "lines": lines,
        "warnings": list(curve.warnings if curve is not None else track.warnings),
    }


class Pictures:
    """The frames of a video as PNG files in a folder of their own: formats are read forwards, people go back and forth."""

    def __init__(self, frames: video.Frames) -> None:
        self.shape = frames.shape
        self.numbers: list[int] = frames.numbers.tolist()
        # goes with this object, at the latest when Python ends
        self._place = tempfile.TemporaryDirectory(prefix="labsim-view-", ignore_cleanup_errors=True)
        self._folder = Path(self._place.name)
        self._ready, self._ended, self._closed = 0, False, False
        self._changed = threading.Condition()
        threading.Thread(target=self._write, args=(frames,), daemon=True).start()

    def read(self, number: int) -> bytes:
        """Waits for a frame that is still to come. Raises IndexError where there is none."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready > number or self._ended, WAIT)
            if not 0 <= number < self._ready:
                raise IndexError(number)
        return (self._folder / f"{number}.png").read_bytes()

    def close(self) -> None:
        self._closed = True
        self._place.cleanup()

    def _write(self, frames: video.Frames) -> None:
        top = None
        try:
            for number, picture in enumerate(frames):
                if self._closed:
                    return
                top = top or video.find_top(picture)
                (self._folder / f"{number}.png").write_bytes(video.encode_picture(picture, top))
                with self._changed:
                    self._ready = number + 1
                    self._changed.notify_all()
        except (MeasurementError, OSError):  # what was read until then is shown; measuring says what is wrong
            pass
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()
