"""The page's server: this machine alone reaches it, and nothing is answered without the token in the address."""

from __future__ import annotations

import json
import secrets
import socket
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from ..errors import LabsimError
from .opening import View
from .output import TYPES, OutputView
from .record import RecordView
from .scan import ScanView

HOST = "127.0.0.1"
LONGEST_BODY = 1 << 16  # bytes of a request
PAGES = {"viewer.js": "text/javascript", "output.js": "text/javascript", "style.css": "text/css"}
# the pages bring everything they need; nothing is asked of another machine
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src 'self'; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
# a report holds its own scripts: they run apart from the page and reach nothing
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
HEADERS = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}


def make_app(view: View, token: str) -> Starlette:
    """The application that shows ``view`` below ``/TOKEN/``."""

    def guarded(answer: Callable[[Request], Any], *, policy: str = POLICY) -> Callable[[Request], Any]:
        async def respond(request: Request) -> Response:
            if not secrets.compare_digest(request.path_params["token"].encode(), token.encode()):
                raise HTTPException(
                    403, "the address has another token; take the one that labsim view printed"
                )
            request.state.body = await _read_body(request)
            try:
                response = await run_in_threadpool(answer, request)
            except LabsimError as trouble:
                response = JSONResponse({"trouble": str(trouble)}, 400)
            response.headers.update({**HEADERS, "Content-Security-Policy": policy})
            return response

        return respond

    def show_page(request: Request) -> Response:
        return _send_page(view.page, "text/html")

    def show_asset(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in PAGES:
            raise HTTPException(404)
        return _send_page(name, PAGES[name])

    def show_state(request: Request) -> Response:
        return JSONResponse(view.state())

    routes = [
        Route("/{token}/", guarded(show_page)),
        Route("/{token}/state", guarded(show_state)),
        Route("/{token}/page/{name}", guarded(show_asset)),
    ]
    if isinstance(view, OutputView):

        def send_file(request: Request) -> Response:
            path = view.find(request.path_params["name"])
            if path is None:
                raise HTTPException(404)
            return FileResponse(path, media_type=TYPES[path.suffix.lower()])

        routes.append(Route("/{token}/files/{name:path}", guarded(send_file, policy=REPORT_POLICY)))
    else:
        routes += _make_record_routes(view, guarded)
    return Starlette(
        routes=routes,
        # another site's name that leads to this machine is no way in
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])],
        exception_handlers={HTTPException: _refuse},
    )


def _make_record_routes(view: RecordView, guarded: Callable[..., Any]) -> list[Route]:
    def draw(request: Request) -> Response:
        try:
            return Response(view.draw(request.path_params["number"]), media_type="image/png")
        except IndexError:
            raise HTTPException(404, "there is no such picture") from None

    def read_grey(request: Request) -> Response:
        assert isinstance(view, ScanView)
        try:
            slice_, column, row = (float(request.query_params[key]) for key in ("slice", "column", "row"))
            return JSONResponse(view.read_grey(int(slice_), column, row))
        except (KeyError, ValueError, IndexError):
            raise HTTPException(404, "there is no such place") from None

    def change(act: Callable[[Request], None]) -> Callable[[Request], Response]:
        def answer(request: Request) -> Response:
            act(request)
            return JSONResponse(view.state())

        return answer

    actions: dict[str, Callable[[Request], None]] = {
        "edit": lambda request: view.edit(_take_object(request.state.body)),
        "undo": lambda request: view.undo(),
        "save": lambda request: view.save(),
        "measure": lambda request: view.measure(),
    }
    routes = [
        Route(f"/{{token}}/{name}", guarded(change(act)), methods=["POST"]) for name, act in actions.items()
    ]
    routes.append(Route("/{token}/picture/{number:int}", guarded(draw)))
    if isinstance(view, ScanView):
        routes.append(Route("/{token}/grey", guarded(read_grey)))
    return routes


async def _read_body(request: Request) -> bytes:
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > LONGEST_BODY:
            raise HTTPException(413, "the request is too long")
    return body


def _take_object(body: bytes) -> dict[str, Any]:
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise HTTPException(400, "the request is no JSON object")
    return found


def _send_page(name: str, kind: str) -> Response:
    return Response((files(__package__) / "pages" / name).read_bytes(), media_type=f"{kind}; charset=utf-8")


def _refuse(request: Request, trouble: Exception) -> Response:
    assert isinstance(trouble, HTTPException)
    return JSONResponse({"trouble": trouble.detail}, trouble.status_code, headers=HEADERS)


def serve(view: View, *, port: int = 0, ready: Callable[[str], None]) -> None:
    """Show a view until Ctrl-C. port : 0 takes a free one. ready : called with the address once it answers.

    Raises LabsimError where the port is taken.
    """
    token = secrets.token_urlsafe(16)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listening:
        try:
            listening.bind((HOST, port))
        except OSError as trouble:
            raise LabsimError(
                "command line", "--port", f"{port} cannot be used ({trouble.strerror}); leave it out"
            ) from None
        listening.listen()
        ready(f"http://{HOST}:{listening.getsockname()[1]}/{token}/")
        settings = uvicorn.Config(
            make_app(view, token), log_level="error", access_log=False, timeout_graceful_shutdown=1
        )
        try:
            uvicorn.Server(settings).run(sockets=[listening])
        except KeyboardInterrupt:  # how the page is closed
            pass
        finally:
            view.close()
