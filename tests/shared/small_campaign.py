"""A campaign of two drops out of a labelled one, and what can be added to it."""

from __future__ import annotations

import shutil
from pathlib import Path

ROOT = Path(__file__).parents[2]
CAMPAIGNS = ROOT / "data" / "campaigns"


def copy_campaign(target: Path, drops: tuple[str, ...] = ("D05", "D06")) -> Path:
    """Some drops of the labelled campaign p01."""
    source = CAMPAIGNS / "p01"
    target.mkdir(parents=True)
    shutil.copy(source / "campaign.toml", target)
    for name in drops:
        shutil.copytree(source / "drops" / name, target / "drops" / name)
    return target


def add_videos_and_scans(campaign: Path, videos: int = 2, scans: int = 2) -> Path:
    """The same rendered drop and the same labelled scan, under several names."""
    for k in range(videos):
        folder = campaign / "drops" / f"V{k + 1:02d}"
        shutil.copytree(ROOT / "data" / "video" / "rendered_drops" / "mjpeg_3mm", folder)
        file = folder / "drop.toml"
        file.write_text(file.read_text().replace("sequence = 11", f"sequence = {100 + k}"))
    for k in range(scans):
        shutil.copytree(
            ROOT / "data" / "ct" / "labelled_scans" / "p01-C01", campaign / "ct" / f"C{k + 1:02d}"
        )
    return campaign
