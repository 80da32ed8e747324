"""Force records of pushed tips: readers against tables whose numbers are known, and against damaged ones."""

from __future__ import annotations

import math
import struct
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign, read_drop
from labsim.errors import CampaignError, LabsimError, MeasurementError
from labsim.force import check_force, read_force, read_gauge
from labsim.inference.observations.observe_push import observe_push
from labsim.inspection.drops import find_air
from labsim.tables import Table

ROOT = Path(__file__).resolve().parents[1]
RADIUS = 5e-3
TILLER = ROOT / "data" / "campaigns" / "tiller"
DROP = """[drop]
sequence = 1
[projectile]
tip = "cone"
half_angle_deg = 30.0
tip_radius_mm = 5.0
[motion]
kind = "pushed"
speed_m_s = 0.01
speed_sigma_m_s = 0.0005
[record]
kind = "force"
file = "{file}"
"""


def gauge(**keys: object):
    return read_gauge(Table(Path("drop.toml"), "record", {"sigma": 0.1, **keys}))


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def rows(separator: str = ",", decimal: str = ".", heading: str = "depth_mm,force_N") -> str:
    lines = [heading.replace(",", separator)]
    for k in range(200):
        lines.append(
            separator.join(f"{value:.4f}".replace(".", decimal) for value in (0.5 * k, 2.0 + 0.1 * k))
        )
    return "\n".join(lines) + "\n"


def is_refused(path: Path, content: bytearray, radius: float, **keys: object) -> bool:
    """Whether a damaged record is refused, in one line; one that is read has numbers."""
    path.write_bytes(bytes(content))
    try:
        record = read_force(path, gauge(**keys), radius)
    except MeasurementError as trouble:
        assert "\n" not in str(trouble)
        return True
    assert np.isfinite(record.pressure).all()
    return False


NAMED = {"depth_column": "depth_mm", "force_column": "force_N", "depth_unit": "mm", "force_unit": "N"}


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), ("\t", ","), ("\t", ".")])
def test_a_force_becomes_pressure_on_the_section(tmp_path: Path, separator: str, decimal: str) -> None:
    path = write(tmp_path / "push.csv", rows(separator, decimal))
    record = read_force(path, gauge(**NAMED), RADIUS)
    assert record.depth == pytest.approx(0.5e-3 * np.arange(200))
    assert record.pressure * math.pi * RADIUS**2 == pytest.approx(2.0 + 0.1 * np.arange(200))
    assert record.step == pytest.approx(0.5e-3)


def test_a_pressure_is_taken_in_its_unit(tmp_path: Path) -> None:
    path = write(tmp_path / "push.csv", rows(heading="z,q"))
    keys = {"depth_column": "z", "pressure_column": "q", "depth_unit": "cm", "force_unit": "kPa"}
    record = read_force(path, gauge(**keys), RADIUS)
    assert record.pressure[10] == pytest.approx(3.0e3)
    assert record.depth[10] == pytest.approx(0.05)


def test_a_window_cuts_and_what_is_lifted_is_left_out(tmp_path: Path) -> None:
    text = rows().replace("50.0000,12.0000", "40.0000,99.0000")
    record = read_force(write(tmp_path / "p.csv", text), gauge(**NAMED, window_mm=[20.0, 80.0]), RADIUS)
    assert record.depth[0] == pytest.approx(0.02) and record.depth[-1] == pytest.approx(0.08)
    assert record.lifted == 1 and record.pressure.max() < 50.0 / (math.pi * RADIUS**2)


def test_pore_water_behind_a_cone_is_corrected_for(tmp_path: Path) -> None:
    lines = ["$", "HA=1,MA=0.800,MB=0.0", "#"]
    lines += [f"D={0.02 * k:.3f},QC={1.0 + 0.01 * k:.4f},FS=20.0,U={100.0 + k:.1f},TA=1.1" for k in range(60)]
    record = read_force(write(tmp_path / "s.cpt", "\n".join(lines)), gauge(force_unit="MPa"), RADIUS)
    k = np.arange(60)
    assert record.pressure == pytest.approx((1.0 + 0.01 * k) * 1e6 + 0.2 * (100.0 + k) * 1e3)
    assert record.sleeve == pytest.approx(np.full(60, 20e3)) and record.pore[5] == pytest.approx(105e3)


