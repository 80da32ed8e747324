"""The documentation's site in a browser: every page whole, quiet and inside its window, wide and narrow."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WIDTHS = (1280, 400)
LOOKED_AT = ("index", "tutorial", "model", "accuracy", "api")  # by axe, one of each kind


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, env=os.environ | {"LABSIM_SITE_NOTEBOOKS": "false"})
    return folder


def test_every_page_is_whole_and_fits(site: Path, browser) -> None:  # type: ignore[no-untyped-def]
    page = browser.new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("requestfailed", lambda request: said.append(request.url))
    wrong = []
    for file in sorted(
        set(site.glob("*.html")) - {site / "404.html"}
    ):  # that one names its style from the server's root
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 900})
            page.goto(file.as_uri())
            if page.evaluate("document.documentElement.scrollWidth") > width:
                wrong.append(f"{file.stem} is wider than {width} px")
            if page.evaluate("[...document.images].some((each) => each.complete && !each.naturalWidth)"):
                wrong.append(f"{file.stem} lacks a picture")
            wide = "[...document.querySelectorAll('table')].some((t) => t.scrollWidth > t.parentElement.clientWidth + 2)"
            if width == WIDTHS[0] and page.evaluate(wide):
                wrong.append(f"{file.stem} has a table that does not fit")
    page.close()
    assert wrong == [] and said == []


def test_axe_finds_no_violation(site: Path, browser) -> None:  # type: ignore[no-untyped-def]
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    for name in LOOKED_AT:
        page.goto((site / f"{name}.html").as_uri())
        found = axe.run(page, options={"runOnly": ["wcag2a", "wcag2aa", "wcag21aa"]}).response["violations"]
        assert found == [], [(each["id"], each["nodes"][0]["html"][:200]) for each in found]
    page.close()
