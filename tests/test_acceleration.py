"""Records of accelerometers: read, integrated and refused, against motions in closed form."""

from __future__ import annotations

import random
from pathlib import Path

import accelerations
import numpy as np
import pytest
from laws import move
from mutations import change_bytes, change_text

from labsim.acceleration import find_impact, read_acceleration
from labsim.campaign import read_campaign
from labsim.errors import CampaignError, LabsimError
from labsim.inspection.drops import inspect_drop
from labsim.records import Campaign

SHAPE = (1.0, 12.0, 0.7)  # mm, mg, m/s


def make(folder: Path, **values: float) -> Path:
    return accelerations.write_campaign(folder / "c", drops=[SHAPE], **values)


def edit(folder: Path, old: str, new: str) -> None:
    file = folder / "drops" / "D01" / "drop.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def look(campaign: Campaign):  # type: ignore[no-untyped-def]
    drop = campaign.drops[0]
    return find_impact(read_acceleration(drop.record.path, drop.accelerometer), drop)


def test_depth_speed_contact_and_stop_of_a_known_motion(tmp_path: Path) -> None:
    folder = make(tmp_path)
    depth, stop = move(SHAPE[0] * 1e-3, SHAPE[1] * 1e-6, SHAPE[2], 1300.0)
    contact = accelerations.make_pulse(*SHAPE)[2]
    impact = look(read_campaign(folder))
    assert impact.contact_time == pytest.approx(contact, abs=0.1 * stop)
    assert impact.flight_speed.value == pytest.approx(SHAPE[2], rel=0.02)
    assert abs(impact.penetration_depth.value - depth) < 3 * impact.penetration_depth.sigma + 0.02 * depth
    assert impact.stopping_time == pytest.approx(stop, rel=0.05)
    assert impact.rest.value == pytest.approx(9.81, abs=4 * 0.05 * 9.81)
    assert not impact.warnings


@pytest.mark.parametrize("rate", [2e3, 4e3, 8e3, 20e3, 50e3])
def test_depth_and_stop_have_the_error_that_the_rate_leaves(tmp_path: Path, rate: float) -> None:
    depth, stop = move(SHAPE[0] * 1e-3, SHAPE[1] * 1e-6, SHAPE[2], 1300.0)
    pulls = []
    for seed in range(5):
        impact = look(read_campaign(make(tmp_path / str(seed), rate=rate, seed=seed)))
        pulls.append((impact.penetration_depth.value - depth) / impact.penetration_depth.sigma)
        # what is felt jumps to 1 g at contact, a thirtieth of the largest: a line through the rise begins earlier
        assert impact.stopping_time == pytest.approx(stop, abs=0.03 * stop + 0.5 / rate)
    assert np.max(np.abs(pulls)) < 3


def test_a_rebound_has_its_speed_and_none_is_none(tmp_path: Path) -> None:
    plain = look(read_campaign(make(tmp_path / "none")))
    assert abs(plain.rebound_speed.value) < 3 * plain.rebound_speed.sigma
    folder = make(tmp_path / "back")
    time, felt, contact = accelerations.make_pulse(*SHAPE)
    _, stop = move(SHAPE[0] * 1e-3, SHAPE[1] * 1e-6, SHAPE[2], 1300.0)
    pushed = (time > contact + stop) & (time < contact + 1.5 * stop)
    speed = 0.2 * SHAPE[2]
    back = np.where(pushed, felt + speed / (pushed.sum() * (time[1] - time[0])) / accelerations.G, felt)
    accelerations.write_record(folder / "drops" / "D01", time, back)
    campaign = read_campaign(folder)
    rebound = look(campaign).rebound_speed
    assert abs(rebound.value - speed) < 3 * rebound.sigma
    assert rebound.value > 5 * rebound.sigma
    assert "up again" in inspect_drop(campaign.drops[0], campaign).line


def test_several_drops_of_one_recording_each_take_their_window(tmp_path: Path) -> None:
    alone = look(read_campaign(make(tmp_path / "alone")))
    folder = make(tmp_path / "several")
    time, felt, _ = accelerations.make_pulse(*SHAPE)
    length = time[-1] + time[0]
    whole = np.concatenate([time, time + length, time + 2 * length])
    accelerations.write_record(
        folder / "drops" / "D01", whole, np.concatenate([0.5 * felt, felt, 1.2 * felt])
    )
    edit(folder, 'kind = "acceleration"', f'kind = "acceleration"\nwindow_s = [{length}, {2 * length}]')
    campaign = read_campaign(folder)
    impact = look(campaign)
    assert impact.contact_time - length == pytest.approx(alone.contact_time, abs=1e-4)
    assert impact.penetration_depth.value == pytest.approx(alone.penetration_depth.value, rel=0.02)
    # the same file for another drop, from its own folder: another window is another measurement, an overlapping one is not
    (folder / "drops" / "D02").mkdir()
    text = (folder / "drops" / "D01" / "drop.toml").read_text().replace("sequence = 1", "sequence = 2")
    text = text.replace('"acceleration.csv"', '"../D01/acceleration.csv"')
    other = folder / "drops" / "D02" / "drop.toml"
    other.write_text(text)
    with pytest.raises(CampaignError, match="one measurement counts once"):
        read_campaign(folder)
    other.write_text(text.replace(f"[{length}, {2 * length}]", f"[{2 * length}, {3 * length}]"))
    second = read_campaign(folder).drops[1]
    found = find_impact(read_acceleration(second.record.path, second.accelerometer), second)
    assert found.contact_time - 2 * length == pytest.approx(alone.contact_time, abs=1e-4)


