"""The documentation's site builds without a warning; in a browser every page is whole, quiet and inside its window."""

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
    """Built once, without a warning; the notebooks are pages, but do not run here: tests/notebooks runs them."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"LABSIM_SITE_NOTEBOOKS": "false"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


def test_the_site_has_every_page(site: Path) -> None:
    pages = {path.stem for path in site.glob("*.html")}
    assert {path.stem for path in (ROOT / "docs").glob("*.md")} <= pages
    assert {path.stem for path in (ROOT / "notebooks").glob("*.ipynb")} <= {
        path.stem for path in (site / "notebooks").glob("*.html")
    }
    model = (site / "model.html").read_text(encoding="utf-8")
    assert '<math xmlns="http://www.w3.org/1998/Math/MathML" display="block"' in model
    assert "arithmatex" not in model
    api = (site / "api.html").read_text(encoding="utf-8")
    for name in ("track", "reduce_scan", "simulate", "calibrate", "diagnose", "tabulate"):
        assert f'id="labsim.api.{name}"' in api


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
