"""Readers: real files, every format, and files that are damaged in two hundred ways."""

from __future__ import annotations

import struct
import subprocess
import sys
import tracemalloc
from pathlib import Path

import cv2
import numpy as np
import pims
import pytest
import tifffile

from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render, write_video
from labsim.errors import LabsimError, MeasurementError
from labsim.records import Measured
from labsim.video import follow_projectile, measure_ruler, open_frames, scale_from_diameter
from labsim.video.picture.noise import Noise
from labsim.video.projectile.registration import register
from labsim.video.projectile.template import MARGIN, Template

DATA = Path(__file__).parents[2] / "data" / "video"


def test_real_phantom_files() -> None:
    """R1: 97 frames at 35087 ± 20 fps; 15 frames at 9003 ± 1 fps although the header says 90 000."""
    legacy = open_frames(DATA / "cine_phantom" / "cine_legacy.cine")
    assert len(list(legacy)) == 97 and legacy.shape == (128, 128) and legacy.bits == 14
    rate = 96 / (legacy.stamps[-1] - legacy.stamps[0])
    assert rate == pytest.approx(35087, abs=20) and not legacy.warnings
    assert np.ptp(np.diff(legacy.stamps)) < 1e-12  # an even clock behind stamps of 1 µs
    burst = open_frames(DATA / "cine_phantom" / "cine_781.cine")
    assert len(list(burst)) == 15 and burst.bits == 12
    assert 14 / (burst.stamps[-1] - burst.stamps[0]) == pytest.approx(9003, abs=1)
    assert any("90000" in text and "stamps" in text for text in burst.warnings)


@pytest.mark.parametrize("name", ["cine_legacy", "cine_781"])
def test_phantom_pixels_agree_with_pims(name) -> None:
    path = DATA / "cine_phantom" / f"{name}.cine"
    ours = list(open_frames(path))
    theirs = pims.Cine(str(path))
    for i in (0, 3, len(ours) - 1):
        assert np.array_equal(ours[i], np.asarray(theirs.get_frame(i)))


def test_stuck_particles_do_not_move(record_property) -> None:
    """R2: positions of 41 fixed particles scatter by ≤ 0.12 px after removing the common drift."""
    pictures = [p.astype(float) for p in open_frames(DATA / "stuck_particles" / "stuck.tif")]
    mean = np.mean(pictures, axis=0)
    smooth = cv2.GaussianBlur(mean, (0, 0), 1.5)
    peaks = (smooth == cv2.dilate(smooth, np.ones((15, 15)))) & (smooth > np.percentile(smooth, 97))
    spots = [(y, x) for y, x in np.argwhere(peaks) if 16 < y < 495 and 16 < x < 495]
    spots = sorted(spots, key=lambda s: -smooth[tuple(s)])[:41]
    assert len(spots) == 41
    half, width = 4 + MARGIN, 1.2  # px; the particles are images of points
    g = np.arange(-half, half + 1.0)
    spot = Template(np.exp(-0.5 * (g[:, None] ** 2 + g[None, :] ** 2) / width**2), -half, -half)
    usable = np.ones(mean.shape, bool)
    found = np.full((41, 5, 2), np.nan)
    for n, (y, x) in enumerate(spots):
        ground = np.full_like(mean, np.median(mean[y - 9 : y + 10, x - 9 : x + 10]))
        for k, picture in enumerate(pictures):
            fit = register(
                picture, ground, usable, spot, Noise(400.0, 1.0), y, x, mean[y, x], 1.0, robust=False
            )
            if fit is not None:
                found[n, k] = fit.y, fit.x
    assert np.isnan(found).mean() < 0.1
    found = found[np.isfinite(found[..., 0]).sum(axis=1) > 1]
    own = found - np.nanmean(found, axis=1, keepdims=True)
    own -= np.nanmedian(own, axis=0)  # the drift that all share
    scatter = np.sqrt(np.nanmean(np.nanvar(own, axis=1, ddof=1), axis=0))
    record_property("R2 scatter of rows, columns px", tuple(scatter))
    assert np.all(scatter <= 0.12), scatter