def test_a_sounding_is_read_whatever_its_blanks_and_case(tmp_path: Path) -> None:
    lines = ["ha=1, ma = 0.800"] + [f"d={0.02 * k:.3f}, qc = 1.0 ,Fs=10.0, u=100.0" for k in range(60)]
    record = read_force(write(tmp_path / "s.cpt", "\n".join(lines)), gauge(force_unit="MPa"), RADIUS)
    assert record.pressure == pytest.approx(np.full(60, 1e6 + 0.2 * 100e3))
    assert record.sleeve == pytest.approx(np.full(60, 10e3))


@pytest.mark.parametrize("cell", ["1_0", "0x10", "inf"])
def test_what_is_no_plain_number_is_refused(tmp_path: Path, cell: str) -> None:
    lines = ["HA=1,MA=0.800"] + [f"D={0.02 * k:.3f},QC=1.0" for k in range(60)]
    lines[7] = f"D=0.12,QC={cell}"
    with pytest.raises(MeasurementError, match=r"line 8: QC='.*' is not a number"):
        read_force(write(tmp_path / "s.cpt", "\n".join(lines)), gauge(force_unit="MPa"), RADIUS)
    table = ["depth_mm;force_N", *(f"{k};1,0" for k in range(60))]
    table[7] = f"6;{cell}"
    with pytest.raises(MeasurementError, match=r"line 8: '.*' is not a number"):
        read_force(write(tmp_path / "s.csv", "\n".join(table)), gauge(**NAMED), RADIUS)


def test_a_row_without_pore_water_is_lost_not_corrected_by_nothing(tmp_path: Path) -> None:
    lines = ["HA=1,MA=0.800"]
    lines += [f"D={0.02 * k:.3f},QC=1.0" + (f",U={300.0}" if k % 3 else "") for k in range(60)]
    record = read_force(write(tmp_path / "s.cpt", "\n".join(lines)), gauge(force_unit="MPa"), RADIUS)
    assert record.lost == 20 and np.ptp(record.pressure) == 0.0


PRESSED = {"depth_column": "z", "pressure_column": "q", "depth_unit": "cm", "force_unit": "kPa"}


def write_sleeve(path: Path) -> Path:
    lines = ["z,q,f", *(f"{0.5 * k:.1f},{100 + k:.1f},{'' if k == 7 else 2 + 0.01 * k:}" for k in range(200))]
    return write(path, "\n".join(lines) + "\n")


def test_a_sleeve_is_a_column_in_its_unit(tmp_path: Path) -> None:
    path = write_sleeve(tmp_path / "p.csv")
    keys = {**PRESSED, "sleeve_column": "f", "sleeve": True, "sleeve_sigma": 0.1, "sleeve_offset_sigma": 0.5}
    known = gauge(**keys)
    record = read_force(path, known, RADIUS)
    assert record.sleeve[100] == pytest.approx(3e3) and np.isnan(record.sleeve[7]) and record.lost == 0
    assert (known.sleeve.sigma, known.sleeve.offset_sigma, known.sleeve.compared) == (100.0, 500.0, True)
    assert not read_force(path, gauge(**PRESSED), RADIUS).sleeve.size
    assert read_force(path, gauge(**keys, sleeve_unit="MPa"), RADIUS).sleeve[100] == pytest.approx(3e6)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({**PRESSED, "sleeve": True, "sleeve_sigma": 0.1}, "no sleeve_column is there"),
        ({**PRESSED, "sleeve_column": "f", "sleeve": True}, "sleeve_sigma: is missing"),
        ({**PRESSED, "sleeve": "yes"}, "neither true nor false"),
        ({**PRESSED, "sleeve_column": "f", "sleeve_unit": "bar"}, "write one of"),
        ({**NAMED, "sleeve_column": "f"}, "needs pressure_column"),
        ({**NAMED, "sleeve": True, "sleeve_sigma": 0.1}, "holds the shaft too"),
    ],
)
def test_what_is_wrong_with_a_sleeve_is_named(keys: dict, text: str) -> None:
    with pytest.raises(CampaignError, match=text):
        gauge(**keys)


