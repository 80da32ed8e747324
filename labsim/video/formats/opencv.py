"""AVI, MP4, MOV and MKV through OpenCV: 8 bit only."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from ...errors import MeasurementError
from ..frames import Frames

NAME = "AVI, MP4, MOV, MKV (8 bit)"
SUFFIXES = {".avi", ".mp4", ".mov", ".mkv", ".m4v"}
LOSSLESS = {
    "ffv1",
    "hfyu",
    "ffvh",
    "dib ",
    "y800",
    "grey",
    "raw ",
    "\0\0\0\0",
    "png ",
    "mpng",
    "bgr\0",
    "iyuv",
}
BETWEEN = {
    "xvid",
    "mp4v",
    "divx",
    "h264",
    "avc1",
    "x264",
    "hevc",
    "hev1",
    "hvc1",
    "fmp4",
    "mpg4",
    "mp42",
    "vp80",
    "vp90",
}


def recognises(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in SUFFIXES


def open_file(path: Path) -> Frames:
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    video = _open(path)
    count = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    rate = float(video.get(cv2.CAP_PROP_FPS))
    codec = int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode("latin-1").lower()
    ok, picture = video.read()
    video.release()
    if not ok or picture is None:
        raise MeasurementError(
            path, "video", f"no frame can be read (codec {codec!r}); export it as FFV1 or MJPEG AVI"
        )
    if picture.dtype != np.uint8:
        raise MeasurementError(path, "video", "holds more than 8 bit; export it as 16-bit TIFF or .cine")
    if count < 1 or count > 10_000_000:
        count = sum(1 for _ in _read(path))
    warnings = []
    lossy = codec not in LOSSLESS
    if codec in BETWEEN:
        warnings.append(
            f"{codec.upper()} stores differences between frames, which then err alike; record MJPEG or raw"
        )
    elif codec == "mjpg":
        quality = _estimate_quality(path)
        if quality is not None and quality < 60:
            warnings.append(
                f"MJPEG quality about {quality}: compression costs accuracy; record at 90 or above"
            )
    shades = picture.reshape(-1, picture.shape[-1]).astype(np.int16) if picture.ndim == 3 else None
    if shades is not None and np.mean(np.ptp(shades, axis=1)) > 6:
        warnings.append("colour video: turned into grey")
    stamps = _read_stamps(path) if rate > 0 and codec in BETWEEN else None
    if stamps is not None and len(stamps) > 3:
        steps = np.diff(stamps)
        if np.ptp(steps) > 0.02 * np.median(steps):
            warnings.append(
                f"variable frame rate: container steps of {1e3 * steps.min():.1f} to {1e3 * steps.max():.1f} ms; "
                "an even clock is used"
            )
        count = len(stamps)
    return Frames(
        path=path,
        start=lambda: _read(path),
        count=count,
        shape=picture.shape[:2],
        bits=8,
        numbers=np.arange(count),
        header_rate=rate if rate > 0 else None,
        lossy=lossy,
        codec=codec,
        warnings=warnings,
    )


def _open(path: Path) -> cv2.VideoCapture:
    try:
        video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    except cv2.error as trouble:
        raise MeasurementError(path, "video", f"cannot be opened ({trouble.err})") from None
    if not video.isOpened():
        raise MeasurementError(
            path, "video", "is no video that can be decoded; export it as FFV1 or MJPEG AVI"
        )
    return video


def _read(path: Path) -> Iterator[np.ndarray]:
    video = _open(path)
    try:
        while True:
            try:
                ok, picture = video.read()
            except cv2.error:
                return
            if not ok or picture is None:
                return
            yield picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    finally:
        video.release()


def _read_stamps(path: Path) -> np.ndarray | None:
    """Container time of each frame (s), read after each grab; None where they do not grow."""
    video = _open(path)
    stamps = []
    while video.grab():
        stamps.append(1e-3 * video.get(cv2.CAP_PROP_POS_MSEC))
    video.release()
    times = np.array(stamps)
    return times if len(times) > 1 and np.all(np.diff(times) > 0) else None


def _estimate_quality(path: Path) -> int | None:
    """Quality 1-100 of the first JPEG, from its luminance table against that of the JPEG standard, annex K."""
    with open(path, "rb") as file:
        head = file.read(1 << 20)
    at = head.find(b"\xff\xdb")
    if at < 0 or at + 69 > len(head) or head[at + 4] & 0xF0:
        return None
    table = np.frombuffer(head, np.uint8, 64, at + 5).astype(float)
    standard = 3685.0  # sum of the 64 luminance steps of annex K
    scale = 100.0 * table.sum() / standard
    return round(5000.0 / scale if scale > 100 else (200.0 - scale) / 2)
