"""Scale from a ruler and from the rod's diameter, from the command line to the depth in metres."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

import labsim
from benchmarks.truths.video import Recording, fall_and_stop, render, write_video
from labsim.cli import main

PIXEL = 20.4e-6  # m, the true scale
RATE = 10_000.0


@pytest.fixture(scope="module")
def drop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scale")
    recording = Recording()
    depth, truth = fall_and_stop(90, 45.37, 2.3, 30.0)
    video = write_video(render(recording, depth, 7)[0], folder / "drop.avi")
    rng = np.random.default_rng(2)
    step = 0.5e-3 / PIXEL
    x = np.arange(500.0)
    ticks = sum(np.exp(-0.5 * ((x - 9.4 - step * k) / 1.4) ** 2) for k in range(20))
    ruler = 190 - 130 * ticks[None, :] + rng.normal(0, 3, (80, 500))
    cv2.imwrite(str(folder / "ruler.png"), np.clip(np.round(ruler), 0, 255).astype(np.uint8))
    return recording, truth, video, folder / "ruler.png"


def measure(capsys, out, video, *options):
    arguments = ["track", video, "--fps", RATE, "--surface-row", 280.0, *options, "-o", out, "--json", "-q"]
    with pytest.raises(SystemExit) as stop:
        main([str(each) for each in arguments])
    assert not stop.value.code
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("source", ["ruler", "diameter"])
def test_scale_to_depth(tmp_path, capsys, drop, source) -> None:
    """Pixel size within 3 of its own sigmas and to 0.5 %, and the depth in metres that follows from it."""
    recording, truth, video, ruler = drop
    options = {
        "ruler": ("--ruler", ruler, "--ruler-step-mm", 0.5),
        "diameter": ("--rod-diameter-mm", 1e3 * recording.width * PIXEL),
    }[source]
    summary = measure(capsys, tmp_path / "out", video, *options)
    assert summary["pixel_size_m"] == pytest.approx(PIXEL, rel=0.005)
    assert 0 < summary["pixel_size_m_sigma"] < 0.005 * PIXEL
    assert abs(summary["pixel_size_m"] - PIXEL) < 3 * summary["pixel_size_m_sigma"]
    assert summary["penetration_depth_m"] == pytest.approx(truth["depth"] * PIXEL, rel=0.007)
    assert summary["stopping_time_s"] == pytest.approx(truth["stop"] / RATE, abs=2e-5)
    assert not any("per pixel" in text for text in summary["warnings"])
    name = {"ruler": "ruler", "diameter": "rod diameter"}[source]
    assert summary["pixel_size_source"] == name
    assert summary["pixel_size_measured_m"][name]["sigma"] == summary["pixel_size_m_sigma"]
    # the depth is not known better than the scale
    share = summary["pixel_size_m_sigma"] / summary["pixel_size_m"]
    assert summary["penetration_depth_m_sigma"] >= share * summary["penetration_depth_m"]


def test_scale_is_said_with_its_error(tmp_path, capsys, drop) -> None:
    _, truth, video, _ = drop
    out, sigma = tmp_path / "out", 0.01
    arguments = ["track", video, "--fps", RATE, "--surface-row", 280.0, "--pixel-um", 1e6 * PIXEL]
    with pytest.raises(SystemExit):
        main([str(each) for each in (*arguments, "--pixel-um-sigma", sigma * 1e6 * PIXEL, "-o", out)])
    said = capsys.readouterr().out
    assert "pixel size             20.400 ± 0.204 µm" in said
    summary = json.loads((out / "drop.json").read_text())
    assert summary["pixel_size_source"] == "stated"
    assert summary["penetration_depth_m_sigma"] == pytest.approx(sigma * truth["depth"] * PIXEL, rel=0.2)


def test_scales_that_disagree_are_said(tmp_path, capsys, drop) -> None:
    """Ruler and diameter beside a stated pixel size that is 4 % off: the stated one holds, both say so."""
    recording, _, video, ruler = drop
    options = ("--ruler", ruler, "--ruler-step-mm", 0.5, "--rod-diameter-mm", 1e3 * recording.width * PIXEL)
    summary = measure(capsys, tmp_path / "out", video, "--pixel-um", 1.04e6 * PIXEL, *options)
    assert summary["pixel_size_m"] == pytest.approx(1.04 * PIXEL)
    text = " ".join(summary["warnings"])
    assert "the ruler gives" in text and "the rod diameter gives" in text
    assert summary["pixel_size_source"] == "stated" and len(summary["pixel_size_measured_m"]) == 2


def test_the_error_of_a_scale_is_the_same_by_script_and_by_command(tmp_path, capsys, drop) -> None:
    _, _, video, _ = drop
    by_command = measure(
        capsys, tmp_path / "out", video, "--pixel-um", 1e6 * PIXEL, "--pixel-um-sigma", 1e4 * PIXEL
    )
    _, curve = labsim.track(
        video, frame_rate=RATE, pixel_size=labsim.Measured(PIXEL, 0.01 * PIXEL), surface_row=280.0
    )
    assert curve.penetration_depth.sigma == pytest.approx(by_command["penetration_depth_m_sigma"], rel=1e-6)


@pytest.mark.parametrize(
    ("option", "needs"), [("--ruler-step-mm", "--ruler"), ("--surface-row-sigma", "--surface-row")]
)
def test_what_says_more_about_nothing_is_refused(tmp_path, capsys, drop, option, needs) -> None:
    _, _, video, _ = drop
    arguments = (
        "track",
        video,
        "--fps",
        RATE,
        "--pixel-um",
        1e6 * PIXEL,
        option,
        2.0,
        "-o",
        tmp_path / "out",
    )
    with pytest.raises(SystemExit) as stop:
        main([str(each) for each in arguments])
    assert stop.value.code == 2
    assert f"{option}: says more about {needs}" in capsys.readouterr().err


def test_no_scale_no_curve(tmp_path, capsys, drop) -> None:
    summary = measure(capsys, tmp_path / "out", drop[2])
    assert summary["penetration_depth_m"] is None
    assert any("pixel size" in text for text in summary["warnings"])
