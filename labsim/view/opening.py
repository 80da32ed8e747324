"""What a path holds: a drop, a scan, or the output of a command."""

from __future__ import annotations

from pathlib import Path

from ..errors import LabsimError
from .drop import DropView
from .output import OutputView
from .scan import ScanView

View = DropView | ScanView | OutputView


def open_path(path: Path) -> View:
    """Open a drop folder, a video, a folder of pictures, a scan folder or an output folder. Raises LabsimError."""
    path = path.resolve()
    if not path.exists():
        raise LabsimError(
            path, "PATH", "does not exist; name a drop folder, a video, a scan folder or an output folder"
        )
    if path.name == "drop.toml" or (path / "drop.toml").is_file():
        return DropView(path)
    if path.name == "scan.toml" or (path / "scan.toml").is_file():
        return ScanView(path)
    if (path / "campaign.toml").is_file():
        raise LabsimError(path, "PATH", "is a whole campaign; name one of its drops or scans")
    if path.is_dir() and any(path.glob("*.json")):  # every command leaves a summary
        return OutputView(path)
    return DropView(path)
