"""Pictures for papers: PDF and SVG beside PNG, the same bytes from the same result, letters that stay letters."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from labsim.cli import app
from labsim.report.figures.formats import further_formats
from labsim.report.figures.style import new_figure


def draw(path: Path) -> None:
    with new_figure(path) as figure:
        figure.subplots().set_title("p_m of dust")


def test_a_picture_has_the_formats_that_were_asked_for(tmp_path: Path) -> None:
    token = further_formats.set(("pdf", "svg"))
    try:
        for name in ("first", "second"):
            (tmp_path / name).mkdir()
            draw(tmp_path / name / "fit.png")
    finally:
        further_formats.reset(token)
    for suffix, head in (("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")):
        first, second = ((tmp_path / name / f"fit.{suffix}").read_bytes() for name in ("first", "second"))
        assert first.startswith(head) and first == second
    assert "p_m of dust" in (tmp_path / "first" / "fit.svg").read_text()


@pytest.mark.parametrize(
    ("text", "there"), [("pdf", {"png", "pdf"}), ("svg, PDF", {"png", "pdf", "svg"}), (None, {"png"})]
)
def test_the_command_line_asks_for_formats(tmp_path: Path, text: str | None, there: set[str]) -> None:
    options = ["--format", text] if text else []
    drop = ["--tip-radius-mm", "0.5", "--mass-mg", "1.5", "--speed-m-s", "0.1", "--spacing-um", "125"]
    result = CliRunner().invoke(app, ["simulate", *drop, *options, "-o", str(tmp_path / "out"), "-q"])
    assert result.exit_code == 0, result.output
    pictures = sorted((tmp_path / "out").glob("*.png"))
    assert pictures
    for picture in pictures:
        beside = {path.suffix[1:] for path in picture.parent.glob(f"{picture.stem}.*")}
        assert there <= beside and beside.isdisjoint({"png", "pdf", "svg"} - there)


def test_a_format_that_is_none_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["simulate", "--format", "jpeg", "-o", str(tmp_path / "out")])
    assert result.exit_code != 0 and "jpeg" in str(result.exception)
