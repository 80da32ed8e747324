"""One self-contained HTML file: templates, style, scripts and pictures put together; no address outside it is ever asked for.

Everything that comes from a campaign is escaped by the templates; what runs is named by its hash in the page's own
Content-Security-Policy, so a script smuggled in with a name or a description would not run even if it got through.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from ... import __version__

TEMPLATES = Path(__file__).parent / "templates"
TOGETHER = re.compile(r" (?=(?:±|%|µm|mm|ms|kPa|Pa|m/s²?|mg)(?!\w))|(?<=±) ")


@dataclass(frozen=True)
class Picture:
    """A PNG inside the page. source : base64; text : its text alternative."""

    source: str
    text: str


@dataclass(frozen=True)
class Script:
    text: Markup
    kind: str = ""  # of the script element; empty for JavaScript
    id: str = ""
    runs: bool = True

    @property
    def hash(self) -> str:
        return "'sha256-" + base64.b64encode(hashlib.sha256(str(self.text).encode()).digest()).decode() + "'"


def read_picture(path: Path, text: str) -> Picture | None:
    """A picture that lies in the folder, or None."""
    if not path.is_file():
        return None
    return Picture(base64.b64encode(path.read_bytes()).decode(), text)


def write_html(path: Path, template: str, figures: Mapping[str, Any], **values: Any) -> Path:
    """Render a template of this package. figures : name -> Plotly data and layout; without any, no script is put in."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_keep_units,
    )
    environment.filters["number"] = show_number
    scripts = _scripts(figures) if figures else []
    running = " ".join(script.hash for script in scripts if script.runs) or "'none'"
    policy = (
        f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src {running}; "
        "base-uri 'none'; form-action 'none'"
    )
    text = environment.get_template(template).render(
        version=__version__,
        style=Markup((TEMPLATES / "style.css").read_text(encoding="utf-8")),
        scripts=scripts,
        policy=Markup(policy),
        **values,
    )
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.write_text(text, encoding="utf-8", newline="\n")
    os.replace(aside, path)
    return path


def _keep_units(value: Any) -> Any:
    """A number is not parted from its unit or its error at the end of a line; what is markup already stays as it is."""
    return (
        TOGETHER.sub("\u00a0", value) if isinstance(value, str) and not isinstance(value, Markup) else value
    )


def show_number(value: Any, form: str = "{:.3g}") -> str:
    """A number for people; a dash where there is none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    return form.format(value).replace("-", "−")


def _scripts(figures: Mapping[str, Any]) -> list[Script]:
    from plotly.offline import get_plotlyjs

    data = json.dumps(_plain(figures), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    data = data.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    own = (TEMPLATES / "page.js").read_text(encoding="utf-8")
    library = get_plotlyjs().replace("\r\n", "\n")
    return [
        Script(Markup(data), "application/json", "figures", runs=False),
        Script(Markup(library), "text/plain", "library"),  # started by the page's own script
        Script(Markup(own)),
    ]


def _plain(value: Any) -> Any:
    """Arrays as lists of numbers with six digits; what is not finite as null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value