@pytest.mark.parametrize("zero", [-0.13, 0.13, 0.15])
def test_a_sensor_of_little_noise_may_have_its_zero_off(tmp_path: Path, zero: float) -> None:
    """By three of its stated errors and a hundred times the noise; the blow is weak beside that."""
    weak = (3.0, 90.0, 0.12)
    folder = accelerations.write_campaign(tmp_path / "c", drops=[weak], noise=2e-4)
    file = folder / "drops" / "D01" / "acceleration.csv"
    time, felt = np.loadtxt(file, delimiter=",", skiprows=1).T
    assert abs(zero) > 0.02 * felt.max()
    contact = accelerations.make_pulse(*weak)[2]
    falling = (time > contact - 5e-3) & (time < contact - 1e-3)
    accelerations.write_record(file.parent, time, felt - felt[falling].mean() + zero)
    impact = look(read_campaign(folder))
    _, stop = move(weak[0] * 1e-3, weak[1] * 1e-6, weak[2], 1300.0)
    assert impact.contact_time == pytest.approx(contact, abs=0.05 * stop)
    assert impact.stopping_time == pytest.approx(stop, rel=0.05)


@pytest.mark.parametrize(("zero", "slow"), [(-7.0, False), (4.0, False), (60.0, True)])
def test_a_zero_that_is_not_known_is_what_the_flight_reads(tmp_path: Path, zero: float, slow: bool) -> None:
    """As of piezoelectric sensors, by several g; also where gravity is felt before the release for most of the record."""
    folder = make(tmp_path, rate=4e3 if slow else 20e3)
    known = look(read_campaign(folder))
    file = folder / "drops" / "D01" / "acceleration.csv"
    time, felt = np.loadtxt(file, delimiter=",", skiprows=1).T
    accelerations.write_record(file.parent, time, felt + zero)
    with pytest.raises(LabsimError):
        look(read_campaign(folder))
    edit(folder, "offset_sigma = 0.05", "offset_sigma = 5.0")
    edit(folder, "reads_at_rest = 1.0", "reads_at_rest = 0.0")
    campaign = read_campaign(folder)
    found = look(campaign)
    assert campaign.drops[0].accelerometer.sensors[0].offset_sigma < 0.05 * 9.81
    assert found.warnings == ()
    assert found.contact_time == pytest.approx(known.contact_time, abs=known.stopping_time * 0.01)
    assert found.flight_speed.value == pytest.approx(known.flight_speed.value, rel=0.01)
    assert found.penetration_depth.value == pytest.approx(known.penetration_depth.value, rel=0.02)
    assert abs(found.flight.value) < 0.05 * 9.81
    assert found.rest.value == pytest.approx(9.81, abs=0.05 * 9.81)


@pytest.mark.parametrize("before", [2e-4, 1e-3])
def test_a_zero_that_is_not_known_takes_a_flight(tmp_path: Path, before: float) -> None:
    folder = make(tmp_path)
    edit(folder, "offset_sigma = 0.05", "offset_sigma = 5.0")
    file = folder / "drops" / "D01" / "acceleration.csv"
    time, felt = np.loadtxt(file, delimiter=",", skiprows=1).T
    late = time > time[np.argmax(felt)] - before
    accelerations.write_record(file.parent, time[late], felt[late])
    with pytest.raises(CampaignError, match="shows no free flight before the impact"):
        read_campaign(folder)


