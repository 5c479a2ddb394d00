"""`lme play`: compose a session, serve its page on this machine, and open it."""

from __future__ import annotations

import getpass
import os
import platform
import secrets
import socket
import threading
import webbrowser
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from lme.errors import InputError
from lme.requirements import install

if TYPE_CHECKING:
    from runners.config.arguments import Arguments
    from runners.config.schema import PlayConfig
    from runners.play.session import Session

HOST = "127.0.0.1"
PACKAGES = ("starlette", "uvicorn", "websockets")
_TOKEN_BYTES = 16


def check_installed() -> None:
    """Raise InputError unless the packages of the extra `play` are installed."""
    missing_packages = [name for name in PACKAGES if not _is_installed(name)]
    if missing_packages:
        raise InputError(f"lme play needs the packages {', '.join(missing_packages)}: {install(*PACKAGES)}")


def _is_installed(package: str) -> bool:
    try:
        import_module(package)
    except ImportError:
        return False
    return True


def serve(session: Session, port: int, browser: bool) -> None:
    """Serve the page until Ctrl-C. browser: whether to open it. Raises InputError if the port is taken."""
    import uvicorn

    from runners.play.message_handler import MessageHandler
    from runners.play.page_input import LONGEST_MESSAGE
    from runners.play.server import application

    # Listen first, so that the address can be printed and opened, then serve.
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    with bound(port) as listener:
        port = listener.getsockname()[1]
        address = f"http://{HOST}:{port}/{token}/"
        print("\n".join(_lines(address, port)), flush=True)
        if browser and not _is_remote():
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
        config = uvicorn.Config(
            application(MessageHandler(session), token),
            log_level="error",
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=LONGEST_MESSAGE,
            ws_per_message_deflate=False,  # the data stay on this machine
            timeout_graceful_shutdown=1,
            lifespan="off",
            server_header=False,
        )
        uvicorn.Server(config).run(sockets=[listener])


def bound(port: int) -> socket.socket:
    """Return a socket that listens on this machine only; a browser that connects before the server runs waits for it.

    Raises InputError if the port cannot be used.
    """
    if not 0 <= port < 65536:
        raise InputError(f"port is {port}: must be 1 to 65535, or 0 for any that is free")
    # asyncio sends small messages at once only over sockets that say that they are TCP; otherwise each takes 40 ms more
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise InputError(
            f"port {port} cannot be used ({error.strerror}): choose another, or port=0 for any that is free"
        ) from None
    return listener


def _lines(address: str, port: int) -> Sequence[str]:
    """Return what the terminal shows: the address and, over SSH, how to reach it from the user's own machine."""
    lines = [f"lme play: {address}"]
    if _is_remote():
        tunnel = f"ssh -N -L {port}:{HOST}:{port} {getpass.getuser()}@{platform.node()}"
        lines.append(f"You are here over SSH: on your own machine call  {tunnel}  and open the address there")
    return [*lines, "Whoever has the address can use this page; Ctrl-C ends it"]


def _is_remote() -> bool:
    return bool(os.environ.get("SSH_CONNECTION"))


def settings(arguments: Arguments) -> tuple[int, bool]:
    """Return the port, and whether to open the browser, from the words. Raises InputError for wrong values."""
    from runners.config import command_line
    from runners.config.composer import Composer

    server_words = [word for word in arguments.overrides if word.partition("=")[0] in ("port", "browser")]
    with Composer("play") as composer:
        config: PlayConfig = command_line.compose_job(composer, server_words).config
    return config.port, config.browser
