"""Accelerometers' .ide files: what they hold against the same record as a table, and what is refused."""

from __future__ import annotations

import io
import random
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path

import accelerations
import numpy as np
import pytest
from ide_files import encode_ide, write_ide
from mutations import change_bytes

from labsim.acceleration import find_impact, read_acceleration, read_accelerometer
from labsim.campaign import read_campaign
from labsim.errors import CampaignError, MeasurementError
from labsim.records import STANDARD_GRAVITY, Accelerometer, Drop
from labsim.tables import Table

pytest.importorskip("idelib")
SHAPE = (1.0, 12.0, 0.7)  # mm, mg, m/s
PULSE_TIME, PULSE, _ = accelerations.make_pulse(*SHAPE)
SOUND = encode_ide(PULSE_TIME, {"X (100g)": PULSE, "Y (100g)": -PULSE}, ranges={"X (100g)": 90})


def sense(column: object = "X (100g)", **keys: object) -> Accelerometer:
    stated = {"unit": "g", "reads_at_rest": 1.0, "sigma": 0.05, "offset_sigma": 0.05, "scale_sigma": 0.01}
    return read_accelerometer(
        Table(Path("drop.toml"), "record", {"acceleration_column": column, **stated, **keys})
    )


def make(folder: Path, column: str = '"X (100g)"', **values: object) -> Path:
    """A campaign of one drop whose record is both a table and an .ide file, which drop.toml names."""
    accelerations.write_campaign(folder, drops=[SHAPE])
    at = folder / "drops" / "D01"
    read = np.loadtxt(at / "acceleration.csv", delimiter=",", skiprows=1)
    write_ide(
        at / "acceleration.ide", read[:, 0], {"X (100g)": read[:, 1], "Y (100g)": -read[:, 1]}, **values
    )
    (at / "table.toml").write_text(text := (at / "drop.toml").read_text())
    text = text.replace("acceleration.csv", "acceleration.ide").replace('time_column = "time_s"\n', "")
    (at / "drop.toml").write_text(text.replace('"a_g"', column))
    return folder


def read_one(folder: Path) -> Drop:
    return read_campaign(folder).drops[0]


def assert_same(one: object, other: object, but: tuple[str, ...] = ()) -> None:
    for each in fields(one):  # type: ignore[arg-type]
        first, second = getattr(one, each.name), getattr(other, each.name)
        if each.name in but:
            continue
        if isinstance(first, np.ndarray | float):
            np.testing.assert_allclose(first, second, rtol=1e-9, atol=1e-12, err_msg=each.name)
        elif hasattr(first, "sigma"):
            np.testing.assert_allclose([first.value, first.sigma], [second.value, second.sigma], rtol=1e-9)
        else:
            assert first == second, each.name


def test_idelib_reads_back_what_was_put_in() -> None:
    from idelib.importer import openFile, readData

    document = openFile(io.BytesIO(SOUND))
    readData(document)
    assert {number: len(channel.children) for number, channel in document.channels.items()} == {
        8: 2,
        36: 1,
        80: 2,
    }
    for subchannel, sign in zip(document.channels[8].children, (1, -1), strict=True):
        read = subchannel.getSession().arraySlice()
        np.testing.assert_allclose(1e-6 * read[0], PULSE_TIME, rtol=1e-12)
        np.testing.assert_allclose(read[1], sign * np.round(PULSE, 5), atol=1e-9)


def test_a_record_is_the_same_as_a_table_and_as_ide(tmp_path: Path) -> None:
    folder = make(tmp_path / "c")
    found = read_one(folder)
    at = folder / "drops" / "D01"
    (at / "drop.toml").write_text((at / "table.toml").read_text())
    table = read_one(folder)
    assert found.record.path.suffix == ".ide" and table.record.path.suffix == ".csv"
    records = [read_acceleration(drop.record.path, drop.accelerometer) for drop in (found, table)]
    assert_same(*records)
    assert records[0].lost == records[0].saturated == 0
    assert_same(find_impact(records[0], found), find_impact(records[1], table))