def test_a_sleeve_that_counts_must_be_in_the_record(tmp_path: Path) -> None:
    lines = ["HA=1,MA=0.8", *(f"D={0.02 * k:.3f},QC=1.0,U=100.0" for k in range(60))]
    path = write(tmp_path / "s.cpt", "\n".join(lines))
    with pytest.raises(CampaignError, match="no sleeve friction"):
        check_force(path, gauge(force_unit="MPa", sleeve=True, sleeve_sigma=0.3), RADIUS)


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"force_column": "newton"}, MeasurementError, "the columns are depth_mm, force_N"),
        ({"depth_unit": "inch"}, CampaignError, "write one of"),
        ({"force_unit": "bar"}, CampaignError, "write one of"),
        ({"pressure_column": "q"}, CampaignError, "are both there"),
        ({"window_mm": [80.0, 20.0]}, CampaignError, "does not grow"),
        ({"window_mm": [500.0, 900.0]}, MeasurementError, "choose depths that the record has"),
        ({"force_unit": "kN", "depth_unit": "m"}, None, ""),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, change: dict, error: type[LabsimError] | None, text: str
) -> None:
    path = write(tmp_path / "push.csv", rows())
    if error is None:
        assert read_force(path, gauge(**(NAMED | change)), RADIUS).depth[-1] == pytest.approx(99.5)
        return
    with pytest.raises(error, match=text):
        read_force(path, gauge(**(NAMED | change)), RADIUS)


def test_a_force_record_needs_a_push(tmp_path: Path) -> None:
    write(tmp_path / "push.csv", rows())
    keys = 'depth_column = "depth_mm"\nforce_column = "force_N"\ndepth_unit = "mm"\nforce_unit = "N"\nsigma = 0.1\n'
    drop = read_drop(write(tmp_path / "drop.toml", DROP.format(file="push.csv") + keys))
    assert drop.motion.speed_sigma == 0.0005 and drop.gauge is not None and drop.projectile.mass > 0
    free = DROP.replace('kind = "pushed"\nspeed_m_s = 0.01\nspeed_sigma_m_s = 0.0005', 'kind = "free"')
    with pytest.raises(CampaignError, match="a force is recorded of a push"):
        read_drop(write(tmp_path / "drop.toml", (free.replace("[record]", "[record]")).format(file="push.csv").replace(
            "tip_radius_mm = 5.0", "tip_radius_mm = 5.0\nmass_mg = 4000.0") + keys))  # fmt: skip


def test_a_force_of_the_wrong_sign_is_refused(tmp_path: Path) -> None:
    text = rows().replace(",", ",-").replace("depth_mm,-force_N", "depth_mm,force_N")
    write(tmp_path / "push.csv", text)
    keys = 'depth_column = "depth_mm"\nforce_column = "force_N"\ndepth_unit = "mm"\nforce_unit = "N"\nsigma = 0.1\n'
    with pytest.raises(CampaignError, match="turn its sign"):
        read_drop(write(tmp_path / "drop.toml", DROP.format(file="push.csv") + keys))


def test_the_weight_of_the_ground_is_taken_off() -> None:
    campaign = read_campaign(ROOT / "data/campaigns/tiller")
    push = observe_push(campaign.drops[0], campaign)
    assert push.weight == pytest.approx(9.81 * 1800.0)
    inside = np.floor(push.record.depth / (56.0 * 17.84e-3)) == push.windows[2]
    net = push.record.pressure[inside] - 9.81 * 1800.0 * push.record.depth[inside]
    assert push.resistance[2] == pytest.approx(math.log(np.median(net)))


def test_the_published_regression_of_the_soundings_is_found_again() -> None:
    """SOURCE.txt: mean of ln qt over the metres 10 to 18 grows by 10.0 ± 0.8 % a decade, rms 3.4 % before and 1.2 % after."""
    campaign = read_campaign(ROOT / "data/campaigns/tiller")
    mean, speed = [], []
    for drop in campaign.drops:
        assert drop.gauge is not None and drop.record.path is not None
        record = read_force(drop.record.path, drop.gauge, drop.projectile.tip_radius)
        mean.append([np.log(np.median(record.pressure[np.floor(record.depth) == m])) for m in range(10, 18)])
        speed.append(math.log10(dict(drop.motion.values)["speed"]))
    y = np.mean(mean, axis=1)
    slope, offset = np.polyfit(speed, y, 1)
    left = y - slope * np.array(speed) - offset
    assert len(y) == 25
    assert slope == pytest.approx(0.100, abs=0.004)
    assert y.std(ddof=1) == pytest.approx(0.034, abs=0.002) and left.std(ddof=2) == pytest.approx(
        0.012, abs=0.001
    )


