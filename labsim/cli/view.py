"""``labsim view``: a record and what was found in it, on a page of this machine."""

from __future__ import annotations

import importlib.util
import threading
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from ..errors import LabsimError
from . import options

NEEDED = ("starlette", "uvicorn", "tomlkit")


def view(
    path: Annotated[
        Path,
        typer.Argument(help="Drop folder, video, folder of pictures, folder of a scan, or an output folder."),
    ],
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port on this machine. Default: a free one.")
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Look at a drop, a scan or an output, correct drop.toml or scan.toml by clicks, and measure again.

    Only this machine reaches the page, at an address with a token of its own. Nothing is written before it is saved.
    Ctrl-C ends it.
    """
    if missing := [name for name in NEEDED if importlib.util.find_spec(name) is None]:
        raise LabsimError("labsim view", ", ".join(missing), "not installed; pip install 'labsim[view]'")
    from ..view import open_path, serve

    shown = open_path(path)

    def tell(address: str) -> None:
        summary = {"url": address, "kind": shown.KIND}
        options.finish(summary, f"{address}\nCtrl-C ends it", as_json=as_json, quiet=quiet)
        if browser:  # one that draws in this terminal would keep the page from being served
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    serve(shown, port=port, ready=tell)
