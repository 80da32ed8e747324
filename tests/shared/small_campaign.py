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
    """A rendered drop and a labelled scan under several names, each a record of its own: one frame, one slice more or less."""
    for k in range(videos):
        folder = campaign / "drops" / f"V{k + 1:02d}"
        shutil.copytree(ROOT / "data" / "video" / "rendered_drops" / "mjpeg_3mm", folder)
        with (folder / "video.avi").open("ab") as stream:
            stream.write(b"JUNK\4\0\0\0" + k.to_bytes(4, "little"))  # a chunk that readers of AVI pass over
        file = folder / "drop.toml"
        file.write_text(file.read_text().replace("sequence = 11", f"sequence = {100 + k}"))
    for k in range(scans):
        scan = campaign / "ct" / f"C{k + 1:02d}"
        shutil.copytree(ROOT / "data" / "ct" / "labelled_scans" / "p01-C01", scan)
        for slice_ in sorted((scan / "slices").iterdir())[:k]:  # air far above the bead
            slice_.unlink()
    return campaign