@pytest.mark.parametrize(
    ("column", "number"),
    [("X (100g)", 1), ("8.0", 1), ("8.1", -1), ("-8.1", 1), ("-Y (100g)", 1), ("80.0", 1)],
)
def test_a_sensor_has_a_name_an_id_and_a_sign(tmp_path: Path, column: str, number: int) -> None:
    path = tmp_path / "a.ide"
    path.write_bytes(SOUND)
    record = read_acceleration(path, sense(column))
    np.testing.assert_allclose(record.felt, number * np.round(PULSE, 5) * STANDARD_GRAVITY, atol=1e-7)
    np.testing.assert_allclose(record.time, PULSE_TIME, rtol=1e-12)


def test_metres_per_second_squared_are_no_g(tmp_path: Path) -> None:
    path = write_ide(
        tmp_path / "a.ide", PULSE_TIME, {"X": STANDARD_GRAVITY * PULSE}, unit="m/s²", other=False
    )
    record = read_acceleration(path, sense("X", unit="m/s^2"))
    np.testing.assert_allclose(record.felt, STANDARD_GRAVITY * PULSE, atol=1e-5)
    with pytest.raises(
        MeasurementError, match=r'record\.unit: is "g", but \'X\' is in m/s\^2; write "m/s\^2"'
    ):
        read_acceleration(path, sense("X"))


def test_a_calibration_that_needs_the_temperature_has_it_or_is_refused(tmp_path: Path) -> None:
    path = write_ide(tmp_path / "a.ide", PULSE_TIME, {"X": PULSE}, warmth=0.01)
    record = read_acceleration(path, sense("8.0"))
    np.testing.assert_allclose(record.felt, 1.01 * np.round(PULSE, 5) * STANDARD_GRAVITY, atol=1e-7)
    write_ide(path, PULSE_TIME, {"X": PULSE}, warmth=0.01, measured=False)
    with pytest.raises(
        MeasurementError, match=r"calibrated by channel 36 \(temperature\), which has no samples"
    ):
        read_acceleration(path, sense("8.0"))


def test_ranges_stand_in_the_file_or_in_a_name_and_the_finest_sensor_comes_first(tmp_path: Path) -> None:
    folder = make(tmp_path / "c", '["-Y (100g)", "X (100g)"]', ranges={"X (100g)": 90})
    sensors = read_one(folder).accelerometer.sensors
    assert [(each.column, round(each.range / STANDARD_GRAVITY, 6)) for each in sensors] == [
        ("X (100g)", 90.0), ("-Y (100g)", 100.0),
    ]  # fmt: skip
    toml = folder / "drops" / "D01" / "drop.toml"
    toml.write_text(toml.read_text().replace("scale_sigma", "range = [20.0, 500.0]\nscale_sigma"))
    drop = read_one(folder)
    record = read_acceleration(drop.record.path, drop.accelerometer)
    assert [each.column for each in drop.accelerometer.sensors] == ["-Y (100g)", "X (100g)"]
    beyond = record.felt > 0.99 * 20.0 * STANDARD_GRAVITY
    assert beyond.any() and not record.saturated
    np.testing.assert_array_equal(record.sensor, beyond)


@pytest.mark.parametrize(
    ("column", "keys", "key", "words"),
    [
        (
            "X (50g)",
            {},
            "record.acceleration_column",
            '8.0 "X (100g)" in g, to 90 g; 8.1 "Y (100g)" in g, to 100 g',
        ),
        ("36.0", {}, "record.acceleration_column", "is no acceleration"),
        ("Temperature", {}, "record.acceleration_column", "is no acceleration"),
        (["8.0", "X (100g)"], {}, "record.acceleration_column", "names a sensor twice"),
        (
            ["8.0", "80.1"],
            {},
            "record.acceleration_column",
            "channels 8 and 80, each with a clock of its own",
        ),
        ("8.0", {"unit": "m/s^2"}, "record.unit", 'write "g"'),
        ("8.0", {"time_column": "time_s"}, "record.time_column", "remove the key"),
    ],
)
def test_what_the_file_does_not_hold_is_refused(
    tmp_path: Path, column: object, keys: dict[str, object], key: str, words: str
) -> None:
    path = tmp_path / "a.ide"
    path.write_bytes(SOUND)
    with pytest.raises(MeasurementError) as trouble:
        read_acceleration(path, sense(column, **keys))
    assert trouble.value.key == key and words in trouble.value.message and "\n" not in str(trouble.value)


