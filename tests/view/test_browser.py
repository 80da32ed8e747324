"""The page in headless Chromium: drawn without a word on the console, corrected by clicks and by keys alone, at 400 px too."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest
from view_pages import DROP_TOML, serving

SHOTS = os.environ.get("LABSIM_SCREENSHOTS")  # a folder, to look at


def open_page(browser, address: str, width: int = 1280, scheme: str = "light"):  # type: ignore[no-untyped-def]
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    said: list[str] = []
    page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request", lambda asked: asked.url.startswith((address, "data:", "blob:")) or said.append(asked.url)
    )
    page.goto(address, wait_until="load")
    return page, said


def wait_measured(page, times: int) -> None:  # type: ignore[no-untyped-def]
    page.wait_for_selector(
        f"html[data-state=ready][data-measurements='{times}']", state="attached", timeout=120_000
    )


def shoot(page, name: str) -> None:  # type: ignore[no-untyped-def]
    if SHOTS:
        page.screenshot(path=f"{SHOTS}/{name}.png", full_page=True)


def value(page, key: str) -> float:  # type: ignore[no-untyped-def]
    return float(page.locator(f"[id='{key}']").input_value())


def click_picture(page, column: float, row: float) -> None:  # type: ignore[no-untyped-def]
    """A click on a place of the picture, given in its own pixels."""
    box = page.locator("#picture").bounding_box()
    height = page.evaluate("() => state.shape[0]")
    zoom = box["height"] / height
    page.locator("#picture").click(position={"x": (column + 0.5) * zoom, "y": (row + 0.5) * zoom})


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_can_be_used_by_everybody(drop: Path, browser, scheme: str) -> None:  # type: ignore[no-untyped-def]
    """No violation of WCAG that axe finds: contrast, names, headings, language."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with serving(drop) as address:
        page, _said = open_page(browser, address, 1280, scheme)
        wait_measured(page, 1)
        found = axe.run(page)
        assert found.violations_count == 0, found.generate_report()


def test_a_drop_is_corrected_by_clicks(drop: Path, browser) -> None:  # type: ignore[no-untyped-def]
    file = drop / "drop.toml"
    before = file.read_text()
    with serving(drop) as address:
        page, said = open_page(browser, address)
        wait_measured(page, 1)
        assert "mm" in page.locator("#found").text_content()
        # the tip is drawn where the server says it is
        page.evaluate("() => go(20)")
        page.wait_for_selector("html[data-shown='20']", state="attached")
        green = page.evaluate(
            """() => { const f = state.measured, y = Math.round(place(f.row[20])), x = Math.round(place(f.column[20])) + 12;
            return [...document.getElementById('picture').getContext('2d').getImageData(x, y, 1, 1).data] }"""
        )
        assert green[1] > green[0] + 60
        shoot(page, "view")
        page.click("#tool-surface")
        click_picture(page, 20, 296)
        page.wait_for_selector("#save:enabled")
        assert value(page, "camera.surface_row_px") == pytest.approx(296, abs=0.6)
        page.click("#tool-scale")
        page.fill("#length", "3.0")
        click_picture(page, 20, 100)
        click_picture(page, 80, 100)
        page.wait_for_function("() => Math.abs(state.fields[2].value - 50) < 1")
        page.click("#tool-region")
        click_picture(page, 4, 2)
        click_picture(page, 120, 330)
        page.wait_for_function("() => state.region !== null")
        page.click("#leave")
        page.wait_for_function("() => state.left_out.length === 1")
        assert "measured before the last correction" in page.locator("#status").text_content()
        assert file.read_text() == before
        page.click("#measure")
        wait_measured(page, 2)
        assert page.locator("#trouble").text_content() == ""
        assert page.evaluate("() => state.measured.reason[20]") == "left out in drop.toml"
        shoot(page, "drop-corrected")
        page.click("#save")
        page.wait_for_selector("#save:disabled")
        saved = tomllib.loads(file.read_text())
        assert saved["record"]["frames_left_out"] == [20]
        assert saved["record"]["region_px"] == pytest.approx([4, 2, 120, 330], abs=1)
        assert "# by eye" in file.read_text()
        for _ in range(4):
            page.click("#undo")
        page.wait_for_selector("#undo:disabled")
        page.click("#save")
        page.wait_for_selector("#save:disabled")
        assert file.read_text() == before
        assert said == []
        page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_keys_alone_do_at_400_px(drop: Path, browser, scheme: str) -> None:  # type: ignore[no-untyped-def]
    file = drop / "drop.toml"
    before = file.read_text()
    with serving(drop) as address:
        page, said = open_page(browser, address, 400, scheme)
        wait_measured(page, 1)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
        for key, shown in (("ArrowRight", 1), ("ArrowDown", 11), ("ArrowLeft", 10), ("Home", 0)):
            page.keyboard.press(key)
            page.wait_for_selector(f"html[data-shown='{shown}']", state="attached")
        page.keyboard.press("Space")
        page.wait_for_function("() => Number(document.documentElement.dataset.shown) > 3")
        page.keyboard.press("Space")
        page.keyboard.press("2")
        for _ in range(8):
            page.keyboard.press("Control+Shift+ArrowDown")
        page.keyboard.press("Shift+ArrowUp")
        row = page.evaluate("() => cursor[1]")
        page.keyboard.press("Enter")
        page.wait_for_selector("#save:enabled")
        assert value(page, "camera.surface_row_px") == pytest.approx(row, abs=0.01)
        page.keyboard.press("x")
        page.wait_for_function("() => state.left_out.length === 1")
        page.keyboard.press("u")
        page.wait_for_function("() => state.left_out.length === 0")
        page.keyboard.press("s")
        page.wait_for_selector("#save:disabled")
        assert tomllib.loads(file.read_text())["camera"]["surface_row_px"] == pytest.approx(row, abs=0.01)
        page.keyboard.press("r")
        wait_measured(page, 2)
        page.keyboard.press("u")
        page.wait_for_selector("#save:enabled")
        page.keyboard.press("s")
        page.wait_for_selector("#save:disabled")
        assert file.read_text() == before
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
        assert said == []
        shoot(page, f"drop-400-{scheme}")
        page.close()


