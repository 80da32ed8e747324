"""The pages of the documentation at hand: listed, printed, refused."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from labsim.cli import app
from labsim.cli.docs import list_pages
from labsim.errors import LabsimError

DOCS = Path(__file__).parents[2] / "docs"


def run(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["docs", *arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def test_every_page_is_listed_with_its_heading():
    listed = run()
    for page in DOCS.glob("*.md"):
        assert (f"{page.stem} " in listed) == (not page.stem.startswith("api"))
    assert "What the simulation gets wrong" in listed


@pytest.mark.parametrize("name", ["learned-law", "learned-law.md", "docs/learned-law.md"])
def test_a_page_is_printed_as_it_stands(name):
    text = (DOCS / "learned-law.md").read_text(encoding="utf-8")
    assert run(name).strip() == text.strip()
    assert json.loads(run(name, "--json"))["text"] == text


def test_a_page_that_is_none_is_named_with_one_that_is():
    with pytest.raises(LabsimError, match="did you mean inference"):
        run("inferense")


def test_pages_that_messages_name_are_there():
    """Every docs/NAME.md in the package's sources is a page of the command."""
    pages = list_pages()
    for file in (DOCS.parent / "labsim").rglob("*.py"):
        for word in file.read_text(encoding="utf-8").split("docs/")[1:]:
            name = word.partition(".md")[0]
            if ".md" in word[:40] and name.replace("-", "").isalnum():
                assert name in pages, (file, name)