def test_a_table_still_needs_the_column_of_its_time(tmp_path: Path) -> None:
    accelerations.write_record(tmp_path, PULSE_TIME, PULSE)
    with pytest.raises(MeasurementError, match=r"record\.time_column: is missing"):
        read_acceleration(tmp_path / "acceleration.csv", sense("a_g"))


def test_a_sensor_that_points_down_is_turned_by_a_minus(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=r'turn its sign: write "-8\.1"'):
        read_campaign(make(tmp_path / "down", '"8.1"'))
    assert read_one(make(tmp_path / "up", '"-8.1"')).accelerometer is not None


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"time_s,a_g\n0,1\n", "begins as no .ide file does"),
        (SOUND[:40], "does not describe its sensors"),
        (SOUND[: SOUND.index(b"made by a test")], "does not describe its sensors"),
        (
            encode_ide(PULSE_TIME, {"X (100g)": PULSE}, calibrated=False),
            "has calibration 1, which the file lacks",
        ),
        (encode_ide(PULSE_TIME, {"X (100g)": PULSE}, scale="9**9**9"), "'9**9**9' in the file"),
        (encode_ide(PULSE_TIME[:0], {"X (100g)": PULSE[:0]}), "has no samples"),
        (encode_ide(PULSE_TIME[:20], {"X (100g)": PULSE[:20]}), "has 20 samples"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.ide"
    path.write_bytes(content)
    with pytest.raises(MeasurementError) as trouble:
        read_acceleration(path, sense())
    assert words in trouble.value.message and "\n" not in str(trouble.value)


def test_files_cut_short_or_damaged_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    rng = random.Random(7)
    kinds = ["flip", "cut", "repeat", "drop", "insert", "zero"]
    contents = [SOUND[: rng.randrange(len(SOUND))] for _ in range(200)]
    header = len(encode_ide(PULSE_TIME[:0], {"X (100g)": PULSE[:0], "Y (100g)": PULSE[:0]})) / len(SOUND)
    for k in range(300):
        extra = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9)))
        reach = header if k % 2 else 1.0  # half of them where the channels are described
        changes = [(rng.choice(kinds), reach * rng.random(), extra) for _ in range(rng.randrange(1, 4))]
        contents.append(change_bytes(SOUND, changes))
    path = tmp_path / "a.ide"
    refused = 0
    for content in contents:
        path.write_bytes(content)
        begin = time.perf_counter()
        try:
            record = read_acceleration(path, sense())
            assert np.isfinite(record.felt).all() and np.all(np.diff(record.time) > 0)
        except MeasurementError as trouble:
            assert "\n" not in str(trouble) and len(str(trouble)) < 700
            refused += 1
        assert time.perf_counter() - begin < 10.0
    assert 100 < refused < 490


def test_a_record_that_was_cut_short_holds_its_whole_blocks(tmp_path: Path) -> None:
    path = tmp_path / "a.ide"
    path.write_bytes(SOUND[:-6000])
    record = read_acceleration(path, sense())
    assert record.time.size == 1500 and record.lost == 0
    np.testing.assert_allclose(record.felt, np.round(PULSE[:1500], 5) * STANDARD_GRAVITY, atol=1e-7)


def test_fifty_thousand_samples_are_read_at_once(tmp_path: Path) -> None:
    clock = 5e-5 * np.arange(50_000)
    path = write_ide(tmp_path / "a.ide", clock, {"X (100g)": np.sin(clock)}, other=False)
    begin = time.perf_counter()
    assert read_acceleration(path, sense()).time.size == 50_000
    assert time.perf_counter() - begin < 5.0


def test_without_idelib_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.ide"
    path.write_bytes(SOUND)
    monkeypatch.setitem(sys.modules, "idelib", None)
    monkeypatch.setitem(sys.modules, "idelib.importer", None)
    with pytest.raises(MeasurementError, match=r'needs idelib; install it with pip install "labsim\[ide\]"'):
        read_acceleration(path, sense())


def test_the_command_says_one_line_and_nothing_of_the_library(tmp_path: Path) -> None:
    """idelib sets up logging as it is imported, and logs of damage: neither is to be seen."""
    folder = make(tmp_path / "c")
    record = folder / "drops" / "D01" / "acceleration.ide"
    record.write_bytes(record.read_bytes()[:900])
    done = subprocess.run(
        [sys.executable, "-m", "labsim", "check", str(folder)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("error:") == 1 and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