def test_the_depth_has_the_error_that_scale_and_zero_leave(tmp_path: Path) -> None:
    """Forty records with a scale and a zero of their own: the depths scatter as they say, within a factor of two."""
    pulls = []
    depth, _ = move(SHAPE[0] * 1e-3, SHAPE[1] * 1e-6, SHAPE[2], 1300.0)
    rng = np.random.default_rng(5)
    for k in range(40):
        folder = make(tmp_path / str(k), seed=k, scale=1 + 0.03 * rng.standard_normal())
        edit(folder, "scale_sigma = 0.01", "scale_sigma = 0.03")
        found = look(read_campaign(folder)).penetration_depth
        pulls.append((found.value - depth) / found.sigma)
    assert 0.4 < np.std(pulls) < 2.0


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('"g"', '"m/s^2"', ""),
        ("reads_at_rest = 1.0", "reads_at_rest = 0.0", "reads_at_rest"),
        ("reads_at_rest = 1.0", "reads_at_rest = 0.5", "record.reads_at_rest"),
        ('"a_g"', '"b_g"', "line 1"),
        ('"a_g"', '["a_g", "a_g"]', "record.acceleration_column"),
        ('"time_s"', '"a_g"', ""),
        ("offset_sigma = 0.05", "offset_sigma = [0.05, 0.1]", "record.offset_sigma"),
        ("scale_sigma = 0.01", "scale_sigma = -0.01", "record.scale_sigma"),
        ("sigma = 0.01", "sigma = 0.01\nwindow_s = 3", "record.window_s"),
        ("sigma = 0.01", "sigma = 0.01\nwindow_s = [3, 2]", "record.window_s"),
        ("sigma = 0.01", "sigma = 0.01\nwindow_s = [300, 400]", "record.window_s"),
        ("sigma = 0.01", "sigma = 0.01\nwindow_s = [0.001, 0.03]", "a_g"),
        ("[record]", "[camera]\nframe_rate_Hz = 1e4\n[record]", "[camera]"),
    ],
)
def test_wrong_statements_are_refused_or_odd(tmp_path: Path, old: str, new: str, key: str) -> None:
    folder = make(tmp_path)
    edit(folder, old, new)
    try:
        campaign = read_campaign(folder)
    except CampaignError as trouble:
        assert key in trouble.key
        return
    found = inspect_drop(campaign.drops[0], campaign)
    assert found.trouble is not None or found.odd


def test_damaged_records_are_odd_or_refused(tmp_path: Path) -> None:
    time, felt, contact = accelerations.make_pulse(*SHAPE)
    _, stop = move(SHAPE[0] * 1e-3, SHAPE[1] * 1e-6, SHAPE[2], 1300.0)
    inside = (time > contact + 0.3 * stop) & (time < contact + 0.4 * stop)
    for name, t, a, word in (
        ("sign", time, -felt, "turn its sign"),
        ("gap", time[~inside], felt[~inside], "missing"),
        ("cut", time[time < contact + 0.5 * stop], felt[time < contact + 0.5 * stop], "ends"),
        ("offset", time, felt + 0.4, "free flight"),
        ("late", time[time > contact + 0.2 * stop], felt[time > contact + 0.2 * stop], "no free flight"),
        ("quiet", time, 1 + 0 * felt, "no impact"),
        ("back", np.where(inside, time[::-1], time), felt, "does not rise"),
    ):
        folder = make(tmp_path / name)
        accelerations.write_record(folder / "drops" / "D01", t, a)
        try:
            campaign = read_campaign(folder)
        except CampaignError as trouble:
            assert word in trouble.message, name
            continue
        found = inspect_drop(campaign.drops[0], campaign)
        said = [*found.odd, str(found.trouble or "")]
        assert any(word in text for text in said), (name, said)


def test_the_finest_sensor_within_its_range_is_taken(tmp_path: Path) -> None:
    folder = make(tmp_path)
    time, felt, _ = accelerations.make_pulse(*SHAPE)
    top = 0.5 * felt.max()
    accelerations.write_record(
        folder / "drops" / "D01", time, felt + 0.2, np.minimum(felt, top), names="high,low"
    )
    edit(folder, '"a_g"', '["high", "low"]')
    edit(folder, "offset_sigma = 0.05", f"offset_sigma = [0.2, 0.05]\nrange = [500.0, {top}]")
    drop = read_campaign(folder).drops[0]
    record = read_acceleration(drop.record.path, drop.accelerometer)
    assert record.saturated == 0
    fine = record.sensor == 0
    assert drop.accelerometer.sensors[0].column == "low"
    np.testing.assert_allclose(record.felt[fine] / 9.81, felt[fine], atol=1e-4)
    np.testing.assert_allclose(record.felt[~fine] / 9.81, felt[~fine] + 0.2, atol=1e-4)
    assert np.all(felt[~fine] >= 0.98 * top)


def test_a_mutated_record_is_refused_or_read_never_a_traceback(tmp_path: Path) -> None:
    folder = make(tmp_path)
    record, toml = folder / "drops" / "D01" / "acceleration.csv", folder / "drops" / "D01" / "drop.toml"
    sound, stated = record.read_bytes(), toml.read_text()
    rng = random.Random(11)
    words = ["nan", "inf", "-1", "1e308", '""', "x", "0", "[1, 2]", "true", "\x00", "1e-300", '"g"']
    kinds = ["flip", "cut", "repeat", "drop", "insert", "zero"]
    refused = 0
    for k in range(300):
        record.write_bytes(sound)
        toml.write_text(stated)
        if k % 2:
            change = (
                rng.choice(["value", "key", "without", "digit", "twice"]),
                rng.random(),
                rng.choice(words),
            )
            toml.write_text(change_text(stated, change), errors="replace")
        else:
            extra = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9)))
            changes = [(rng.choice(kinds), rng.random(), extra) for _ in range(rng.randrange(1, 4))]
            record.write_bytes(change_bytes(sound, changes))
        try:
            campaign = read_campaign(folder)
            found = inspect_drop(campaign.drops[0], campaign)
            if found.trouble is None and found.numbers.get("penetration_depth_m") is not None:
                assert np.isfinite(found.numbers["penetration_depth_m"])
        except LabsimError:
            refused += 1
    assert 30 < refused < 300
