"""What keeps the package readable, as numbers: arguments of a function, files of a folder."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "labsim"
# a kernel takes arrays and numbers only
KERNELS = {"list_neighbours"}
# one file a thing, found by listing the folder; the package itself; the solver
LONG = {"effects/catalogue", "cli", ".", "sph"}


def test_no_function_takes_more_than_twelve_arguments() -> None:
    """Outside the command line, whose arguments are its options."""
    found = {}
    for file in PACKAGE.rglob("*.py"):
        if file.parent.name == "cli":
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name not in KERNELS:
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
