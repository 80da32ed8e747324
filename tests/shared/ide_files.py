"""Recordings as enDAQ sensors write them (.ide), made with the library and the schema that read them."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

COUNT = 1e-5  # of the file's unit: one count of a sample
TICK = 1e-6  # s, of the file's clock
BLOCK = 500  # samples


def encode_ide(
    time: np.ndarray,
    columns: dict[str, np.ndarray],
    *,
    unit: str = "g",
    ranges: dict[str, int] | None = None,
    other: bool = True,
    calibrated: bool = True,
    warmth: float | None = None,
    measured: bool = True,
    scale: str = f"1/{round(1 / TICK)}",
) -> bytes:
    """time : s, in whole ticks; columns : subchannels of channel 8, in the unit; other : with two more channels, of other clocks.

    A count is COUNT of the unit, after an offset of 1000 counts, so that only who calibrates reads what was put in. warmth : by
    which the scale grows with each degree from 20; measured : with the 21 degrees that were.
    """
    from idelib.dataset import SCHEMA_FILE, loadSchema

    names = list(columns)
    counts = np.column_stack([np.round(columns[name] / COUNT) + 1000 for name in names]).astype("<i4")
    ticks = np.round(time / TICK).astype(int)

    def describe(number: int, name: str) -> dict[str, object]:
        limits = (
            {"SubChannelRangeMin": 0, "SubChannelRangeMax": ranges[name]} if ranges and name in ranges else {}
        )
        return {
            "SubChannelID": number, "SubChannelName": name, "SubChannelCalibrationIDRef": 1, "SubChannelLabel": "Acceleration",
            "SubChannelUnits": unit, "SubChannelSensorRef": 9, **limits,
        }  # fmt: skip

    channel = {
        "ChannelID": 8, "ChannelName": "Main", "ChannelFormat": "<" + "i" * len(names), "TimeCodeScale": scale,
        "TimeCodeModulus": 1 << 32, "SubChannel": [describe(number, name) for number, name in enumerate(names)],
    }  # fmt: skip
    temperature = {
        "ChannelID": 36, "ChannelName": "Pressure/Temperature", "ChannelFormat": "<i", "TimeCodeScale": scale,
        "TimeCodeModulus": 1 << 32, "SubChannel": [{
            "SubChannelID": 0, "SubChannelName": "Temperature", "SubChannelLabel": "Temperature", "SubChannelUnits": "°C",
            "SubChannelSensorRef": 9,
        }],
    }  # fmt: skip
    fine = {
        **channel,
        "ChannelID": 80,
        "SubChannel": [describe(k, f"fine {name}") for k, name in enumerate(names)],
    }
    parts: list[tuple[str, object]] = [
        ("RecordingProperties", {
            "RecorderInfo": {"RecorderTypeUID": 256, "RecorderSerial": 1, "ProductName": "made by a test"},
            "SensorList": {"Sensor": [{"SensorID": 9, "SensorName": "accelerometer"}]},
            "ChannelList": {"Channel": [channel, temperature, fine] if other else [channel]},
        }),
    ]  # fmt: skip
    line = {"CalID": 1, "CalReferenceValue": 1000.0, "PolynomialCoef": [COUNT, 0.0]}
    plane = {
        "CalID": 1, "CalReferenceValue": 1000.0, "BivariateCalReferenceValue": 20.0, "BivariateChannelIDRef": 36,
        "BivariateSubChannelIDRef": 0, "PolynomialCoef": [COUNT * (warmth or 0.0), COUNT, 0.0, 0.0],
    }  # fmt: skip
    if calibrated:
        kind = {"UnivariatePolynomial": [line]} if warmth is None else {"BivariatePolynomial": [plane]}
        parts.insert(0, ("CalibrationList", kind))
    parts.append(("TimeBaseUTC", 1_700_000_000))
    for at in range(0, time.size, BLOCK):
        last = min(at + BLOCK, time.size) - 1
        block = {"StartTimeCodeAbs": int(ticks[at]), "EndTimeCodeAbs": int(ticks[last])}
        numbers = [8, 80] if other else [8]
        parts += [
            (
                "ChannelDataBlock",
                {"ChannelIDRef": k, **block, "ChannelDataPayload": counts[at : last + 1].tobytes()},
            )
            for k in numbers
        ]
        if other and measured:
            degrees = np.array([21], dtype="<i4").tobytes()
            parts.append(("ChannelDataBlock", {"ChannelIDRef": 36, **block, "ChannelDataPayload": degrees}))
    stream = io.BytesIO()
    loadSchema(SCHEMA_FILE).encode(stream, [{name: value} for name, value in parts], headers=True)
    return stream.getvalue()


def write_ide(path: Path, time: np.ndarray, columns: dict[str, np.ndarray], **values: object) -> Path:
    path.write_bytes(encode_ide(time, columns, **values))  # type: ignore[arg-type]
    return path
