"""What a report rests on: versions, the solver's hash, and a hash of every input file."""

from __future__ import annotations

import hashlib
import platform
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .. import __version__
from ..records import Campaign
from ..sph import solver_hash

PACKAGES = ("numpy", "scipy", "numba", "emcee", "scikit-image", "opencv-python-headless")
WHOLE = 64 * 1024**2  # bytes up to which a file is hashed whole; of larger ones the two ends
END = 4 * 1024**2


@dataclass(frozen=True)
class Input:
    """One file that was read, or one folder of images as a whole."""

    name: str
    bytes: int
    digest: str


@dataclass(frozen=True)
class Provenance:
    lines: list[tuple[str, str]]
    inputs: list[Input]


def trace_origin(campaign: Campaign, further: list[tuple[str, str]]) -> Provenance:
    """Versions and hashes of a campaign's report; ``further`` are lines of its own."""
    inputs = hash_inputs(campaign)
    total = hashlib.sha256("".join(f"{each.name} {each.digest}\n" for each in inputs).encode()).hexdigest()
    lines = [
        ("labsim", __version__),
        ("solver", solver_hash(campaign.material.law)),
        ("inputs, all together (SHA-256)", total),
        *further,
        ("Python", f"{platform.python_version()}, {platform.system()} {platform.machine()}"),
        ("packages", ", ".join(filter(None, map(_name_version, PACKAGES)))),
        ("written", datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")),
    ]
    return Provenance(lines, inputs)


def hash_inputs(campaign: Campaign) -> list[Input]:
    """campaign.toml, every drop.toml and scan.toml with the record it points to, effects of the campaign's own."""
    folder = campaign.folder
    paths = [folder / "campaign.toml"]
    for drop in campaign.drops:
        paths.append(folder / "drops" / drop.name / "drop.toml")
        if drop.record.path is not None:
            paths.append(drop.record.path)
    for scan in campaign.scans:
        paths += [folder / "ct" / scan.name / "scan.toml", scan.slices]
    paths += [folder / "ct" / scan.name / "scan.toml" for scan in campaign.published_scans]
    paths += sorted((folder / "effects").glob("*.py"))
    return [_hash_path(path, folder) for path in dict.fromkeys(paths) if path.exists()]


def _hash_path(path: Path, folder: Path) -> Input:
    try:
        name = path.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        name = path.name
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.is_file())
        digest = hashlib.sha256()
        for file in files:
            digest.update(f"{file.name} ".encode() + _digest(file).encode())
        return Input(
            f"{name}/ ({len(files)} files)", sum(f.stat().st_size for f in files), digest.hexdigest()
        )
    partly = " (both ends)" if path.stat().st_size > WHOLE else ""
    return Input(name + partly, path.stat().st_size, _digest(path))


def _digest(path: Path) -> str:
    size = path.stat().st_size
    digest = hashlib.sha256(str(size).encode() if size > WHOLE else b"")
    with path.open("rb") as stream:
        if size <= WHOLE:
            digest.update(stream.read())
        else:
            digest.update(stream.read(END))
            stream.seek(-END, 2)
            digest.update(stream.read(END))
    return digest.hexdigest()


def _name_version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return ""
