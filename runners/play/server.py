"""The ASGI application: the page, its scripts and the socket, all below a secret path on this machine.

Scene, colours and scores are those of the explainer page. A page of another origin cannot read the token. The checks
of Host and Origin keep out a page that was told the token, or that reaches this machine by another name (DNS
rebinding).
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from runners.play.message_handler import MessageHandler, Reply
from runners.reports.explainer.write import SCRIPTS, asset

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import HTTPConnection, Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket


POLICY: Final = (
    "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# Names under which a browser may know this machine, also through a tunnel.
HOSTS = ("127.0.0.1", "localhost", "[::1]")
TAKEN_OVER = 4001  # code of the socket that is closed for another page
_HEADERS = {
    "Content-Security-Policy": POLICY,
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
ASSETS = Path(__file__).parent / "assets"
# The scripts of the explainer page, in its order, but those for a whole episode that is over
_OF_EPISODES = ("pointer.js", "timeline.js", "parameters.js", "playback.js", "keyboard.js", "main.js")
SHARED = tuple(script for script in SCRIPTS if script not in _OF_EPISODES)
OWN = (
    "live.js",
    "connection.js",
    "shapes.js",
    "tools.js",
    "layers.js",
    "settings.js",
    "selection.js",
    "results.js",
    "thoughts.js",
    "lane.js",
    "keys.js",
    "main.js",
)


def application(handler: MessageHandler, token: str) -> Starlette:
    """Return the application of one session. token: part of every path."""
    from starlette.applications import Starlette
    from starlette.responses import PlainTextResponse, Response
    from starlette.routing import Route, WebSocketRoute

    seats = _Seats(handler)

    # The page, or one of its scripts.
    async def part(request: Request) -> Response:
        if not is_own_host(request):
            return PlainTextResponse("unknown host", 421)
        page_part = PARTS.get(request.path_params.get("name", ""))
        if page_part is None:
            return PlainTextResponse("not found", 404)
        kind, content = page_part
        return Response(content(), media_type=kind, headers=_HEADERS)

    # The socket, for a page that was served from here.
    async def socket(websocket: WebSocket) -> None:
        if not (is_own_host(websocket) and is_own_origin(websocket)):
            await websocket.close(1008)
            return
        await seats.serve(websocket)

    return Starlette(
        routes=[
            Route(f"/{token}/", part),
            Route(f"/{token}/{{name}}", part),
            WebSocketRoute(f"/{token}/socket", socket),
        ]
    )


def is_own_host(connection: HTTPConnection) -> bool:
    """Return whether the browser asked for this machine; the port is ignored, since that of a tunnel may differ."""
    return _name(f"//{connection.headers.get('host', '')}") in HOSTS


def is_own_origin(connection: HTTPConnection) -> bool:
    """Return whether the page that opens a socket was served from here."""
    origin, host = connection.headers.get("origin", ""), connection.headers.get("host", "")
    return origin == f"http://{host}"


def _name(address: str) -> str:
    try:
        name = urlsplit(address).hostname or ""
    except ValueError:
        return ""
    return f"[{name}]" if ":" in name else name


class _Seats:
    """The single seat of the session: the newest page takes it, and the page that had it is told."""

    def __init__(self, handler: MessageHandler) -> None:
        self._handler = handler
        self._turn = threading.Lock()  # one message at a time
        self._seated: WebSocket | None = None

    async def serve(self, websocket: WebSocket) -> None:
        """Answer a page until it goes or another one takes the seat."""
        await websocket.accept()
        previous, self._seated = self._seated, websocket
        if previous is not None:
            await _close(previous)
        try:
            is_open = await self._reply(websocket, self._handler.welcome())
            while is_open and self._seated is websocket:
                text = await _heard(websocket)
                is_open = text is not None
                if text is not None and self._seated is websocket:
                    is_open = await self._reply(websocket, self._handler.answer(text))
        finally:
            if self._seated is websocket:
                self._seated = None

    async def _reply(self, websocket: WebSocket, replies: Iterator[Reply]) -> bool:
        """Send replies; return whether the page is still there.

        The replies are made in a thread, so that the socket stays alive meanwhile.
        """
        for reply in await asyncio.to_thread(self._encode_replies, replies):
            if not await _sent(websocket, reply):
                return False
        return True

    def _encode_replies(self, replies: Iterator[Reply]) -> list[Reply]:
        with self._turn:
            return list(replies)


async def _heard(websocket: WebSocket) -> str | None:
    """Return the next message; None if the page has gone, or has sent something other than text."""
    from starlette.websockets import WebSocketDisconnect

    try:
        return await websocket.receive_text()
    except (WebSocketDisconnect, RuntimeError, KeyError):
        return None


async def _sent(websocket: WebSocket, reply: Reply) -> bool:
    """Send a reply; return whether the page was still there."""
    from starlette.websockets import WebSocketDisconnect

    try:
        if isinstance(reply, bytes):
            await websocket.send_bytes(reply)
        else:
            await websocket.send_text(reply)
    except (WebSocketDisconnect, RuntimeError):
        return False
    return True


async def _close(websocket: WebSocket) -> None:
    with contextlib.suppress(RuntimeError):  # the page may have gone meanwhile
        await websocket.close(TAKEN_OVER)


def script() -> str:
    """Return all scripts as one, so that the shared ones need not be modules."""
    sources = [*map(asset, SHARED), *map(own, OWN)]
    return '(() => {{\n"use strict";\n{}\n}})();'.format("\n".join(sources))


def style() -> str:
    """Return the style of the explainer page, followed by what differs here."""
    return asset("style.css") + own("play.css")


def own(name: str) -> str:
    """Return the text of an asset."""
    return (ASSETS / name).read_text(encoding="utf-8")


PARTS: Final[dict[str, tuple[str, Callable[[], str]]]] = {  # by name: type, and how it is made
    "": ("text/html", lambda: own("play.html")),
    "play.js": ("text/javascript", script),
    "play.css": ("text/css", style),
}
