"""A campaign folder in, a checked Campaign out.

Input: a folder as docs/campaign-format.md describes it. Output: records in SI. Nothing is computed and nothing is
written; every mistake is a CampaignError that names file, key, value and remedy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .acceleration import check_acceleration, read_accelerometer
from .campaign_scans import read_scan
from .campaign_strength import read_strength_tests
from .campaign_tables import (
    find_toml,
    list_parts,
    read_camera,
    read_material,
    read_planar,
    read_projectile,
    read_published,
    read_sample,
    read_source,
)
from .errors import CampaignError, MeasurementError
from .force import check_force, read_gauge
from .own_keys import DUST, read_motion
from .records import (
    STANDARD_GRAVITY,
    Camera,
    Campaign,
    Drop,
    PublishedScan,
    Record,
    Scan,
)
from .repeated_records import refuse_repeated_records
from .tables import Document, Table
from .tracks import read_rows


def read_campaign(folder: Path | str) -> Campaign:
    """Read and check a whole campaign folder.

    Parameters
    ----------
    folder : Path or str
        That holds campaign.toml. Records themselves are read later, when they are measured.

    Returns
    -------
    Campaign
        What the files state, in SI.

    Raises
    ------
    CampaignError
        For what cannot be used, with file, key and remedy.
    """
    folder = Path(folder)
    if not folder.exists():
        raise CampaignError(folder, "", "no such folder; give the folder that holds campaign.toml")
    if folder.name == "campaign.toml" and folder.is_file():
        folder = folder.parent
    if not folder.is_dir():
        raise CampaignError(folder, "", "is not a folder; give the folder that holds campaign.toml")
    document = Document(folder / "campaign.toml")
    top = document.top()
    if (version := top.get("format")) != 1 or isinstance(version, bool):
        raise top.wrong("format", f"{version!r} is not a format this labsim reads; write 1")
    name, description = top.text("name"), top.text("description", "")
    sample = read_sample(document.table("sample"))
    material, calibrated, p_m_range = read_material(document.table("material"), sample, folder)
    model = document.table("model", required=False)
    gravity = model.number("gravity_m_s2", 0.0, 30.0, default=STANDARD_GRAVITY)
    geometry = model.choice("geometry", ("axisymmetric", "planar"), "axisymmetric")
    planar = read_planar(document.table("planar", required=False))
    source = read_source(document)
    document.close()

    drops = tuple(read_drop(path) for path in list_parts(folder / "drops", "drop.toml"))
    if not drops:
        raise CampaignError(folder / "drops", "", "holds no drop; add drops/D01/drop.toml")
    read_scans = [read_scan(path) for path in list_parts(folder / "ct", "scan.toml")]
    scans = tuple(scan for scan in read_scans if isinstance(scan, Scan))
    _check_sequence(folder, drops)
    drops = _join_records(folder, drops)
    strength_tests = read_strength_tests(folder, sample)
    refuse_repeated_records(folder, drops, scans, strength_tests)
    for wanted in planar.calibration_drops:
        if wanted not in {drop.name for drop in drops}:
            raise CampaignError(
                folder / "campaign.toml",
                "planar.calibration_drops",
                f'"{wanted}" is not a drop; the drops are ' + ", ".join(drop.name for drop in drops),
            )
    return Campaign(
        folder=folder,
        name=name,
        description=description,
        sample=sample,
        material=material,
        p_m_range=p_m_range,
        calibrated=calibrated,
        gravity=gravity,
        geometry=geometry,  # type: ignore[arg-type]
        drops=drops,
        scans=scans,
        published_scans=tuple(scan for scan in read_scans if isinstance(scan, PublishedScan)),
        planar=planar,
        source=source,
        strength_tests=strength_tests,
    )


def read_drop(path: Path | str, *, given: Mapping[str, Mapping[str, Any]] | None = None) -> Drop:
    """Read one drop: its folder or its drop.toml. given : tables of keys that stand over those of the file.

    Raises CampaignError.
    """
    file = find_toml(Path(path), "drop.toml")
    document = Document(file)
    document.put(given or {})
    document.top()
    record_table = document.table("record")
    kind = record_table.choice("kind", ("track", "video", "acceleration", "force", "summary"))
    campaign = file.resolve().parents[2] if len(file.resolve().parents) > 2 else None
    motion = read_motion(document.table("motion", required=False), campaign, file.parent)
    projectile = read_projectile(document.table("projectile"), campaign, led=motion.kind != "free")
    drop = document.table("drop", required=kind != "summary")
    same_as = drop.text("same_as", default="")
    sequence = 0  # another record has that of its drop
    if not same_as:
        missing = {"default": 0} if kind == "summary" else {}
        sequence = drop.number("sequence", 0, 100000, whole=True, **missing)
    height = drop.measured(
        "height_mm",
        0.0,
        5000.0,
        unit=1e-3,
        required=kind in ("track", "video") and motion.kind == "free",
    )
    speed = drop.measured("impact_speed_m_s", 1e-3, 100.0, required=False) if kind != "summary" else None
    camera, published, accelerometer, gauge = None, None, None, None
    if kind == "summary":
        if document.has("camera"):
            raise CampaignError(file, "[camera]", 'does not belong to a record of kind "summary"; remove it')
        record = Record(kind="summary")
        if record_table.has("file"):
            record_table.get("file")
        published = read_published(document.table("published"), height is not None)
    elif kind == "acceleration":
        for other in ("camera", "published"):
            if document.has(other):
                raise CampaignError(
                    file, f"[{other}]", 'does not belong to a record of kind "acceleration"; remove it'
                )
        record = Record(kind="acceleration", path=_existing(record_table, file.parent, folder_allowed=False))
        accelerometer = read_accelerometer(record_table)
    elif kind == "force":
        for other in ("camera", "published"):
            if document.has(other):
                raise CampaignError(
                    file, f"[{other}]", 'does not belong to a record of kind "force"; remove it'
                )
        if motion.kind == "free":
            raise CampaignError(
                file,
                "motion.kind",
                'is "free", but a force is recorded of a push; write kind = "pushed" and speed_m_s',
            )
        record = Record(kind="force", path=_existing(record_table, file.parent, folder_allowed=False))
        gauge = read_gauge(record_table)
    else:
        if document.has("published"):
            raise CampaignError(
                file, "[published]", f'belongs to kind = "summary" only, not to "{kind}"; remove it'
            )
        camera = read_camera(document.table("camera"))
        data = _existing(record_table, file.parent, folder_allowed=kind == "video")
        record = Record(
            kind=kind,  # type: ignore[arg-type]
            path=data,
            row_sigma=record_table.number("row_sigma_px", 1e-6, 50.0, default=None),
            region=_read_region(record_table) if kind == "video" else None,
            left_out=record_table.numbers("frames_left_out", 0, 1e9, whole=True) or (),
        )
    position = _read_position(drop)
    source = read_source(document)
    document.close()
    if kind == "track":
        _check_track(record.path, camera)  # type: ignore[arg-type]
    if record.path is not None and accelerometer is not None:
        accelerometer = check_acceleration(record.path, accelerometer)
    if record.path is not None and gauge is not None:
        check_force(record.path, gauge, projectile.tip_radius)
    return Drop(
        name=file.parent.name,
        projectile=projectile,
        sequence=sequence,
        height=height,
        camera=camera,
        record=record,
        published=published,
        source=source,
        motion=motion,
        accelerometer=accelerometer,
        impact_speed=speed,
        gauge=gauge,
        position=position,
        same_as=same_as,
    )


def _read_position(table: Table) -> tuple[float, float] | None:
    """``position_m``: where a push was made, east and north."""
    found = table.get("position_m", None)
    if found is None:
        return None
    if not isinstance(found, list) or len(found) != 2:
        raise table.wrong("position_m", f"{found!r} is not a place; write east and north in m as [3.2, 10.5]")
    for value in found:
        table.check_number("position_m", value, -1e8, 1e8)
    return float(found[0]), float(found[1])


def describe_campaign(campaign: Campaign) -> dict[str, Any]:
    """What a campaign holds, as its files state it: counts, and ``text`` for people."""
    kinds: dict[str, int] = {}
    for drop in campaign.drops:
        kinds[drop.record.kind] = kinds.get(drop.record.kind, 0) + 1
    made = [drop for drop in campaign.drops if not drop.same_as]
    twice = len(campaign.drops) - len(made)
    radii = sorted({drop.projectile.tip_radius for drop in campaign.drops})
    assumed = [f"{d.name}: {d.source['assumed']}" for d in campaign.drops if d.source.get("assumed")]
    low, high = campaign.p_m_range
    lines = [
        f"{campaign.name}: {campaign.description}".rstrip(": "),
        f"  dust: filling factor {campaign.sample.filling_factor:g} ± {campaign.sample.filling_factor_sigma:g}, "
        f"{campaign.sample.diameter * 1e3:g} mm wide, {campaign.sample.depth * 1e3:g} mm deep, "
        f"gas {campaign.sample.gas_pressure:g} Pa",
        f"  model: {campaign.geometry}, gravity {campaign.gravity:g} m/s², "
        + ("" if campaign.material.law == DUST else f"law {Path(campaign.material.law).stem}, ")
        + f"{campaign.calibrated} between {low / 1e3:g} and {high / 1e3:g} kPa",
        f"  {_count(made, 'drop')} (" + ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items()))
        + (f", {twice} of them by two instruments" if twice else "") + "), tip radii "
        + ", ".join(f"{r * 1e3:g} mm" for r in radii),
        f"  {_count(campaign.scans, 'CT scan')} with slices, "
        f"{_count(campaign.published_scans, 'published compaction figure')}",
    ]  # fmt: skip
    if campaign.strength_tests:
        lines.append(f"  {_count(campaign.strength_tests, 'static strength test')}")
    if assumed:
        lines.append(
            f"  {len(assumed)} drops rest on assumed figures; each drop.toml says which and why under [source]"
        )
    return {
        "campaign": campaign.name,
        "drops": len(made),
        "kinds": kinds,
        "scans": len(campaign.scans),
        "published_scans": len(campaign.published_scans),
        "strength_tests": len(campaign.strength_tests),
        "tip_radii_m": radii,
        "assumed": assumed,
        "warnings": [],
        "text": "\n".join(lines),
    }


def _count(things: Sequence[object], noun: str) -> str:
    return f"{len(things)} {noun}{'' if len(things) == 1 else 's'}"


def _existing(table: Table, folder: Path, *, folder_allowed: bool) -> Path:
    path = folder / table.text("file")
    if not (path.is_file() or (folder_allowed and path.is_dir())):
        raise table.wrong("file", f"{path} is not there; name the record relative to {folder}")
    if path.is_file() and path.stat().st_size == 0:
        raise table.wrong("file", f"{path} is empty; put the record there")
    if path.is_dir() and not any(path.iterdir()):
        raise table.wrong("file", f"{path} is an empty folder; put the frames there")
    return path


def _read_region(table: Table) -> tuple[int, int, int, int] | None:
    found = table.numbers("region_px", 0, 1e5, count=4, whole=True)
    if found is None:
        return None
    left, top, right, bottom = found
    if right <= left or bottom <= top:
        raise table.wrong("region_px", f"{list(found)} has no area; write [left, top, right, bottom]")
    return left, top, right, bottom


def _check_track(path: Path, camera: Camera) -> None:
    """See that a track can be read and reaches below the surface, before anything is computed."""
    try:
        deepest = float(np.nanmax(read_rows(path, camera).row))
    except MeasurementError as trouble:
        raise CampaignError(trouble.where, trouble.key, trouble.message) from None
    if deepest <= camera.surface_row:
        raise CampaignError(
            path,
            "rows",
            f"the track never reaches the surface (largest row {deepest:g}, surface_row_px {camera.surface_row:g}); "
            "rows grow downwards: check surface_row_px",
        )


def _join_records(folder: Path, drops: tuple[Drop, ...]) -> tuple[Drop, ...]:
    """Give another record of a drop (``same_as``) the drop's own place in the sequence. Raises CampaignError."""
    by_name = {drop.name: drop for drop in drops}
    joined = []
    for drop in drops:
        if drop.same_as:
            file, first = folder / "drops" / drop.name / "drop.toml", by_name.get(drop.same_as)
            if first is None or first.same_as or first is drop:
                raise CampaignError(
                    file, "drop.same_as", f'"{drop.same_as}" is no other drop with a sequence of its own'
                )
            if drop.projectile != first.projectile or drop.motion != first.motion:
                raise CampaignError(
                    file, "[projectile]", f"is not that of {first.name}, of which this is another record"
                )
            if drop.record.kind == first.record.kind:
                raise CampaignError(
                    file,
                    "record.kind",
                    f'is "{drop.record.kind}" as in {first.name}; another record of a drop is by another instrument',
                )
            if drop.height is not None and first.height is not None:
                raise CampaignError(
                    file,
                    "drop.height_mm",
                    f"stands in {first.name} too, and would count twice; keep it where the camera is",
                )
            drop = replace(drop, sequence=first.sequence)
        joined.append(drop)
    return tuple(joined)


def _check_sequence(folder: Path, drops: tuple[Drop, ...]) -> None:
    seen: dict[int, str] = {}
    for drop in drops:
        if drop.sequence and drop.sequence in seen:
            raise CampaignError(
                folder / "drops" / drop.name / "drop.toml",
                "drop.sequence",
                f"{drop.sequence} is also that of {seen[drop.sequence]}; number the drops in the order they were made",
            )
        seen[drop.sequence] = drop.name
