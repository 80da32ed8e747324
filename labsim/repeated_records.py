"""The same record filed twice: two drops, scans or tests that cannot both be measurements, and would count as two.

Noise never repeats, so that rows which agree to the last digit, or files which agree to the last byte, are one measurement.
"""

from __future__ import annotations

import filecmp
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .errors import CampaignError, MeasurementError
from .records import ALWAYS, Drop, Scan, StrengthTest
from .tracks import read_rows


def refuse_repeated_records(
    campaign: Path, drops: Sequence[Drop], scans: Sequence[Scan], tests: Sequence[StrengthTest]
) -> None:
    """Raise CampaignError where two drops, two scans or two strength tests are one measurement.

    Tracks are compared by their rows, whatever their frame numbers, columns, digits and line ends (one file of another program
    may hold the tracks of several drops); videos, pictures and slices byte for byte; so are the recordings of accelerometers
    whose windows overlap.
    """
    tracks: list[tuple[Path, Path, Drop]] = []
    videos: list[tuple[Path, Path, Drop]] = []
    for drop in drops:
        if drop.record.path is not None:
            toml = campaign / "drops" / drop.name / "drop.toml"
            (tracks if drop.record.kind == "track" else videos).append((toml, drop.record.path, drop))
    _compare_rows(tracks)
    _compare_files([(toml, path, _find_window(drop)) for toml, path, drop in videos], "record.file")
    slices = [(campaign / "ct" / scan.name / "scan.toml", scan.slices, ALWAYS) for scan in scans]
    _compare_files(slices, "scan.slices")
    seen: dict[tuple[tuple[float, float], ...], str] = {}
    for test in tests:
        if (earlier := seen.setdefault(test.points, test.name)) != test.name:
            toml = campaign / "strength" / test.name / "strength.toml"
            raise CampaignError(toml, "test.file", f"holds the rows of {earlier}; remove one of the two")


def _compare_rows(tracks: Sequence[tuple[Path, Path, Drop]]) -> None:
    seen: dict[bytes, tuple[Path, Path]] = {}
    for toml, path, drop in tracks:
        assert drop.camera is not None
        try:
            row = read_rows(path, drop.camera).row
        except MeasurementError as trouble:
            raise CampaignError(trouble.where, trouble.key, trouble.message) from None
        row = row[np.isfinite(row)]
        earlier = seen.setdefault(row.tobytes(), (toml, path))
        if earlier[0] != toml:
            raise _repeat(toml, "record.file", f"{path} has the same {row.size} rows as", earlier)


def _find_window(drop: Drop) -> tuple[float, float]:
    return ALWAYS if drop.accelerometer is None else drop.accelerometer.window


def _compare_files(records: Sequence[tuple[Path, Path, tuple[float, float]]], key: str) -> None:
    """Sizes first; only where all are the same, bytes, up to the first that differs. Windows apart are two records."""
    alike: dict[tuple[int, ...], list[tuple[Path, Path, tuple[float, float], list[Path]]]] = {}
    for toml, record, window in records:
        files = _list_files(record)
        same_sizes = alike.setdefault(tuple(file.stat().st_size for file in files), [])
        for earlier, earlier_record, other, earlier_files in same_sizes:
            apart = window[1] <= other[0] or other[1] <= window[0]
            if files and not apart and all(map(_same_bytes, files, earlier_files)):
                raise _repeat(toml, key, f"{record} holds the same bytes as", (earlier, earlier_record))
        same_sizes.append((toml, record, window, files))


def _repeat(toml: Path, key: str, said: str, earlier: tuple[Path, Path]) -> CampaignError:
    return CampaignError(
        toml,
        key,
        f"{said} {earlier[1]} of {earlier[0].parent.name}, and one measurement counts once; name the right record, or remove "
        "one of the two folders",
    )


def _list_files(record: Path) -> list[Path]:
    if record.is_file():
        return [record]
    return sorted(file for file in record.iterdir() if file.is_file() and not file.name.startswith("."))


def _same_bytes(one: Path, two: Path) -> bool:
    return one.samefile(two) or filecmp.cmp(one, two, shallow=False)
