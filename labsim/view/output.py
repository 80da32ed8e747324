"""An output folder on the page: its report, its pictures, and its numbers as tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".mp4": "video/mp4",
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".toml": "text/plain; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
}
MOST_FILES = 500


class OutputView:
    """A folder that a command wrote. The report comes first, then pictures, then numbers."""

    KIND = "output"
    page = "output.html"

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()

    def state(self) -> dict[str, Any]:
        order = list(TYPES)
        found = [
            path.relative_to(self.folder).as_posix()
            for path in self.folder.rglob("*")
            if path.suffix.lower() in TYPES and self.find(path.relative_to(self.folder).as_posix())
        ]
        found.sort(key=lambda name: (order.index(Path(name).suffix.lower()), name.count("/"), name))
        return {
            "kind": self.KIND,
            "name": self.folder.name,
            "files": found[:MOST_FILES],
            "left_off": max(len(found) - MOST_FILES, 0),
        }

    def find(self, name: str) -> Path | None:
        """The file of that name, None where it is not of this folder or of no kind that is shown."""
        path = (self.folder / name).resolve()
        hidden = any(part.startswith(".") for part in Path(name).parts)
        inside = self.folder in path.parents and path.is_file() and not hidden
        return path if inside and path.suffix.lower() in TYPES else None

    def close(self) -> None:
        """Nothing is held."""