def test_phone_clip_warns() -> None:
    """R3: 327 frames, colour, variable frame rate."""
    frames = open_frames(DATA / "ball_drop_120fps" / "ball_drop.mp4")
    assert sum(1 for _ in frames) == 327 and frames.shape == (1716, 172)
    assert any("variable frame rate" in text for text in frames.warnings)
    assert any("colour" in text for text in frames.warnings)


@pytest.fixture(scope="module")
def drop():
    recording = Recording(shape=(200, 96), width=30.0, length=90.0, surface_row=150.0, column=47.0)
    depth, _ = fall_and_stop(60, 25.3, 2.0, 18.0)
    return recording, *render(recording, depth, 1)


def test_every_format_gives_the_same_pictures(tmp_path, drop) -> None:
    _, pictures, _ = drop
    tifffile.imwrite(tmp_path / "stack.tif", np.array(pictures))
    write_video(pictures, tmp_path / "drop.avi", "FFV1")
    for suffix in ("png", "bmp", "tif"):
        folder = tmp_path / suffix
        folder.mkdir()
        for i, picture in enumerate(pictures):
            cv2.imwrite(str(folder / f"img{i}.{suffix}"), picture)
    for source in ("stack.tif", "drop.avi", "png", "bmp", "tif"):
        found = list(open_frames(tmp_path / source))
        assert len(found) == len(pictures), source
        assert all(np.array_equal(a, b) for a, b in zip(found, pictures, strict=True)), source


def test_gaps_in_file_numbers_are_dropped_frames(tmp_path) -> None:
    for i in (8, 9, 10, 13):
        cv2.imwrite(str(tmp_path / f"run2_{i}.png"), np.full((20, 20), i, np.uint16) * 1000)
    frames = open_frames(tmp_path)
    assert [int(p[0, 0]) for p in frames] == [8000, 9000, 10000, 13000]
    assert list(frames.numbers) == [0, 1, 2, 5] and "2 frames dropped" in frames.warnings[0]


def test_long_video_stays_in_little_memory(tmp_path) -> None:
    """20 000 frames are never held at once: reading costs less than 20 MB of Python memory."""
    picture = np.random.default_rng(0).integers(0, 255, (64, 64)).astype(np.uint8)
    frames = make_frames([picture])
    frames.start, frames.count = lambda: (picture + 0 for _ in range(40_000)), 40_000
    tracemalloc.start()
    assert sum(1 for _ in frames) == 40_000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6


def test_a_folder_of_one_stack_names_the_stack(tmp_path) -> None:
    tifffile.imwrite(tmp_path / "stack.tif", np.zeros((5, 20, 20), np.uint16))
    with pytest.raises(MeasurementError, match=r"stack\.tif.*5 pictures in one file; name the file itself"):
        open_frames(tmp_path)


