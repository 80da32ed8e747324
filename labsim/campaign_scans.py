"""CT scans of a campaign, or slices that belong to none: scan.toml in, a checked Scan out. Nothing is reduced here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .campaign_tables import find_toml, list_parts, read_bead, read_sample, read_source
from .errors import CampaignError
from .records import GreyCalibration, Measured, PublishedScan, Sample, Scan
from .tables import Document, Table

SLICE_SUFFIXES = {".tif", ".tiff", ".png", ".bmp"}


def read_scan(
    path: Path | str, *, given: Mapping[str, Mapping[str, Any]] | None = None, speed_required: bool = True
) -> Scan | PublishedScan:
    """Read one CT scan: its folder or its scan.toml. Published figures instead of slices give a PublishedScan.

    given : tables of keys that stand over those of scan.toml, or in place of it where ``path`` is a stack of slices.
    Without ``speed_required`` the bead's speed may be left out (NaN): a reduction does not need it. Raises CampaignError.
    """
    path = Path(path)
    given = {name: dict(values) for name, values in (given or {}).items() if values}
    if is_stack(path):
        if not given:
            raise CampaignError(
                path, "scan.toml", "is missing; write it, see the page on the campaign folder"
            )
        home, name = path.parent, path.stem
        document = Document.of(
            Path("command line"), {**given, "scan": {"slices": path.name, **given.get("scan", {})}}
        )
    else:
        file = find_toml(path, "scan.toml")
        home, name = file.parent, file.resolve().parent.name
        document = Document(file)
        document.put(given)
    document.top()
    projectile = read_bead(document.table("projectile"))
    drop = document.table("drop", required=speed_required)
    speed = drop.measured("speed_m_s", 1e-3, 100.0, required=speed_required) or Measured(math.nan, math.nan)
    source = read_source(document)
    if document.has("published"):
        table = document.table("published")
        low = table.number("filling_factor_low", 0.01, 0.74)
        high = table.number("filling_factor_high", 0.01, 1.0)
        if high <= low:
            raise table.wrong(
                "filling_factor_high", f"{high:g} is not above filling_factor_low = {low:g}; raise it"
            )
        volume = table.measured("compacted_volume_sphere_volumes", 0.0, 100.0)
        assert volume is not None
        document.close()
        return PublishedScan(name, projectile, speed, low, high, volume, source)
    table = document.table("scan")
    slices = home / table.text("slices")
    voxel = table.number("voxel_um", 0.1, 1000.0, unit=1e-6)
    first = table.choice("first_slice", ("top", "bottom"))
    bits = table.number("bits", 8, 16, whole=True)
    if bits not in (8, 16):
        raise table.wrong("bits", f"{bits} is not 8 or 16; write the depth of the slice images")
    axis = table.numbers("axis_px", 0.0, 1e5, count=2)
    grey = document.table("calibration")
    calibration = GreyCalibration(
        grey_air=grey.number("grey_air", -70000.0, 70000.0),
        grey_per_density=grey.number("grey_per_density", 1e-6, 1e3),
        density_solid=grey.number("density_solid_kg_m3", 100.0, 23000.0),
    )
    document.close()
    _check_slices(table, slices)
    return Scan(name, projectile, speed, slices, voxel, first, bits, calibration, axis)  # type: ignore[arg-type]


def read_scans(folder: Path | str) -> tuple[Sample, tuple[Scan, ...]]:
    """Sample and scans of a campaign, without its drops. Raises CampaignError."""
    folder = Path(folder)
    read = [read_scan(path, speed_required=False) for path in list_parts(folder / "ct", "scan.toml")]
    return read_sample_alone(folder), tuple(scan for scan in read if isinstance(scan, Scan))


def read_sample_alone(folder: Path | str) -> Sample:
    """[sample] of campaign.toml and nothing else of the campaign. Raises CampaignError."""
    return read_sample(Document(Path(folder) / "campaign.toml").table("sample"))


NEEDED = {  # of a reduction: key -> table of scan.toml
    "voxel_um": "scan",
    "grey_air": "calibration",
    "grey_per_density": "calibration",
    "density_solid_kg_m3": "calibration",
    "radius_mm": "projectile",
    "mass_mg": "projectile",
}


def complete_stack(
    scan: Path, stated: Mapping[str, Mapping[str, Any]], names: Mapping[str, str]
) -> dict[str, dict[str, Any]]:
    """What was given for slices without scan.toml, with what the files themselves say; a folder with one is left as it is.

    names : of the keys of NEEDED, as the caller gives them. Raises CampaignError, which names all that is missing at once.
    """
    found = {name: dict(values) for name, values in stated.items()}
    if not is_stack(scan):
        return found
    missing = [names[key] for key, table in NEEDED.items() if key not in found.get(table, {})]
    if missing:
        raise CampaignError(
            scan, "scan.toml", f"is missing; write it beside the slices, or give {', '.join(missing)}"
        )
    from .ct import open_stack  # heavy, and only slices need it

    depth = 8 * open_stack(scan).dtype.itemsize
    found["scan"] = {"first_slice": "top", "bits": depth if depth in (8, 16) else 16, **found["scan"]}
    found["projectile"]["shape"] = "sphere"
    return found


def is_stack(path: Path) -> bool:
    """Whether a path is slices themselves: a folder without scan.toml, or a file that is no TOML."""
    return (path.is_dir() and not (path / "scan.toml").is_file()) or (
        path.is_file() and path.suffix.lower() != ".toml"
    )


def _check_slices(table: Table, slices: Path) -> None:
    """That there are slices, and none of them empty."""
    if slices.is_file():
        if slices.stat().st_size == 0:
            raise table.wrong("slices", f"{slices} is empty; put the slices there")
        return
    if not slices.is_dir():
        raise table.wrong("slices", f"{slices} is not there; name the folder or the file of the slices")
    images = sorted(item for item in slices.iterdir() if item.suffix.lower() in SLICE_SUFFIXES)
    if not images:
        files = [item.name for item in slices.iterdir() if item.is_file()]
        raise table.wrong(
            "slices",
            f"{slices} holds no TIFF, PNG or BMP image; put the slices there"
            + (f", or name the file itself ({files[0]})" if len(files) == 1 else ""),
        )
    for item in images:
        if item.stem[-1:].isdigit() and item.is_file() and item.stat().st_size == 0:
            raise table.wrong("slices", f"{item} is empty (0 bytes); export this slice again")
