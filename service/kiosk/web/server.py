"""Listening: sockets are bound first, so that a port that is taken is waited for."""

import asyncio
import contextlib
import errno
import logging
import signal
import socket
import ssl
from collections.abc import Callable, Iterator
from ipaddress import ip_address

import structlog
import uvicorn

from denseface.service.errors import AddressError, reason_of
from denseface.service.kiosk.settings import Address
from denseface.service.kiosk.web.asgi import App
from denseface.service.kiosk.web.connections import (
    MAX_MESSAGE_BYTES,
    BoundedHttp,
    BoundedWebSocket,
)

__all__ = ["bind", "serve", "stop_signal", "url_of"]

_RETRY_S = 2.0
"""Time between two tries to have a port that another program has, seconds."""
_STOP_S = 2
"""Longest wait for answers under way when it stops, seconds: the supervisor waits for five."""
_BACKLOG = 64
"""Connections that wait to be accepted."""
_log = structlog.get_logger("kiosk")


def url_of(scheme: str, bound: socket.socket) -> str:
    """Give the URL of what listens."""
    host, port = bound.getsockname()[:2]
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}"


async def bind(address: Address, flag: str) -> socket.socket:
    """Bind; where another program has the port say so once, and try until it is free.

    Raises
    ------
    AddressError
        Where the address is none of this machine, or this user may not have the port.
    """
    said = False
    while True:
        try:
            return _bound(address)
        except OSError as error:
            where = f"{flag} {_shown(address)}"
            if error.errno != errno.EADDRINUSE:
                raise AddressError(f"{where}: {reason_of(error)}") from error
            if not said:
                said = True
                _log.warning("no page yet: another program has its port; it is waited for, or "
                             f"choose another one with {flag}", address=_shown(address))
        await asyncio.sleep(_RETRY_S)


def _shown(address: Address) -> str:
    """Give host and port as they stand in a URL."""
    host, port = address
    return f"{f'[{host}]' if ':' in host else host}:{port}"


def _bound(address: Address) -> socket.socket:
    family = socket.AF_INET6 if ip_address(address[0]).version == 6 else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
        bound.listen(_BACKLOG)
        bound.setblocking(False)
    except BaseException:
        bound.close()
        raise
    return bound


async def serve(
    app: App, bound: socket.socket, tls: ssl.SSLContext | None = None,
    http: type[BoundedHttp] = BoundedHttp, served: Callable[[], object] = lambda: None,
) -> None:
    """Serve an application on a bound socket until cancelled; `served` is called when it is.

    When cancelled, answers under way have two seconds, and pages are told that it ends.
    """
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)  # not each malformed request
    server = _Server(uvicorn.Config(
        app, http=http, ws=BoundedWebSocket, loop="asyncio", lifespan="off",
        interface="asgi3", log_config=None, access_log=False, server_header=False,
        proxy_headers=False, workers=1, backlog=_BACKLOG,
        ssl_context_factory=(lambda *_: tls) if tls else None,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_per_message_deflate=False, ws_ping_interval=10.0, ws_ping_timeout=10.0,
        timeout_keep_alive=10, timeout_graceful_shutdown=_STOP_S), served)
    serving = asyncio.create_task(server.serve([bound]))
    try:
        await asyncio.shield(serving)
    finally:
        server.should_exit = True
        await serving


class _Server(uvicorn.Server):
    """Says when it serves; signals are others' affair."""

    def __init__(self, config: uvicorn.Config, served: Callable[[], object]) -> None:
        super().__init__(config)
        self._served = served

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen, and say so."""
        await super().startup(sockets)
        if self.started:
            self._served()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals alone."""
        yield


def stop_signal() -> "asyncio.Future[signal.Signals]":
    """Give what is done when this process is told to stop."""
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[signal.Signals] = loop.create_future()

    def stop(number: signal.Signals) -> None:
        if not stopped.done():
            stopped.set_result(number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            loop.add_signal_handler(number, stop, number)
    return stopped
