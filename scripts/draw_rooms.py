"""Draw the rooms of the package that data pass, floor by floor, and what imports what.

    python scripts/draw_rooms.py docs/pictures/rooms.png

An arrow goes from a room to one that imports it. Those that follow from others are left out: where b imports a and c imports b,
no arrow goes from a to c. The arrows stand in the picture's own description, by which a test sees whether it is today's.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from test_layers import FLOOR, FLOORS, ROOT, imported, room_of

# all rooms import these, or they serve single files
LEFT_OUT = {"__init__", "__main__", "records", "errors", "text_files", "extensions", "references", "tables"}
LEFT_OUT |= {"tiff_pages", "examples", "own_keys", "calibrated", "results"}
PARTS = {"campaign_tables", "campaign_scans", "campaign_strength", "repeated_records"}  # of the campaign
WIDTH, HEIGHT = 1.9, 0.62


def find_imports() -> dict[str, set[str]]:
    """Rooms that each room imports, but for LEFT_OUT; PARTS are those of the campaign."""
    found: dict[str, set[str]] = {room: set() for room in FLOOR if room not in LEFT_OUT | PARTS}
    for path in ROOT.rglob("*.py"):
        here = "campaign" if room_of(path) in PARTS else room_of(path)
        for name in imported(path):
            parts = name.split(".")
            there = parts[1] if parts[0] == "labsim" and len(parts) > 1 else ""
            there = "campaign" if there in PARTS else there
            if here in found and there in found:
                found[here].add(there)
    return {room: others - {room} for room, others in found.items()}


def reduce_imports(direct: dict[str, set[str]]) -> dict[str, set[str]]:
    """The imports that do not follow from others."""
    reached: dict[str, set[str]] = {}
    for room in sorted(direct, key=lambda room: FLOOR[room]):
        reached[room] = direct[room].union(*(reached[other] for other in direct[room]))
    return {
        room: {a for a in others if not any(a in reached[b] for b in others if b != a)}
        for room, others in direct.items()
    }


def describe(imports: dict[str, set[str]]) -> str:
    """All arrows in one line."""
    return "; ".join(f"{room} imports {', '.join(sorted(imports[room]))}" for room in sorted(imports))


def place_rooms(imports: dict[str, set[str]]) -> dict[str, tuple[float, float]]:
    """Floors one below the other, the rooms of a floor side by side, each near what it imports."""
    rows = [sorted(set(floor) - LEFT_OUT - PARTS) for floor in FLOORS]
    at: dict[str, tuple[float, float]] = {}
    for depth, row in enumerate(row for row in rows if row):
        ordered = sorted(
            row, key=lambda room: sum(at[a][0] for a in imports[room]) / max(len(imports[room]), 1)
        )
        for k, room in enumerate(ordered):
            at[room] = (WIDTH * 1.5 * (k - (len(ordered) - 1) / 2), -1.15 * depth)
    return at


def draw_rooms(path: Path) -> None:
    imports = reduce_imports(find_imports())
    at = place_rooms(imports)
    figure, ax = plt.subplots(figsize=(7.5, 8.5), layout="constrained")
    for room, (x, y) in at.items():
        ax.add_patch(
            plt.Rectangle(
                (x - WIDTH / 2, y - HEIGHT / 2), WIDTH, HEIGHT, fc="#e8f0f7", ec="#3b6a94", zorder=2
            )
        )
        ax.text(x, y, room.replace("_", " "), ha="center", va="center", fontsize=10, zorder=3)
        for other in imports[room]:
            a, b = at[other]
            bend = 0.0 if abs(a - x) > 0.1 or b - y < 1.5 else 0.25
            ax.annotate(
                "", (x, y + HEIGHT / 2), (a, b - HEIGHT / 2),
                zorder=1, arrowprops={"arrowstyle": "-|>", "color": "0.45", "lw": 0.9, "connectionstyle": f"arc3,rad={bend}"},
            )  # fmt: skip
    ax.set(xlim=(-5.4, 5.4), ylim=(min(y for _, y in at.values()) - 0.6, 0.6))
    ax.axis("off")
    figure.savefig(path, dpi=80, metadata={"Description": describe(imports)})


if __name__ == "__main__":
    draw_rooms(Path(sys.argv[1]))
