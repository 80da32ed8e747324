"""The picture of the rooms shows today's imports."""

import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from draw_rooms import describe, draw_rooms, find_imports, reduce_imports  # noqa: E402


def test_the_picture_is_that_of_today_s_imports() -> None:
    """Else: python scripts/draw_rooms.py docs/pictures/rooms.png."""
    with Image.open(ROOT / "docs" / "pictures" / "rooms.png") as picture:
        assert picture.info["Description"] == describe(reduce_imports(find_imports()))


def test_what_follows_from_other_imports_is_left_out() -> None:
    direct = {"sph": set(), "runs": {"sph"}, "inference": {"sph", "runs"}}
    assert reduce_imports(direct) == {"sph": set(), "runs": {"sph"}, "inference": {"runs"}}


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    draw_rooms(tmp_path / "rooms.png")
    assert (tmp_path / "rooms.png").stat().st_size > 10_000
