"""Synthetic high-speed videos of a drop, with the true rows: for tests, and to see what a setting does to a measurement.

A rod with a round tip (or a bare bead) falls into dust. Every pixel is the mean over its area of the blurred silhouette,
from exact distances to the outline, not from a coarse mask, so that the true positions are true to about 1e-3 px.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.special import erf

from labsim.records import FloatArray
from labsim.video.frames import Frames


@dataclass(frozen=True)
class Recording:
    """Settings of a synthetic recording; lengths in px, times in frames, levels in counts of an 8-bit picture.

    blur : standard deviation of the point-spread function; read_noise, gain : variance = read_noise² + gain · level;
    vignette : loss of light in the corners; flicker : amplitude of the brightness in time; tilt, camera_rotation :
    degrees; drift : sideways motion over the record; exposure : share of a frame; spray : share of the strip above the
    surface covered by flying dust after contact; stripe : brightness of a reflection along the rod; glare : brightness
    of a wandering blob; surface_lumps : rms roughness; dead : number of dead pixels; ceiling : level of saturation;
    moved : px by which dust and projectile stand lower in each frame (a camera or a stand that moves); gamma : exponent of
    the camera's response; distortion : radial, relative to the corner (positive: barrel); last_blur : blur in the last
    frame, where focus drifts; readout : share of a frame by which the last row is read after the first; fields : whether odd
    rows are read half a frame later than even ones.
    """

    shape: tuple[int, int] = (384, 128)
    bits: int = 8
    width: float = 40.0
    tip_radius: float | None = None
    length: float = 150.0
    bead: bool = False
    surface_row: float = 280.0
    column: float = 63.3
    bright: float = 190.0
    dark: float = 40.0
    dust: float = 38.0
    blur: float = 0.9
    read_noise: float = 2.0
    gain: float = 0.03
    vignette: float = 0.15
    flicker: float = 0.0
    tilt: float = 0.0
    camera_rotation: float = 0.0
    drift: float = 0.0
    exposure: float = 0.0
    spray: float = 0.0
    spray_height: float = 60.0
    stripe: float = 0.0
    glare: float = 0.0
    surface_lumps: float = 0.0
    dead: int = 0
    ceiling: float = 255.0
    dropped: tuple[int, ...] = ()
    duplicated: tuple[int, ...] = ()
    moved: tuple[float, ...] = ()
    gamma: float = 1.0
    distortion: float = 0.0
    last_blur: float | None = None
    readout: float = 0.0
    fields: bool = False


def fall_and_stop(
    count: int, contact: float, speed: float, stop: float, *, gravity: float = 0.005, shape: float = 0.4
) -> tuple[FloatArray, dict[str, float]]:
    """Positions of the tip against the surface (px, one per frame) of a drop that comes to rest, and its true figures.

    contact, stop : frames; speed : px per frame at contact; gravity : px per frame²; shape : slope of the
    deceleration (0 constant, 0.4 falls to less than half). Returns (count,) px and contact, speed, stop, depth.
    """
    t = np.arange(count) - contact
    return evaluate_motion(t, speed, stop, gravity, shape), {
        "contact": contact,
        "speed": speed,
        "stop": stop,
        "depth": float(evaluate_motion(np.array([stop]), speed, stop, gravity, shape)[0]),
    }


def evaluate_motion(t: FloatArray, speed: float, stop: float, gravity: float, shape: float) -> FloatArray:
    """Free flight, then a deceleration ∝ 1 + shape·(1 - 2u) with v = 0 at u = 1, then rest; t counted from contact."""
    t = np.asarray(t, float)
    u = np.clip(t / stop, 0.0, 1.0)
    inside = speed * stop * (u - ((1 + shape) * u**2 / 2 - shape * u**3 / 3))
    return np.where(t < 0, speed * t + 0.5 * gravity * t**2, inside)


def render(
    recording: Recording,
    depth: FloatArray,
    seed: int = 0,
    disturb: Callable[[int, FloatArray], FloatArray] | None = None,
) -> tuple[list[np.ndarray], FloatArray]:
    """Pictures of a drop whose tip is at ``depth`` (px below the surface, one per frame), and the true rows.

    The rows are those of the tip along the line of the fall, against dust that stands still. Returns a list of
    (rows, columns) uint8 or uint16 and (n,) px. Dropped frames are missing from both, duplicated ones come twice in the
    pictures. ``disturb`` may change the light (rows, columns) of frame i before the camera adds its noise.
    """
    rng = np.random.default_rng(seed)
    r = recording
    h, w = r.shape
    y, x = np.mgrid[0:h, 0:w].astype(float)
    light = r.bright * (1 - r.vignette * (((x - w / 2) / (w / 2)) ** 2 + ((y - h / 2) / (h / 2)) ** 2) / 2)
    lumps = np.zeros(w)
    if r.surface_lumps > 0:
        lumps = np.convolve(rng.normal(size=w + 20), np.hanning(21), mode="valid")[:w]
        lumps *= r.surface_lumps / np.std(lumps)
    dead = rng.integers(0, h * w, r.dead)
    stuck = rng.uniform(0, 250, r.dead)
    scale = (2**r.bits - 1) / 255.0
    n = len(depth)
    pictures: list[np.ndarray] = []
    clouds = [(rng.uniform(-1, 1), rng.uniform(0, 1), rng.uniform(1.5, 5.0)) for _ in range(400)]
    late = r.readout * y[:, :1] / h + (0.5 * (y[:, :1] % 2) if r.fields else 0.0)  # frames
    s, q = _place(r, y, x, 0.0)
    ground = _cover(s - lumps[None, :], r.blur)
    sharp = r
    for i in range(n):
        if i in r.dropped:
            continue
        if r.last_blur is not None:
            r = replace(sharp, blur=sharp.blur + (r.last_blur - sharp.blur) * i / max(n - 1, 1))
        if r.moved or r.last_blur is not None:
            s, q = _place(r, y, x, r.moved[i] if r.moved else 0.0)
            ground = _cover(s - lumps[None, :], r.blur)
        steps = [depth[i]]
        if r.exposure > 0:
            before = depth[i] - depth[max(i - 1, 0)] if i else depth[1] - depth[0]
            steps = [depth[i] + before * r.exposure * (k / 8.0 - 0.5) for k in range(9)]
        elif r.readout > 0 or r.fields:
            steps = [np.interp(i + late, np.arange(n), depth)]
        across = q - r.drift * (i / max(n - 1, 1) - 0.5)
        body = np.mean([_silhouette(r, s - z, across) for z in steps], axis=0)
        level = r.dark + r.stripe * np.exp(-0.5 * ((across - 0.2 * r.width) / 2.0) ** 2)
        picture = light * (1 - body) + level * body
        if r.spray > 0 and depth[i] > 0:
            cloud = np.zeros((h, w))
            for a, b, size in clouds[: int(400 * r.spray)]:
                cx, cy = (
                    r.column + a * 0.45 * w,
                    r.surface_row - b * r.spray_height * min(1.0, depth[i] / 15.0),
                )
                cx, cy = cx + 0.3 * i * a, cy + 2.0 * np.sin(0.3 * i + 20 * a)
                y0, y1 = max(0, int(cy - 3 * size)), min(h, int(cy + 3 * size) + 1)
                x0, x1 = max(0, int(cx - 3 * size)), min(w, int(cx + 3 * size) + 1)
                if y1 > y0 and x1 > x0:
                    near = np.hypot(y[y0:y1, x0:x1] - cy, x[y0:y1, x0:x1] - cx)
                    cloud[y0:y1, x0:x1] = np.maximum(cloud[y0:y1, x0:x1], _cover(size - near, r.blur))
            picture = picture * (1 - 0.8 * cloud) + 0.8 * r.dust * cloud
        picture = picture * (1 - ground) + r.dust * ground
        if r.glare > 0:
            gx, gy = w * (0.3 + 0.4 * i / n), h * (0.2 + 0.5 * i / n)
            picture = picture + r.glare * np.exp(-0.5 * ((x - gx) ** 2 + (y - gy) ** 2) / 12.0**2)
        picture = picture * (1 + r.flicker * np.sin(1.7 * i + 0.4 * i**1.1))
        if disturb is not None:
            picture = disturb(i, picture)
        if r.gamma != 1:
            picture = 255.0 * (np.clip(picture, 0, None) / 255.0) ** r.gamma
        noise = np.sqrt(r.read_noise**2 + r.gain * np.clip(picture, 0, None))
        picture = picture + rng.normal(size=(h, w)) * noise
        picture.flat[dead] = stuck
        picture = np.clip(picture, 0, r.ceiling)
        kind = np.uint8 if r.bits == 8 else np.uint16
        counts = np.clip(np.round(picture * scale), 0, 2**r.bits - 1).astype(kind)
        pictures.append(counts)
        if i in r.duplicated:
            pictures.append(counts.copy())
    rows = r.surface_row + np.delete(np.asarray(depth, float), list(r.dropped))
    return pictures, rows


def _place(r: Recording, y: FloatArray, x: FloatArray, moved: float) -> tuple[FloatArray, FloatArray]:
    """Coordinates of the laboratory of every pixel: along the fall from where it meets the surface, and across."""
    h, w = r.shape
    if r.distortion:
        out = ((y - h / 2) ** 2 + (x - w / 2) ** 2) / ((h / 2) ** 2 + (w / 2) ** 2)
        y, x = h / 2 + (y - h / 2) * (1 + r.distortion * out), w / 2 + (x - w / 2) * (1 + r.distortion * out)
    angle = np.radians(r.camera_rotation)
    down, aside = y - moved - r.surface_row, x - r.column
    return down * np.cos(angle) + aside * np.sin(angle), -down * np.sin(angle) + aside * np.cos(angle)


def _cover(distance: FloatArray, blur: float) -> FloatArray:
    """Covered share of a pixel at a signed distance inside a blurred straight edge."""
    # a pixel's own square adds 1/12 to the variance of the blur
    return 0.5 * (1 + erf(distance / np.sqrt(2 * (blur**2 + 1.0 / 12.0))))


def _silhouette(r: Recording, s: FloatArray, q: FloatArray) -> FloatArray:
    """Opacity of the projectile whose tip is at s = 0, growing upwards to s = -length, centred on q = 0."""
    radius = r.tip_radius if r.tip_radius is not None else 0.5 * r.width
    sigma2 = r.blur**2 + 1.0 / 12.0

    def disc() -> FloatArray:
        away = np.hypot(s + radius, q)
        # to first order a blurred disc looks p²/(2R) smaller than it is
        return _cover(radius - away - sigma2 / (2 * np.maximum(away, radius / 2)), r.blur)

    if r.bead:
        return disc()
    tilt = np.radians(r.tilt)
    # the shaft turns about the centre of the tip's circle
    along = (s + radius) * np.cos(tilt) + q * np.sin(tilt)
    across = q * np.cos(tilt) - (s + radius) * np.sin(tilt)
    half = 0.5 * r.width
    sides = _cover(half - across, r.blur) + _cover(half + across, r.blur) - 1
    top = _cover(along + (r.length - radius), r.blur)
    shaft = sides * top * _cover(-along, r.blur)
    return np.maximum(disc(), np.where(along < 0, np.maximum(shaft, 0.0), 0.0))


def make_frames(
    pictures: list[np.ndarray],
    *,
    rate: float | None = 10_000.0,
    bits: int | None = None,
    numbers: np.ndarray | None = None,
    stamps: FloatArray | None = None,
) -> Frames:
    """Pictures in memory as a video."""
    first = pictures[0]
    return Frames(
        path=Path("synthetic"),
        start=lambda: iter(pictures),
        count=len(pictures),
        shape=first.shape,
        bits=bits if bits is not None else 8 * first.dtype.itemsize,
        numbers=np.arange(len(pictures)) if numbers is None else numbers,
        stamps=stamps,
        header_rate=rate,
        codec="memory",
    )


def write_video(
    pictures: list[np.ndarray], path: Path, codec: str = "FFV1", quality: int | None = None
) -> Path:
    """Write 8-bit pictures as AVI or MP4; ``quality`` (1-100) for MJPG."""
    h, w = pictures[0].shape
    parameters = [cv2.VIDEOWRITER_PROP_IS_COLOR, 0 if codec == "FFV1" else 1]
    if codec == "MJPG":
        writer = cv2.VideoWriter(
            str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*codec), 30.0, (w, h)
        )
        writer.set(cv2.VIDEOWRITER_PROP_QUALITY, float(quality if quality is not None else 95))
    else:
        writer = cv2.VideoWriter(
            str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), 30.0, (w, h), parameters
        )
    for picture in pictures:
        writer.write(picture if codec == "FFV1" else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path