@pytest.mark.parametrize("kind", ["csv", "cpt"])
def test_no_damaged_record_ends_in_a_traceback(tmp_path: Path, kind: str) -> None:
    if kind == "csv":
        whole, keys = rows().encode(), NAMED
    else:
        found = next((ROOT / "data/campaigns/tiller/drops/TILC69").glob("*.cpt"))
        whole, keys = found.read_bytes()[:20000], {"force_unit": "MPa"}
    rng = np.random.default_rng(7)
    path, read = tmp_path / f"m.{kind}", 0
    for _ in range(300):
        content = bytearray(whole)
        for _ in range(int(rng.integers(1, 4))):
            at, how = int(rng.integers(len(content))), int(rng.integers(4))
            if how == 0:
                content[at] = int(rng.integers(256))
            elif how == 1:
                del content[at : at + int(rng.integers(1, 400))]
            elif how == 2:
                content[at:at] = bytes(rng.choice([b"nan", b"-", b"1e9", b",,", b"\0", b"inf", b"=", b"\n"]))
            else:
                del content[at:]
            content = content or bytearray(b"x")
        path.write_bytes(bytes(content))
        try:
            record = read_force(path, gauge(**keys), RADIUS)
        except LabsimError:
            continue
        read += 1
        assert (
            np.isfinite(record.depth).all()
            and np.isfinite(record.pressure).all()
            and np.all(np.diff(record.depth) > 0)
        )
    assert read > 20  # most small damage leaves rows that can be read


def test_a_long_record_is_read_quickly(tmp_path: Path) -> None:
    lines = ["depth_mm,force_N", *(f"{0.01 * k:.4f},{5.0 + 1e-4 * k:.4f}" for k in range(50_000))]
    path = write(tmp_path / "long.csv", "\n".join(lines))
    began = time.process_time()
    assert read_force(path, gauge(**NAMED), RADIUS).depth.size == 50_000
    assert time.process_time() - began < 1.0


def write_profile(path: Path, counts: np.ndarray, step: float = 0.004, per_count: float = 0.0012) -> Path:
    """A SnowMicroPen's file: its header's numbers and the counts."""
    head = bytearray(512)
    struct.pack_into(">hi", head, 0, 131, len(counts))
    struct.pack_into(">ff", head, 6, step, per_count)
    struct.pack_into(">i", head, 358, len(counts))
    path.write_bytes(bytes(head) + counts.astype(">i2").tobytes())
    return path


def test_a_profile_of_a_snow_micro_pen(tmp_path: Path) -> None:
    """The force of the tip over its section, from where the snow is said to begin."""
    counts = np.concatenate([np.zeros(5000), np.full(20_000, 250)])
    path = write_profile(tmp_path / "S31M0067.pnt", counts)
    given = gauge(surface_mm=20.0, force_unit="N", window_mm=[1.0, 60.0], sigma=0.01)
    record = read_force(path, given, 2.5e-3)
    assert record.depth[0] == pytest.approx(1e-3, abs=5e-6) and record.depth[-1] == pytest.approx(
        0.06, abs=5e-6
    )
    assert record.pressure == pytest.approx(250 * 0.0012 / (math.pi * 2.5e-3**2))
    assert given.sigma == 0.01 and not given.feels_shaft


@pytest.mark.parametrize("stated", [0.0, 20.0])
def test_air_before_the_snow_is_seen_unless_it_is_stated(tmp_path: Path, stated: float) -> None:
    rng = np.random.default_rng(4)
    counts = np.concatenate([np.zeros(5000), np.full(20_000, 250)]) + rng.integers(-3, 4, 25_000)
    path = write_profile(tmp_path / "S31M0067.pnt", counts)
    given = gauge(force_unit="N", sigma=0.004, surface_mm=stated, window_mm=[0.0, 90.0])
    record = read_force(path, given, 2.5e-3)
    nothing = find_air(record, 2.5e-3, 0.004 / given.per_pressure(math.pi * 2.5e-3**2))
    assert nothing == pytest.approx(2e-2 - 1e-3 * stated, abs=1e-5)


