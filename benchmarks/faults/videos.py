"""Adverse recordings: how far the tracker's rows are off, what error bars it gives them, and what it says.

    python -m benchmarks.faults.videos [CASE ...]

Each case is one synthetic recording of the same drop: 90 frames, contrast 150, a rod 40 px wide, 2.3 px per frame at
contact, rest after 30 frames, seed 1, rows of 20 um at 10 kHz; what the case does to it stands in the table ``CASES``. Pull is
the rms of (error / error bar), 1 where the error bars are honest. v0, D and T_s are errors in % and, in brackets, in standard
deviations. "Before" is how labsim stood when the table was first drawn up; the last column says what is printed beside the rows.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render, write_video
from labsim.errors import LabsimError
from labsim.records import Camera, Track
from labsim.video import Frames, fit_deceleration, follow_projectile, open_frames

Disturb = Callable[[int, np.ndarray], np.ndarray]
COUNT, CONTACT, SEED, PIXEL, RATE = 90, 45.5, 1, 20e-6, 1e4
GRAVITY = 9.81 / (PIXEL * RATE**2)  # px per frame²
STATED_SIGMA = 0.02  # px, of a stated surface row
SOUND = Recording()
MOMENTS = np.arange(COUNT)
Y, X = np.mgrid[0 : SOUND.shape[0], 0 : SOUND.shape[1]].astype(float)


@dataclass(frozen=True)
class Case:
    """One adverse recording. before : rms px, pull, D in standard deviations and the warning, as they were first found;
    settings : of ``Recording``; motion : of ``fall_and_stop``; disturb : what it does to the light of each frame; change :
    what it does to the finished pictures; missing : frames that the file lacks without a word; stated : whether the surface
    row is given; codec : and quality of the video file, else pictures in memory."""

    before: tuple[str, str, str, str]
    settings: dict[str, Any] = field(default_factory=dict)
    motion: dict[str, Any] = field(default_factory=dict)
    disturb: Disturb | None = None
    change: Callable[[list[np.ndarray]], list[np.ndarray]] | None = None
    missing: tuple[int, ...] = ()
    stated: bool = True
    codec: tuple[str, int] | None = None


def after_contact(size: float, fade: float, period: float) -> tuple[float, ...]:
    """A knock of ``size`` px at contact that rings with ``period`` and dies out over ``fade`` frames."""
    t = MOMENTS - CONTACT
    return tuple(np.where(t < 0, 0.0, size * np.exp(-t / fade) * np.sin(2 * np.pi * t / period)))


def sinking(size: float) -> tuple[float, ...]:
    return tuple(size * np.clip((MOMENTS - CONTACT) / 8.0, 0.0, 1.0))


def spot(i: int, light: np.ndarray, row: float, column: float, size: float, depth: float) -> np.ndarray:
    return light * (1 - depth * np.exp(-0.5 * ((X - column) ** 2 + (Y - row) ** 2) / size**2))


def flicker(i: int, light: np.ndarray) -> np.ndarray:
    return light * (1 + 0.3 * np.clip(np.random.default_rng(1000 + i).normal(), -1.5, 1.5))


def shadow(i: int, light: np.ndarray) -> np.ndarray:
    return light * (1 - 0.6 / (1 + np.exp((300.0 - 3.0 * i - Y) / 4.0)) * (Y < SOUND.surface_row))


def dirt(i: int, light: np.ndarray) -> np.ndarray:
    for k, (row, column) in enumerate([(60.0, 45.0), (120.0, 80.0), (180.0, 52.0), (230.0, 70.0)]):
        light = spot(i, light, row + 0.25 * i, column + 0.1 * i * (-1) ** k, 3.0, 0.5)
    return light


def bands(i: int, light: np.ndarray) -> np.ndarray:
    return light + np.random.default_rng(2000 + i).normal(0, 2.0, (len(light), 1))


def light_step(i: int, light: np.ndarray) -> np.ndarray:
    return light * (0.5 if i > 55 else 1.0)


def curtain(i: int, light: np.ndarray, high: float, solid: bool = False) -> np.ndarray:
    """Dust thrown up on both sides of the path, as a cone that rises and thins (or, ``solid``, stays opaque)."""
    t = i - CONTACT
    if t <= 0:
        return light
    top = SOUND.surface_row - high * min(1.0, t / 20.0)
    away = np.abs(np.abs(X - SOUND.column) - 24.0 - 0.15 * (SOUND.surface_row - Y)) / 5.0
    cover = np.exp(-0.5 * away**2) if not solid else 1.0
    cover = 0.8 * cover * np.exp(-t / (60.0 if not solid else 1e9)) / (1 + np.exp(top - Y))
    return light * (1 - cover) + SOUND.dust * cover


def reflection(i: int, light: np.ndarray) -> np.ndarray:
    return light + 80.0 * np.exp(
        -0.5 * (((X - SOUND.column) / 3.0) ** 2 + ((Y - 200.0 + 1.5 * i) / 6.0) ** 2)
    )


def second(i: int, light: np.ndarray) -> np.ndarray:
    """A smaller dark rod that falls beside, later."""
    away = np.maximum(np.abs(X - 15.0) - 5.0, np.maximum(Y - (2.0 * i - 20.0), -Y - 1e3))
    return np.where(Y < SOUND.surface_row, light + (40.0 - light) / (1 + np.exp(away / 0.6)), light)


def double_fields(pictures: list[np.ndarray]) -> list[np.ndarray]:
    """Every picture made of one field of a camera that reads odd and even rows by turns, each row written twice."""
    made = []
    for i, picture in enumerate(pictures):
        field_rows = picture[i % 2 :: 2]
        made.append(np.repeat(field_rows, 2, axis=0)[: len(picture)])
    return made


NOTHING = "nothing"
SINE = np.sin(2 * np.pi * MOMENTS / 7.3)
CASES: dict[str, Case] = {
    "clean": Case(("0.005", "1.0", "+0.2", NOTHING)),
    "flicker30_random": Case(("0.046", "2.0", "-1.9", NOTHING), disturb=flicker),
    "moving_shadow": Case(
        ("", "", "", "refused: the projectile moves upwards; give --rotate 180"), disturb=shadow
    ),
    "vibration_1px": Case(("0.708", "36.7", "+0.1", "the tip scatters 3.6 times"), {"moved": tuple(SINE)}),
    "vibration_3px_vignette": Case(
        ("2.117", "36.1", "+0.0", "the tip scatters 11.3 times"), {"moved": tuple(3 * SINE), "vignette": 0.4}
    ),
    "knock_2px_at_contact": Case(
        ("0.361", "32.6", "+1.9", "the top end scatters 2.0 times"), {"moved": after_contact(2.0, 10.0, 9.0)}
    ),
    "stand_sinks_1px": Case(("0.592", "73.9", "+50.1", NOTHING), {"moved": sinking(1.0)}),
    "motion_blur_full": Case(
        ("0.105", "11.7", "-0.2", NOTHING), {"exposure": 1.0}, {"speed": 7.0, "stop": 12.0, "count": 60}
    ),
    "low_contrast_5sigma": Case(
        ("", "", "", "refused: contrast 8.1 is below 4 times the noise 2.1"), {"bright": 48.1, "gain": 0.0}
    ),
    "interlaced": Case(("0.280", "38.7", "+1.5", "registration and erf edge differ"), {"fields": True}),
    "field_doubled": Case(("0.502", "0.6", "", "the tip scatters 152.3 times"), change=double_fields),
    "dropped_silently_3_5": Case(
        ("0.006", "1.1", "+0.1", "3 frames are missing; 5 frames are missing"),
        missing=(20, 21, 22, 48, 49, 50, 51, 52),
    ),
    "dropped_1_near_stop": Case(("0.005", "1.0", "+0.1", NOTHING), missing=(60, 65, 70)),
    "mjpeg_q10": Case(("0.011", "1.0", "+0.1", "compressed with loss"), codec=("MJPG", 10)),
    "half_out_of_frame": Case(("1.360", "185.9", "+67.5", NOTHING), {"column": 3.3}),
    "top_out_of_frame_until_end": Case(("0.007", "1.1", "", "never seen together"), {"length": 400.0}),
    "two_projectiles": Case(("0.006", "1.1", "+0.1", NOTHING), disturb=second),
    "camera_tilt_5": Case(
        ("0.006", "1.2", "+1.2", "the fall is +5.00° off the columns"),
        {"camera_rotation": 5.0, "shape": (384, 160), "column": 80.0},
    ),
    "rod_leans_8": Case(("0.005", "1.1", "+1.1", NOTHING), {"tilt": 8.0}),
    "projectile_colour_of_dust": Case(("0.006", "1.0", "+0.1", NOTHING), {"dust": 40.0}),
    "dust_brighter_than_rod": Case(("0.040", "7.2", "-4.0", NOTHING), {"dust": 120.0}),
    "dust_as_background": Case(("0.005", "1.1", "+0.2", NOTHING), {"dust": 180.0}),
    "ejecta_curtain_tip": Case(
        ("0.005", "1.0", "+0.1", "top end disturbed"), disturb=lambda i, light: curtain(i, light, 60.0)
    ),
    "ejecta_curtain_tall": Case(
        ("0.006", "1.1", "", "top end disturbed"), disturb=lambda i, light: curtain(i, light, 180.0)
    ),
    "curtain_solid_rising": Case(
        ("0.005", "1.0", "", "top end disturbed"),
        disturb=lambda i, light: curtain(i, light, 150.0, solid=True),
    ),
    "rolling_shutter": Case(("1.139", "182.2", "+6.7", NOTHING), {"readout": 0.9}),
    "focus_drifts": Case(("0.085", "7.5", "+6.1", "length of the rod scatters"), {"last_blur": 3.0}),
    "gamma_camera": Case(("0.233", "29.4", "-11.5", NOTHING), {"gamma": 0.45}),
    "barrel_distortion": Case(
        ("1.085", "184.4", "-51.9", "length of the rod scatters"), {"distortion": 0.03}
    ),
    "light_step_half": Case(("0.007", "0.8", "-0.2", NOTHING), disturb=light_step),
    "drifting_dirt": Case(("0.034", "3.6", "-1.8", "length of the rod scatters"), disturb=dirt),
    "banding_noise": Case(("0.047", "1.0", "-0.5", "the tip scatters 2.1 times"), disturb=bands),
    "reflection_travels": Case(("0.010", "1.2", "+0.2", "top end disturbed"), disturb=reflection),
    "few_frames_fast": Case(
        ("0.006", "1.2", "+1.9", NOTHING), {}, {"speed": 14.0, "stop": 4.0, "count": 18, "contact": 9.5}
    ),
    "surface_row_unstated": Case(("0.005", "1.0", "+8.1", NOTHING), {"surface_lumps": 1.5}, stated=False),
}


def make_case(case: Case) -> tuple[list[np.ndarray], np.ndarray, dict[str, float]]:
    """Pictures, true rows of each, and the true figures of the fall (px, frames)."""
    motion = {
        "count": COUNT,
        "contact": CONTACT,
        "speed": 2.3,
        "stop": 30.0,
        "gravity": GRAVITY,
    } | case.motion
    depth, truth = fall_and_stop(motion.pop("count"), **motion)
    pictures, rows = render(replace(SOUND, **case.settings), depth, SEED, case.disturb)
    if case.change is not None:
        pictures = case.change(pictures)
    kept = [i for i in range(len(pictures)) if i not in case.missing]
    return [pictures[i] for i in kept], rows[kept], truth


def open_pictures(pictures: list[np.ndarray], codec: tuple[str, int] | None) -> Frames:
    if codec is None:
        return make_frames(pictures)
    with tempfile.TemporaryDirectory() as folder:
        frames = open_frames(write_video(pictures, Path(folder) / "drop.avi", *codec))
        list(frames)  # kept in memory
    return frames


def compare(found: float, sigma: float, true: float) -> str:
    return f"{100 * (found / true - 1):+.2f}% ({(found - true) / sigma:+.1f})"


def judge(case: Case) -> list[str]:
    """The cells of one line of the table as labsim stands: rows to said."""
    pictures, rows, truth = make_case(case)
    surface = SOUND.surface_row
    try:
        seen = follow_projectile(
            open_pictures(pictures, case.codec), frame_rate=RATE, surface_row=surface if case.stated else None
        )
    except LabsimError as refusal:
        return ["refused"] + [""] * 7 + [str(refusal).split(": ", 2)[-1]]
    track = seen.track
    error = track.tip_row - rows
    good = track.valid
    cells = [
        f"{good.sum()}/{good.size}",
        f"{np.sqrt(np.mean(error[good] ** 2)):.3f}",
        f"{np.median(error[good]):+.3f}",
        f"{np.median(track.sigma[good]):.3f}",
        f"{np.sqrt(np.mean((error / track.sigma)[good] ** 2)):.1f}",
    ]
    said = list(track.warnings)
    row, row_sigma = (
        (surface, STATED_SIGMA)
        if case.stated or seen.surface is None
        else (seen.surface.value, seen.surface.sigma)
    )
    return [
        *cells,
        *measure(track, Camera(RATE, PIXEL, row, row_sigma), truth, said),
        "; ".join(said) or NOTHING,
    ]


def measure(track: Track, camera: Camera, truth: dict[str, float], said: list[str]) -> list[str]:
    """Errors of v0, D and T_s; what the fit of the curve says besides is added to ``said``."""
    try:
        curve = fit_deceleration(track, camera)
    except LabsimError as refusal:
        said.append(f"no curve: {refusal}")
        return [""] * 3
    said += [f"[curve] {text}" for text in curve.warnings if text not in said]
    return [
        compare(curve.impact_speed.value, curve.impact_speed.sigma, truth["speed"] * PIXEL * RATE),
        compare(curve.penetration_depth.value, curve.penetration_depth.sigma, truth["depth"] * PIXEL),
        compare(curve.stopping_time.value, curve.stopping_time.sigma, truth["stop"] / RATE),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", nargs="*", help=f"any of: {', '.join(CASES)}; default: all")
    chosen = parser.parse_args().case or list(CASES)
    print(
        "| adversity | rms, pull, D before | rows | rms | offset | error bar | pull | v0 | D | T_s | said before | said |"
    )
    print("|" + " --- |" * 12)
    for name in chosen:
        rms, pull, depth, said = CASES[name].before
        *cells, now = judge(CASES[name])
        print(f"| {name} | {rms}, {pull}, {depth} | {' | '.join(cells)} | {said} | {now} |", flush=True)


if __name__ == "__main__":
    main()
