"""Imports go one way, and heavy libraries stay in the room that needs them."""

from __future__ import annotations

import ast
from pathlib import Path

import labsim

ROOT = Path(labsim.__file__).parent
FLOORS = [
    {"records", "errors", "__init__"},
    {"text_files", "extensions", "references"},
    {"tables", "tiff_pages", "tracks", "examples"},
    {"video", "ct", "sph"},  # siblings that never import each other
    {"own_keys", "calibrated", "runs"},
    {"campaign_tables", "repeated_records", "acceleration", "force"},
    {"campaign_scans", "campaign_strength"},
    {"campaign"},
    {"effects", "tracking"},
    {"inference"},
    {"diagnosis", "inspection"},
    {"report"},
    {"view", "results"},
    {"api"},
    {"cli"},
    {"__main__"},
]
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
HOME = {
    "matplotlib": "report",
    "corner": "report",
    "cv2": "video",
    "skimage": "ct",
    "emcee": "inference",
    "starlette": "view",
    "uvicorn": "view",
    "tomlkit": "view",
}


def room_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported(path: Path) -> set[str]:
    """Absolute names of everything a file imports, at any depth."""
    package = ["labsim", *path.relative_to(ROOT).parts[:-1]]
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            names.update(f"{module}.{alias.name}" for alias in node.names)
    return names


def test_every_room_has_a_floor() -> None:
    rooms = {room_of(path) for path in ROOT.rglob("*.py")}
    assert rooms <= set(FLOOR), f"give {rooms - set(FLOOR)} a floor"


def test_imports_go_one_way() -> None:
    wrong = []
    for path in ROOT.rglob("*.py"):
        here = room_of(path)
        for name in imported(path):
            parts = name.split(".")
            if parts[0] != "labsim":
                continue
            there = parts[1] if len(parts) > 1 and parts[1] in FLOOR else "__init__"
            if there != here and FLOOR[there] >= FLOOR[here]:
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong


def test_heavy_libraries_stay_at_home() -> None:
    wrong = []
    for path in ROOT.rglob("*.py"):
        for name in imported(path):
            home = HOME.get(name.split(".")[0])
            if home is not None and home != room_of(path):
                wrong.append(f"{path.relative_to(ROOT)} imports {name}, which belongs to {home}")
    assert not wrong


def test_gravity_stands_in_one_place() -> None:
    """records.py; the text that ``labsim new`` writes for people to edit shows it too."""
    found = []
    for path in [*ROOT.rglob("*.py"), *(ROOT.parent / "docs").glob("*.md")]:
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".md":  # of its recipes, which people copy
            blocks = text.split("```python\n")[1:]
            text = "\n".join(block.partition("```")[0] for block in blocks)
            numbers = ["9.81"] if "9.81" in text else []
        else:
            numbers = [
                node.value
                for node in ast.walk(ast.parse(text))
                if isinstance(node, ast.Constant) and node.value == 9.81
            ]
        found += [path.name for _ in numbers]
    assert found == ["records.py"]