def test_a_track_has_its_rows_and_keys(drop: Path, browser) -> None:  # type: ignore[no-untyped-def]
    rows = "".join(f"{k + 100},{200 + 2.0 * k + 0.0981 * k * k / 2}\n" for k in range(40))
    (drop / "track.csv").write_text("frame,tip_row_px\n" + rows)
    (drop / "drop.toml").write_text(DROP_TOML.replace("video.avi", "track.csv").replace('"video"', '"track"'))
    with serving(drop) as address:
        page, said = open_page(browser, address, 400)
        wait_measured(page, 1)
        assert page.locator("#stage").is_hidden() and page.locator("#chart").is_visible()
        page.keyboard.press("ArrowRight")
        page.keyboard.press("x")
        page.wait_for_function("() => state.left_out.join() === '101'")
        page.keyboard.press("r")
        wait_measured(page, 2)
        page.keyboard.press("s")
        page.wait_for_selector("#save:disabled")
        assert tomllib.loads((drop / "drop.toml").read_text())["record"]["frames_left_out"] == [101]
        shoot(page, "track-400")
        assert said == []
        page.close()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_a_scan_is_corrected(scan: Path, browser, width: int, scheme: str) -> None:  # type: ignore[no-untyped-def]
    with serving(scan) as address:
        page, said = open_page(browser, address, width, scheme)
        wait_measured(page, 1)
        for _ in range(4):
            page.keyboard.press("ArrowDown")
        page.wait_for_selector("html[data-shown='40']", state="attached")
        assert "mm below the surface" in page.locator("#where").text_content()
        page.evaluate(
            "() => { at('map').style.width = '0'; drawMap(); drawChart(); at('map').style.width = '' }"
        )
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        shoot(page, f"scan-{width}-{scheme}")
        # the map is drawn, and a click in it goes to its slice
        box = page.locator("#map").bounding_box()
        assert box["height"] > 150
        page.locator("#map").click(position={"x": box["width"] / 2, "y": 14})
        page.wait_for_function("() => Number(document.documentElement.dataset.shown) < 10")
        page.click("#tool-air")
        click_picture(page, 12, 12)
        page.wait_for_selector("#save:enabled")
        level = page.evaluate("() => state.measured.lines[4][1]")
        assert value(page, "calibration.grey_air") == pytest.approx(float(level), rel=0.1)
        page.click("#tool-axis")
        click_picture(page, 42, 41)
        page.wait_for_function("() => state.axis !== null")
        page.click("#measure")
        wait_measured(page, 2)
        page.keyboard.press("s")
        page.wait_for_selector("#save:disabled")
        stated = tomllib.loads((scan / "scan.toml").read_text())
        assert stated["scan"]["axis_px"] == pytest.approx([42, 41], abs=0.6)
        assert said == []
        page.close()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_an_output_is_shown(output: Path, browser, width: int, scheme: str) -> None:  # type: ignore[no-untyped-def]
    with serving(output) as address:
        page, said = open_page(browser, address, width, scheme)
        page.wait_for_selector("html[data-shown='report.html']", state="attached")
        report = page.frame_locator("iframe")
        report.locator("text=drawn").wait_for()  # its own script runs, apart from the page
        page.keyboard.press("ArrowRight")
        page.wait_for_selector("td:has-text('depth.value_m')")
        assert page.locator("tr", has_text="depth.value_m").locator("td").nth(1).text_content() == "0.0015"
        page.keyboard.press("ArrowRight")
        page.wait_for_selector("th:has-text('time_s')")
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width
        shoot(page, f"output-{width}-{scheme}")
        assert said == []
        page.close()
