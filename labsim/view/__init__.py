"""A record and what was found in it, on a page of this machine: looked at, corrected, measured again.

``open_path`` finds out what a path holds, ``serve`` shows it. Corrections are keys of drop.toml and scan.toml; the campaign's own
readers check them, and nothing is written until it is saved. starlette, uvicorn and tomlkit come with the extra ``view``.
"""

from __future__ import annotations

from .opening import View, open_path
from .server import make_app, serve

__all__ = ["View", "make_app", "open_path", "serve"]
