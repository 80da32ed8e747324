"""The same record filed twice: two drops or scans that cannot both be measurements, and would count as two.

Noise never repeats, so that one file under two names, or rows that agree to the last digit, are one measurement.
"""

from __future__ import annotations

import filecmp
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from .errors import CampaignError
from .records import Drop, Scan, Track
from .tracks import find_format


def refuse_repeated_files(campaign: Path, drops: Sequence[Drop], scans: Sequence[Scan]) -> None:
    """Raise CampaignError where the files of two drops or of two scans are the same, byte for byte.

    A project of another program may hold the tracks of several drops: those are told apart by their rows.
    """
    tracked = [
        (campaign / "drops" / drop.name / "drop.toml", drop.record.path)
        for drop in drops
        if drop.record.path is not None
        and not (drop.record.kind == "track" and find_format(drop.record.path))
    ]
    scanned = [(campaign / "ct" / scan.name / "scan.toml", scan.slices) for scan in scans]
    for found, key in ((tracked, "record.file"), (scanned, "scan.slices")):
        alike: dict[tuple[int, ...], list[tuple[Path, Path, list[Path]]]] = {}
        for toml, record in found:
            files = _list_files(record)
            same_sizes = alike.setdefault(tuple(file.stat().st_size for file in files), [])
            for other_toml, other_record, other_files in same_sizes:
                if all(map(_same_bytes, files, other_files)):
                    raise CampaignError(
                        toml,
                        key,
                        f"{record} holds the same bytes as {other_record} of {other_toml.parent.name}, and one measurement "
                        "counts once; name the right record, or remove one of the two folders",
                    )
            same_sizes.append((toml, record, files))


def refuse_repeated_rows(tracks: Iterable[tuple[Drop, Track]]) -> None:
    """Raise CampaignError where two tracks have the same rows, whatever their frame numbers, columns and line ends."""
    seen: dict[bytes, Drop] = {}
    for drop, track in tracks:
        row = track.tip_row[track.valid & np.isfinite(track.tip_row)]
        earlier = seen.setdefault(np.ascontiguousarray(row).tobytes(), drop)
        if earlier is not drop:
            raise CampaignError(
                drop.record.path,
                "record.file",
                f"has the same {row.size} rows as {earlier.record.path} of {earlier.name}, and one measurement counts once; "
                "name the right record, or remove one of the two folders",
            )


def _list_files(record: Path) -> list[Path]:
    if record.is_file():
        return [record]
    return sorted(file for file in record.iterdir() if file.is_file() and not file.name.startswith("."))


def _same_bytes(one: Path, two: Path) -> bool:
    return one.samefile(two) or filecmp.cmp(one, two, shallow=False)
