"""The pages in headless Chromium: nothing on the console, figures drawn, links inside work, no sideways scrolling."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

OPENS = 2.0  # s of the page's processor time until it is loaded, the wait where nothing else runs; the figures follow
SHOTS = os.environ.get("LABSIM_SCREENSHOTS")  # a folder, to look at


def open_page(browser, folder: Path, width: int, scheme: str = "light", **options):  # type: ignore[no-untyped-def]
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme, **options)
    said: list[str] = []
    page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request", lambda asked: asked.url.startswith(("file:", "data:", "blob:")) or said.append(asked.url)
    )
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    page.goto((folder / "report.html").as_uri(), wait_until="load")
    metrics = {each["name"]: each["value"] for each in session.send("Performance.getMetrics")["metrics"]}
    return page, said, metrics["ProcessTime"]


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
@pytest.mark.parametrize("name", ["none", "effect", "unknown", "calibrated"])
def test_drawn_without_a_word_on_the_console(name, width, scheme, browser, request) -> None:  # type: ignore[no-untyped-def]
    page, said, seconds = open_page(browser, request.getfixturevalue(name), width, scheme)
    assert 0.0 < seconds < OPENS
    page.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=60_000)
    places = page.locator(".plot").count()
    assert places >= 3 and page.locator(".plot[data-state=drawn] svg.main-svg >> nth=0").count() == 1
    assert page.locator(".plot[data-state=drawn]").count() == places
    sizes = page.evaluate(
        "() => [...document.querySelectorAll('.plot')].map(n => [n.clientWidth, n.clientHeight])"
    )
    assert all(150 < across <= width and down > 150 for across, down in sizes)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert said == []
    assert page.title() != "ran"
    if SHOTS:
        page.screenshot(path=f"{SHOTS}/{name}-{width}-{scheme}.png", full_page=True)
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["none", "effect", "unknown", "calibrated"])
def test_the_page_can_be_read_by_everybody(name, scheme, browser, request) -> None:  # type: ignore[no-untyped-def]
    """No violation of WCAG that axe finds: contrast, names, headings, tables, language."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page, _said, _ = open_page(browser, request.getfixturevalue(name), 1280, scheme)
    page.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=60_000)
    found = axe.run(page)
    assert found.violations_count == 0, found.generate_report()
    page.close()


def test_links_inside_work_by_keyboard(effect, browser) -> None:  # type: ignore[no-untyped-def]
    page, _said, _ = open_page(browser, effect, 1280)
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.className") == "skip"
    page.keyboard.press("Enter")
    follows = "(target) => location.hash === target"  # a moment after the key or the click
    page.wait_for_function(follows, arg="#content")
    for link in page.locator("nav a").all():
        target = link.get_attribute("href")
        link.click()
        page.wait_for_function(
            "(t) => Math.abs(document.querySelector(t).getBoundingClientRect().top) < 900", arg=target
        )
        page.wait_for_function(follows, arg=target)
    first = page.locator("details summary").first
    first.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("() => document.querySelector('details').open")
    page.close()


def test_hovering_shows_values(effect, browser) -> None:  # type: ignore[no-untyped-def]
    page, _said, _ = open_page(browser, effect, 1280)
    page.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=60_000)
    plot = page.locator(".plot[data-figure=drop0]")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.3 * box["height"])
    page.wait_for_selector(".plot[data-figure=drop0] .hoverlayer text", timeout=10_000)
    assert "mm" in page.locator(".plot[data-figure=drop0] .hoverlayer").text_content()
    page.close()


def test_without_scripts_and_on_paper_the_static_pictures_stand(effect, browser) -> None:  # type: ignore[no-untyped-def]
    context = browser.new_context(java_script_enabled=False, viewport={"width": 900, "height": 900})
    page = context.new_page()
    page.goto((effect / "report.html").as_uri())
    assert page.locator("img.static:visible").count() >= 4 and page.locator(".plot:visible").count() == 0
    context.close()
    page, _said, _ = open_page(browser, effect, 700)
    page.wait_for_selector("html[data-figures=drawn]", state="attached", timeout=60_000)
    assert page.locator("img.static:visible").count() == page.locator(".decisive img").count() == 1
    page.emulate_media(media="print", color_scheme="dark")
    assert page.locator("img.static:visible").count() >= 4 and page.locator(".plot:visible").count() == 0
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 700
    paper = page.pdf(format="A4", prefer_css_page_size=True)
    assert 50_000 < len(paper) < 5e6
    page.close()


def test_what_how_sure_why_and_what_next_are_on_the_first_screen(effect, browser) -> None:  # type: ignore[no-untyped-def]
    page, _said, _ = open_page(browser, effect, 1280)
    page.set_viewport_size({"width": 1280, "height": 800})
    for part in (".verdict", ".decisive img", ".decisive figcaption", ".tiles"):
        box = page.locator(part).first.bounding_box()
        assert box["y"] >= 0 and box["y"] + box["height"] <= 800, part
    assert "probability" in page.locator(".verdict").text_content()
    page.close()


def test_published_figures_open(published, browser) -> None:  # type: ignore[no-untyped-def]
    for width in (1280, 400):
        page, said, seconds = open_page(browser, published, width)
        assert said == []
        assert 0.0 < seconds < OPENS
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        if SHOTS:
            page.screenshot(path=f"{SHOTS}/published-{width}.png", full_page=True)
        page.close()
