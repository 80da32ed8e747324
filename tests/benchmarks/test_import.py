"""Every study still finds what it imports."""

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted(
    ".".join(file.relative_to(ROOT).with_suffix("").parts) for file in ROOT.glob("benchmarks/**/*.py")
)


@pytest.mark.parametrize("name", MODULES)
def test_a_study_imports(name: str) -> None:
    importlib.import_module(name)


def test_there_are_studies() -> None:
    assert len(MODULES) > 40
