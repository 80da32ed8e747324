"""What keeps the package readable, as numbers: arguments of a function, files of a folder."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "labsim"


# one file a thing, found by listing the folder; the package itself
LONG = {"effects/catalogue", "cli", "."}


def test_no_function_takes_more_than_twelve_arguments() -> None:
    """Outside the command line, whose arguments are its options."""
    found = {}
    for file in PACKAGE.rglob("*.py"):
        if file.parent.name == "cli":
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                arguments = node.args
                found[f"{file.name}: {node.name}"] = len(
                    [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
                )
    assert not {name: count for name, count in found.items() if count > 12}


@pytest.mark.parametrize(
    "folder", sorted({file.parent for file in PACKAGE.rglob("*.py")}), ids=lambda path: path.name
)
def test_a_folder_is_seen_at_a_glance(folder: Path) -> None:
    """At most fourteen files, beside ``__init__``."""
    if folder.relative_to(PACKAGE).as_posix() not in LONG:
        assert len([file for file in folder.glob("*.py") if file.name != "__init__.py"]) <= 14


def test_a_small_file_that_one_other_uses_is_a_part_of_it() -> None:
    """Under forty lines and imported by one other module alone."""
    modules = {name_module(file): file for file in PACKAGE.rglob("*.py")}
    users: dict[str, set[str]] = {name: set() for name in modules}
    for name, file in modules.items():
        package = name if file.name == "__init__.py" else name.rpartition(".")[0]
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                above = package.split(".")[: -(node.level - 1) or None] if node.level else []
                source = ".".join([*above, *([node.module] if node.module else [])])
                for each in (*(f"{source}.{alias.name}" for alias in node.names), source):
                    if each in users:
                        users[each].add(name)
    small = {
        name for name, file in modules.items() if len(file.read_text(encoding="utf-8").splitlines()) < 40
    }
    assert not {name for name in small if len(users[name]) == 1 and modules[name].name != "__init__.py"}


def name_module(file: Path) -> str:
    return ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
