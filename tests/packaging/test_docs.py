"""The documentation builds without a warning, and what it points to is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda path: path.stem)
def test_a_page_is_read_in_one_sitting(page: Path) -> None:
    """At most 1200 words outside the blocks of code, and no commit outside a table."""
    text = re.sub(
        r"^```.*?^```|^(?: {4}[^\n]*\n)+",
        "",
        page.read_text(encoding="utf-8"),
        flags=re.DOTALL | re.MULTILINE,
    )
    assert len(text.split()) <= 1200
    prose = "\n".join(line for line in text.splitlines() if not line.startswith("|"))
    assert not re.search(r"\bcommit [0-9a-f]{7}\b", prose)


def test_files_named_in_the_documentation_are_there() -> None:
    """Every path in backticks that begins with a folder of the repository."""
    missing = []
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]:
        if page.name == "CHANGELOG.md":
            continue
        for name in re.findall(
            r"`((?:labsim|tests|data|docs|benchmarks|notebooks)/[\w./-]+)`", page.read_text(encoding="utf-8")
        ):
            if not (ROOT / name).exists():
                missing.append(f"{page.name}: {name}")
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "docs").glob("extend*.md")]
    recipes = {name for page in pages for name in re.findall(r"^# (labsim/\S+)", page, re.MULTILINE)}
    assert not [text for text in missing if text.split(": ")[1] not in recipes]


def test_studies_named_in_the_documentation_can_be_run() -> None:
    """Every ``python -m benchmarks.…`` of a page is a file with a main."""
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "benchmarks").rglob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages if page.name != "CHANGELOG.md")
    named = set(re.findall(r"python\s+-m (benchmarks(?:\.\w+)+)", text))
    assert len(named) > 40
    files = {name: ROOT / f"{name.replace('.', '/')}.py" for name in named}
    assert not [
        name for name, file in files.items() if not file.exists() or "__main__" not in file.read_text()
    ]


def test_the_citation_is_complete() -> None:
    yaml = pytest.importorskip("yaml")
    import labsim

    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0" and citation["version"] == labsim.__version__
    assert {"message", "title", "authors", "license", "references"} <= set(citation)