@pytest.mark.slow
def test_tracking_a_long_video_stays_in_500_megabytes() -> None:
    """20 000 frames of 128 x 384, a gigabyte of pixels that are made when asked for, in a process of its own."""
    program = """
import resource, numpy as np
from labsim.video import follow_projectile
from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render
pictures, _ = render(Recording(), fall_and_stop(100, 60.3, 2.5, 30.0)[0])
frames = make_frames(pictures)
frames.start = lambda: (pictures[i if i < 94 else 94 + i % 6].copy() for i in range(20_000))
frames.count, frames.numbers = 20_000, np.arange(20_000)
assert follow_projectile(frames).track.valid.sum() > 19_900
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert int(found.stdout) * 1024 < 500e6


@pytest.mark.parametrize("name", ["empty.avi", "text.avi", "text.cine", "text.tif", "text.mp4", "notes.doc"])
def test_no_video_is_one_line(tmp_path, name) -> None:
    path = tmp_path / name
    path.write_bytes(b"" if name.startswith("empty") else b"this is a shopping list\n" * 40)
    with pytest.raises(MeasurementError) as trouble:
        list(open_frames(path))
    assert str(path) in str(trouble.value) and "\n" not in str(trouble.value)


def test_a_cine_whose_table_points_beyond_any_file(tmp_path: Path) -> None:
    content = bytearray((DATA / "cine_phantom" / "cine_legacy.cine").read_bytes())
    (table,) = struct.unpack_from("<I", content, 32)
    struct.pack_into("<Q", content, table + 8 * 5, (1 << 64) - 3)
    path = tmp_path / "far.cine"
    path.write_bytes(content)
    assert len(list(open_frames(path))) == 5


def test_truncated_video_is_said(tmp_path) -> None:
    source = DATA / "cine_phantom" / "cine_legacy.cine"
    short = tmp_path / "short.cine"
    short.write_bytes(source.read_bytes()[:2_000_000])
    frames = open_frames(short)
    count = sum(1 for _ in frames)
    assert 12 < count < 97 and any("truncated" in text for text in frames.warnings)


def test_two_hundred_mutated_files(tmp_path, drop) -> None:
    """A damaged file gives a LabsimError or flagged frames, never another exception and never a wrong row in silence."""
    recording, pictures, rows = drop
    tifffile.imwrite(tmp_path / "a.tif", np.array(pictures))
    write_video(pictures, tmp_path / "a.avi", "MJPG", 95)
    sources = [
        (tmp_path / "a.tif").read_bytes(),
        (tmp_path / "a.avi").read_bytes(),
        (DATA / "cine_phantom" / "cine_781.cine").read_bytes(),
    ]
    rng = np.random.default_rng(5)
    refused = tracked = 0
    for number in range(200):
        kind = number % 3
        data = bytearray(sources[kind])
        head = rng.random() < 0.6
        for _ in range(int(rng.integers(1, 12))):
            data[int(rng.integers(0, 4000 if head else len(data)))] = int(rng.integers(0, 256))
        if rng.random() < 0.25:
            data = data[: int(rng.integers(1, len(data)))]
        path = tmp_path / f"mutant{number}.{('tif', 'avi', 'cine')[kind]}"
        path.write_bytes(bytes(data))
        try:
            frames = open_frames(path)
            if kind == 2 or number % 5:  # following all of them would take minutes
                list(frames)
                continue
            seen = follow_projectile(frames, frame_rate=1e4, surface_row=recording.surface_row)
        except LabsimError as trouble:
            assert "\n" not in str(trouble)
            refused += 1
            continue
        finally:
            path.unlink()
        tracked += 1
        track = seen.track
        if len(track.frame) == len(rows):
            error = np.abs(track.tip_row - rows)[track.valid]
            assert np.median(error) < 0.05
            assert np.mean(error > 0.3) < 0.05 or track.warnings
    assert refused > 8 and tracked > 5


def test_ruler_and_diameter() -> None:
    """A ruler of 0.5 mm ticks at 12.34 px each gives the pixel size to 1e-3 with an error bar that covers it."""
    rng = np.random.default_rng(3)
    x = np.arange(400)
    profile = sum(np.exp(-0.5 * ((x - 7.3 - 12.34 * k) / 1.3) ** 2) for k in range(31))
    picture = 180 - 120 * profile[None, :] + rng.normal(0, 3, (60, 400))
    for image in (picture, picture.T):
        pixel, warnings = measure_ruler(image, 0.5e-3)
        assert pixel.value == pytest.approx(0.5e-3 / 12.34, rel=1e-3) and not warnings
        assert abs(pixel.value - 0.5e-3 / 12.34) < 4 * pixel.sigma
    with pytest.raises(MeasurementError, match="ticks"):
        measure_ruler(rng.normal(100, 3, (60, 400)), 0.5e-3)
    assert scale_from_diameter(1e-3, 2e-6, Measured(50.0, 0.05)).sigma == pytest.approx(
        20e-6 * np.hypot(2e-3, 1e-3)
    )
