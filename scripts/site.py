"""Hooks of the documentation's site: formulas become MathML, which browsers set by themselves, and notebooks become pages."""

from __future__ import annotations

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


@event_priority(100)  # before the plugin that turns notebooks into pages
def on_files(files, config):
    """The notebooks lie beside the documentation, not in it."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        files.append(
            File(f"notebooks/{path.name}", str(NOTEBOOKS.parent), config.site_dir, config.use_directory_urls)
        )
    return files


def on_page_content(content, page, config, files):
    """Formulas, $…$ and $$…$$ of a page, as MathML; blocks of code, which may be wider than the page, scroll by keyboard too."""
    content = content.replace("<pre>", '<pre tabindex="0">')
    return FORMULA.sub(
        lambda found: convert(
            html.unescape(found[2].strip()), display="block" if found[1] == "div" else "inline"
        ),
        content,
    )