def test_a_sounding_that_begins_in_the_ground_meets_no_air() -> None:
    campaign = read_campaign(TILLER)
    for drop in campaign.drops[:6]:
        record = read_force(drop.record.path, drop.gauge, drop.projectile.tip_radius)
        assert find_air(record, drop.projectile.tip_radius, drop.gauge.sigma) == 0.0


def test_a_damaged_profile_is_one_line(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    whole = write_profile(tmp_path / "whole.pnt", rng.integers(0, 9000, 3000)).read_bytes()
    refused = 0
    for number in range(300):
        content = bytearray(whole)
        if number % 3 == 0:
            content = content[: rng.integers(0, len(content))]
        else:
            for _ in range(4):
                content[rng.integers(0, 400)] = rng.integers(0, 256)
        path = tmp_path / "mutant.pnt"
        refused += is_refused(path, content, 2.5e-3, force_unit="N")
    assert refused > 90


def test_the_noise_of_a_force_is_noise_on_the_section(tmp_path: Path) -> None:
    """The same record as forces and as pressures has the same errors."""
    campaign = read_campaign(TILLER)
    drop = campaign.drops[0]
    radius = drop.projectile.tip_radius
    section = math.pi * radius**2
    depth = np.arange(0.0, 6.0, 0.01)
    values = {"force_N": (6e5 + 2e4 * depth) * section, "pressure_Pa": 6e5 + 2e4 * depth}
    errors = []
    for column, sigma in (("force_N", 3e4 * section), ("pressure_Pa", 3e4)):
        path = tmp_path / f"{column}.csv"
        lines = [f"{d:.4f},{v!r}" for d, v in zip(depth.tolist(), values[column].tolist(), strict=True)]
        path.write_text("\n".join([f"depth_m,{column}", *lines]) + "\n")
        key, unit = column.split("_")
        keys = {"depth_column": "depth_m", f"{key}_column": column, "force_unit": unit, "sigma": sigma}
        given = read_gauge(Table(Path("drop.toml"), "record", keys))
        pushed = replace(drop, gauge=given, record=replace(drop.record, path=path))
        errors.append(observe_push(pushed, campaign).sigma)
    assert errors[0] == pytest.approx(errors[1]) and errors[0].min() > 0.003


GEF = """#GEFID= 1, 1, 0
#REPORTCODE= GEF-CPT-Report, 1, 1, 2
#COLUMN= 4
#COLUMNINFO= 1, m, penetration length, 1
#COLUMNINFO= 2, MPa, cone resistance, 2
#COLUMNINFO= 3, MPa, friction, 3
#COLUMNINFO= 4, MPa, pore pressure u2, 6
#COLUMNVOID= 2, -999
#MEASUREMENTVAR= 3, 0.80, -, net surface quotient of the cone tip
#TESTID= S1
#ZID= 31000, 1.5, 0.01
#XYID= 31000, 100000, 400000, 0.1, 0.1
#EOH=
"""


def write_sounding(path: Path) -> Path:
    lines = [f"{0.02 * k:.2f} {0.5 + 0.01 * k:.3f} 0.010 {0.001 * k:.4f}" for k in range(100)]
    lines[50] = "1.00 -999 0.010 0.0500"
    path.write_text(GEF + "\n".join(lines) + "\n")
    return path


def test_a_dutch_sounding_is_corrected_for_its_water(tmp_path: Path) -> None:
    """qt = qc + (1 - a) u with a = 0.8; a void is a row without a number."""
    record = read_force(write_sounding(tmp_path / "S1.gef"), gauge(), 0.0178)
    k = np.delete(np.arange(100), 50)
    assert record.depth == pytest.approx(0.02 * k) and record.lost == 1
    assert record.pressure == pytest.approx(1e6 * (0.5 + 0.01 * k + 0.2 * 0.001 * k))
    assert record.sleeve == pytest.approx(np.full(99, 1e4)) and record.pore == pytest.approx(1e3 * k)


def test_a_damaged_dutch_sounding_is_one_line(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    whole = write_sounding(tmp_path / "whole.gef").read_bytes()
    refused = 0
    for number in range(120):
        content = bytearray(whole)
        if number % 3 == 0:
            content = content[: rng.integers(0, len(content))]
        else:
            for _ in range(3):
                content[rng.integers(0, len(GEF))] = rng.integers(32, 127)
        path = tmp_path / "mutant.gef"
        refused += is_refused(path, content, 0.0178)
    assert refused > 20
