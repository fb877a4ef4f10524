"""The page's server: on this machine alone, until Ctrl-C or until the page is closed."""

import asyncio
import os
import secrets
import socket
import sys
import threading
import webbrowser
from collections.abc import Sequence
from typing import Any, NamedTuple

from denseface.service.errors import UsageError, reason_of
from denseface.service.kiosk.web.guard import origins_of
from denseface.service.kiosk.web.server import serve, stop_signal
from denseface.service.runtime.terminal import complain, say
from denseface.service.view.app import view_app
from denseface.service.view.items import Item
from denseface.service.view.pages import Pages
from denseface.service.view.shelf import Shelf

__all__ = ["PageOptions", "serve_page"]

_HOST = "127.0.0.1"
_TOKEN_BYTES = 24
_BACKLOG = 64
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
"""Without one of these variables a browser would open in the terminal, on Linux."""


class PageOptions(NamedTuple):
    """How the page is served."""

    port: int = 0
    """0 takes a free one."""
    browser: bool = True
    """Whether a browser is opened."""
    once: bool = False
    """Whether it ends when the last page is closed."""


def serve_page(items: Sequence[Item], options: PageOptions) -> int:
    """Serve the page, say where, open it, and give the exit status: 0, or 128 and the signal's.

    Raises
    ------
    UsageError
        Another program has the port.
    """
    with _bound(options.port) as bound, asyncio.Runner() as runner:
        return runner.run(_serve(items, options, bound))


async def _serve(items: Sequence[Item], options: PageOptions, bound: socket.socket) -> int:
    stopped = stop_signal()
    pages = Pages()
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    port = bound.getsockname()[1]
    shelf = Shelf(items)
    app = view_app(shelf, pages, token, origins_of("http", _HOST, port), once=options.once)
    serving = asyncio.create_task(serve(app, bound))
    # While the browser starts: what is asked for first is there then.
    ahead = asyncio.create_task(shelf.told(0, items[0].head.first))
    url = f"http://{_HOST}:{port}/{token}/"
    say(url, flush=True)
    opened = options.browser and _open(url)
    if options.browser and not opened:
        complain("no screen here: open this address in a browser; from another machine after "
                 f"`ssh -L {port}:{_HOST}:{port} HOST`")
    complain("closing the page ends it, and so does Ctrl-C" if options.once else "Ctrl-C ends it")
    ends: list[asyncio.Future[Any]] = [stopped, serving]
    if options.once:
        ends.append(pages.closed)
    try:
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
    finally:
        serving.cancel()
        ahead.cancel()
        ended = await asyncio.gather(serving, ahead, return_exceptions=True)
    if isinstance(ended[0], Exception):
        raise ended[0]
    return 128 + stopped.result() if stopped.done() else 0


def _bound(port: int) -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((_HOST, port))
        bound.listen(_BACKLOG)
        bound.setblocking(False)
    except OSError as error:
        bound.close()
        raise UsageError(f"--port {port}: {reason_of(error)}") from error
    return bound


def _open(url: str) -> bool:
    """Open a browser; false where there is no screen to open it on."""
    if sys.platform == "linux" and not any(os.environ.get(name) for name in _SCREENS):
        return False
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    # Some wait until they are closed.
    threading.Thread(target=browser.open, args=(url,), daemon=True).start()
    return True
