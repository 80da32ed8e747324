"""``labsim docs``: the pages of the documentation, printed or opened."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Annotated

import typer

from ..errors import LabsimError
from . import options


def docs(
    page: Annotated[
        str | None, typer.Argument(help="Name of a page, as inference. Default: list all pages.")
    ] = None,
    show: Annotated[
        bool, typer.Option("--open", help="Open it with this system's program for Markdown.")
    ] = False,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """List the pages of the documentation, print one, or open it."""
    pages = list_pages()
    if page is None:
        titles = {name: read_title(path) for name, path in pages.items()}
        lines = [f"{name:{max(map(len, titles))}s}  {title}" for name, title in titles.items()]
        options.finish({"pages": titles}, "\n".join(lines), as_json=as_json, quiet=quiet)
        return
    name = Path(page).name.removesuffix(".md")
    if name not in pages:
        near = difflib.get_close_matches(name, pages, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise LabsimError("labsim docs", page, f"is not a page; {hint}labsim docs lists them")
    path, text = pages[name], pages[name].read_text(encoding="utf-8")
    if show:
        typer.launch(str(path))
        text = f"opening {path}"
    options.finish({"page": name, "file": str(path), "text": text}, text, as_json=as_json, quiet=quiet)


def list_pages() -> dict[str, Path]:
    """Pages by name. An installed package has them beside its modules, a checkout in its own docs folder.

    Pages about the Python names are made by mkdocs from docstrings; ``help(labsim)`` has those.
    """
    package = Path(__file__).parents[1]
    folder = next((each for each in (package / "docs", package.parent / "docs") if each.is_dir()), None)
    if folder is None:
        raise LabsimError(
            "labsim docs", "docs", "are missing from this installation; install the package again"
        )
    return {path.stem: path for path in sorted(folder.glob("*.md")) if not path.stem.startswith("api")}


def read_title(path: Path) -> str:
    """What stands in the first heading."""
    with path.open(encoding="utf-8") as file:
        return next((line.lstrip("# ").strip() for line in file if line.startswith("# ")), path.stem)
