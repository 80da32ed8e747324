"""One camera whose scale differs from the others' is named; a scale that is off alike for all is a cause like any other."""

import re
from dataclasses import replace
from pathlib import Path

import laws
import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import diagnose_campaign
from labsim.inference.calibrate import calibrate
from labsim.inference.free_fall import doubt_scales, pool
from labsim.inference.observations.observe import observe_drops, read_observed_track
from labsim.records import Measured
from labsim.report.outputs import write_result

P01 = Path(__file__).parents[2] / "data" / "campaigns" / "p01"
FEW = ("D05", "D06", "D07", "D13")


@pytest.fixture(scope="module")
def campaign():
    campaign = read_campaign(P01)
    return replace(campaign, drops=tuple(drop for drop in campaign.drops if drop.name in FEW))


def change_pixel(campaign, factors):
    drops = []
    for drop in campaign.drops:
        size = drop.camera.pixel_size * factors.get(drop.name, 1.0)
        drops.append(replace(drop, camera=replace(drop.camera, pixel_size=size)))
    return replace(campaign, drops=tuple(drops))


def test_cameras_that_agree_are_not_doubted(campaign):
    drops, lines = observe_drops(campaign)
    assert doubt_scales(drops) == [] and lines == []


@pytest.mark.parametrize("factor", [0.94, 1.11])
def test_the_camera_that_disagrees_is_named(campaign, factor):
    (line,) = doubt_scales(observe_drops(change_pixel(campaign, {"D06": factor}))[0])
    assert " in D06," in line and line.endswith("of D06")
    assert f"g = {9.792 * factor:.2f} " in line and "9.80 ± 0.01 m/s² in the others" in line


def test_a_scale_that_is_off_for_all_is_not_doubted(campaign):
    drops, _ = observe_drops(change_pixel(campaign, dict.fromkeys(FEW, 1.08)))
    assert doubt_scales(drops) == []


def test_four_cameras_of_four_scales(campaign):
    """No two agree: all are named, and there are no others."""
    factors = dict(zip(FEW, (0.9, 0.97, 1.04, 1.12), strict=True))
    (line,) = doubt_scales(observe_drops(change_pixel(campaign, factors))[0])
    assert all(f" in {name}" in line for name in FEW) and "the others" not in line


def test_a_track_that_warns_is_heard(campaign, tmp_path):
    """Doubled pictures are left out, and whoever compares that drop is told."""
    drop = campaign.drops[0]
    track = read_observed_track(drop)
    rows = track.tip_row.copy()
    rows[41] = rows[40]
    path = tmp_path / "track.csv"
    path.write_text(
        "frame,time_s,tip_row_px\n"
        + "".join(f"{k},{t:.9f},{row:.4f}\n" for k, t, row in zip(track.frame, track.time, rows, strict=True))
    )
    drop = replace(drop, record=replace(drop.record, path=path))
    _, lines = observe_drops(replace(campaign, drops=(drop,)))
    assert (
        len(lines) == 1
        and lines[0].startswith("drop D05: ")
        and f"frame {track.frame[41]} repeats" in lines[0]
    )


def test_pool_leaves_a_stray_out():
    drops = [Measured(1.0, 0.003), Measured(1.001, 0.003), Measured(0.999, 0.003), Measured(1.2, 0.003)]
    found = pool(drops)
    assert found.value == pytest.approx(1.0) and found.sigma == pytest.approx(0.003 / 3**0.5)


def test_calibrate_and_diagnose_say_it_before_their_result(tmp_path):
    folder = laws.write_campaign(tmp_path / "campaign")
    file = sorted(folder.glob("drops/*/drop.toml"))[1]
    scale = re.compile(r"(?m)^pixel_size_um *= *([\d.]+)")
    size = float(scale.search(file.read_text())[1])
    file.write_text(scale.sub(f"pixel_size_um = {1.5 * size}", file.read_text()))
    campaign, store = read_campaign(folder), laws.LawStore(tmp_path / "store")
    found = calibrate(campaign, store=store)
    (tmp_path / "out").mkdir()
    _, lines = write_result(found, tmp_path / "out")
    said = [line for line in lines.split("p_m = ")[0].splitlines() if "free fall shows g" in line]
    assert len(said) == 1 and said[0].startswith("warning: ") and said[0].endswith(file.parent.name)
    found = diagnose_campaign(campaign, store, workers=1)
    summary, lines = write_result(found, tmp_path / "out")
    assert any("free fall shows g" in text for text in summary["warnings"][: found.doubts])
    assert "free fall shows g" in lines.split("probability  cause")[0]


def test_two_workers_measure_what_one_does(campaign):
    one, two = (observe_drops(campaign, workers=workers) for workers in (1, 2))
    assert [drop.name for drop in two[0]] == list(FEW) and one[1] == two[1]
    for here, there in zip(one[0], two[0], strict=True):
        assert here.curve.penetration_depth == there.curve.penetration_depth
        np.testing.assert_array_equal(here.depth, there.depth)
