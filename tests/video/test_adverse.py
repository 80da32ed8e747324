"""Recordings that a laboratory makes without noticing: rows are right within their error bars, or a warning names the cause."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render
from labsim.errors import MeasurementError
from labsim.video import Tracking, follow_projectile
from labsim.video.picture.scene import survey_scene

CONTACT, COUNT = 45.5, 90
MOMENTS = np.arange(COUNT)
RING = np.where(MOMENTS < CONTACT, 0.0, np.sin(2 * np.pi * (MOMENTS - CONTACT) / 9.0))
KNOCK = tuple(2.0 * np.exp(-(MOMENTS - CONTACT) / 10.0) * RING)
SINKING = tuple(np.clip((MOMENTS - CONTACT) / 8.0, 0.0, 1.0))
SHAKING = tuple(np.sin(2 * np.pi * MOMENTS / 7.3))


def flicker(i, light):
    return light * (1 + 0.3 * np.clip(np.random.default_rng(1000 + i).normal(), -1.5, 1.5))


def dirt(i, light):
    y, x = np.mgrid[0 : light.shape[0], 0 : light.shape[1]]
    for k, (row, column) in enumerate([(60.0, 45.0), (120.0, 80.0), (180.0, 52.0), (230.0, 70.0)]):
        away = (x - column - 0.1 * i * (-1) ** k) ** 2 + (y - row - 0.25 * i) ** 2
        light = light * (1 - 0.5 * np.exp(-0.5 * away / 9.0))
    return light


def shadow(i, light):
    rows = np.arange(light.shape[0])[:, None]
    return light * (1 - 0.6 / (1 + np.exp((300.0 - 3.0 * i - rows) / 4.0)) * (rows < 280))


def follow(
    disturb=None, *, speed=2.3, stop=30.0, stated=True, **settings
) -> tuple[Tracking, np.ndarray, str]:
    """What is seen of a recording, the errors of its rows, and its warnings in one text."""
    recording = Recording(**settings)
    depth, _ = fall_and_stop(COUNT, CONTACT, speed, stop)
    pictures, rows = render(recording, depth, 1, disturb)
    frames = make_frames(pictures, bits=recording.bits)
    seen = follow_projectile(frames, surface_row=recording.surface_row if stated else None)
    return seen, seen.track.tip_row - rows, "; ".join(seen.track.warnings)


def pull(seen: Tracking, error: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean((error / seen.track.sigma) ** 2)))


@pytest.mark.parametrize(
    ("cause", "settings", "said"),
    [
        ("the stand sinks", {"moved": SINKING}, "surface moves by 1.0"),
        ("a knock at contact", {"moved": KNOCK}, "surface moves by 2."),
        ("the camera shakes", {"moved": SHAKING}, "surface moves by 2.0"),
        ("the picture's edge cuts the rod", {"column": 3.3}, "edge cuts the projectile in 90 frames"),
        ("light that overexposes", {"disturb": flicker}, "frames are overexposed"),
        ("dust brighter than the rod", {"dust": 120.0}, ""),
        ("dust brighter than the light", {"dust": 225.0}, ""),
        ("dirt that drifts", {"disturb": dirt}, "length of the rod scatters"),
        ("a rod that leans", {"tilt": 8.0}, "leans by +8.0° against its fall"),
        ("a rod that leans the other way", {"tilt": -6.0}, "leans by -6.0° against its fall"),
        (
            "a camera that is turned",
            {"camera_rotation": 5.0, "shape": (384, 160), "column": 80.0},
            "+5.00° off",
        ),
    ],
)
def test_rows_stay_within_their_error_bars(record_property, cause, settings, said) -> None:
    seen, error, text = follow(**settings)
    record_property(f"{cause}: rms px, pull", (np.sqrt(np.nanmean(error**2)), pull(seen, error)))
    assert seen.track.valid.mean() > 0.95
    assert pull(seen, error) <= 3.0
    assert said in text
    if not said:
        assert not text


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"gamma": 0.45}, ["gamma 0.4", "rows lie about 0.2", "too high"]),
        ({"fields": True}, ["interlaced", "0.4"]),
        ({"last_blur": 3.0}, ["blur of the edges changes", "focus drifts"]),
        (
            {"exposure": 1.0, "speed": 7.0, "stop": 12.0},
            ["smeared by up to", "exposure about 1.0 of a frame"],
        ),
        ({"distortion": 0.03}, ["the rod gets 2.", "px longer", "lens distortion"]),
        ({"readout": 0.9}, ["the rod gets 0.0", "shutter that reads row after row"]),
    ],
)
def test_what_the_rows_cannot_be_freed_from_is_named(settings, said) -> None:
    _, _, text = follow(**settings)
    assert all(each in text for each in said), text


def test_doubled_fields_are_named() -> None:
    depth, _ = fall_and_stop(COUNT, CONTACT, 2.3, 30.0)
    pictures, _ = render(Recording(), depth, 1)
    doubled = [np.repeat(p[i % 2 :: 2], 2, axis=0) for i, p in enumerate(pictures)]
    track = follow_projectile(make_frames(doubled), surface_row=280.0).track
    assert any("every row is in the picture twice" in text for text in track.warnings)


def test_a_shadow_is_not_called_a_projectile() -> None:
    with pytest.raises(MeasurementError, match="a shadow, a hand or thrown-up dust"):
        follow(shadow)


def test_the_stand_alone_shakes_before_contact() -> None:
    """A projectile in free flight does not move with the dust: its rows stay as they are until it lands."""
    depth, _ = fall_and_stop(COUNT, CONTACT, 2.3, 30.0)
    moved = np.array(SHAKING)
    flying = np.where(MOMENTS < CONTACT, -moved, 0.0)
    pictures, rows = render(Recording(moved=SHAKING), np.asarray(depth) + flying, 1)
    seen = follow_projectile(make_frames(pictures), surface_row=280.0)
    error = seen.track.tip_row - np.where(MOMENTS < CONTACT, rows + moved, rows)
    assert any("surface moves by 2.0" in text for text in seen.track.warnings)
    assert np.sqrt(np.nanmean(error**2)) < 0.03


@pytest.mark.parametrize("wide", [128, 256])
def test_error_bar_of_the_surface_that_is_found(record_property, wide) -> None:
    """Lumps are longer than a column, and the dust in the path has its own: errors over error bars within 1.3 rms."""
    scores = []
    for seed in range(10):
        recording = Recording(surface_lumps=1.0, shape=(384, wide), column=0.5 * wide - 1)
        depth, _ = fall_and_stop(24, 11.5, 7.0, 8.0)
        surface = survey_scene(make_frames(render(recording, depth, seed)[0])).surface_row(recording.column)
        assert surface is not None
        scores.append((surface.value - recording.surface_row) / surface.sigma)
    record_property(f"surface {wide} px wide, rms score", np.sqrt(np.mean(np.square(scores))))
    assert 0.3 < np.sqrt(np.mean(np.square(scores))) < 1.3


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"flicker": 0.1, "vignette": 0.3},
        {"spray": 0.3},
        {"exposure": 0.5},
        {"blur": 0.5},
        {"blur": 2.0},
        {"dark": 5.0},
        {"dark": 6.0, "blur": 0.7},
        {"glare": 30.0},
        {"bead": True, "tip_radius": 30.0},
        {"tilt": 2.0, "surface_lumps": 1.0},
        {"bright": 60.0, "dark": 200.0, "dust": 200.0},
    ],
)
def test_sound_recordings_say_nothing(settings) -> None:
    _, _, text = follow(**settings)
    assert not text


def test_flying_dust_is_not_dust_that_moves() -> None:
    """Spray over the whole strip above the surface hides its edge on both sides alike."""
    settings = {"spray": 0.2, "spray_height": 30.0, "blur": 1.7, "dark": 52.6, "dust": 75.0, "bright": 150.0}
    settings |= {"shape": (264, 110), "width": 34.0, "length": 105.5, "surface_row": 192.7, "column": 53.9}
    recording = Recording(**settings)
    depth, _ = fall_and_stop(80, 40.0, 2.4, 10.5)
    pictures, rows = render(recording, depth, 61)
    seen = follow_projectile(make_frames(pictures))
    assert not any("surface moves" in text for text in seen.track.warnings)
    assert np.nanmax(np.abs(seen.track.tip_row - rows)) < 0.2


@pytest.mark.parametrize("length", [66.0, 70.0])
def test_a_short_rod_is_not_taken_for_a_smeared_bead(length) -> None:
    recording = Recording(
        width=45.0, length=length, shape=(249, 151), surface_row=181.8, column=78.1, blur=0.6
    )
    depth, _ = fall_and_stop(80, 40.0, 1.23, 21.0)
    pictures, rows = render(recording, depth, 15)
    seen = follow_projectile(make_frames(pictures), surface_row=recording.surface_row)
    assert not any("bead" in text for text in seen.track.warnings)
    assert np.sqrt(np.nanmean((seen.track.tip_row - rows) ** 2)) < 0.03
