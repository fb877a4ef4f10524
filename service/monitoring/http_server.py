"""A small HTTP server on loopback, in threads of its own: `/metrics` and `/healthz`."""

import json
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from http import HTTPStatus
from socketserver import TCPServer, ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer
from wsgiref.types import StartResponse, WSGIApplication, WSGIEnvironment

import structlog

from denseface.service.errors import AddressError, reason_of

__all__ = ["MetricsServer"]

_MAX_CONNECTIONS = 8
"""Connections at a time; further ones are closed at once."""
_REQUEST_S = 2.0
"""Longest time for a request to come and its answer to be taken, seconds."""
_POLL_S = 0.1
"""Interval at which overdue connections are looked for, seconds."""


class MetricsServer(ThreadingMixIn, WSGIServer):
    """Answers until its `with` block ends; slow clients are cut off, and nobody waits for them.

    Parameters
    ----------
    address : host and port; port 0 is any free one
    metrics : answers `/metrics`
    health : says whether all is well, and what `/healthz` shows as JSON

    Raises
    ------
    AddressError
        Where the port cannot be had.
    """

    daemon_threads = True
    block_on_close = False

    def __init__(
        self, address: tuple[str, int], metrics: WSGIApplication,
        health: Callable[[], tuple[bool, dict[str, Any]]],
    ) -> None:
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        self._metrics = metrics
        self._health = health
        self._opened: dict[Any, float] = {}
        """Connection -> when it was accepted, seconds of `time.monotonic`."""
        try:
            super().__init__(address, _Handler)
        except OSError as error:
            raise AddressError(
                f"--metrics {address[0]}:{address[1]}: {reason_of(error)}") from error
        self.set_app(self._answer)
        self._thread = threading.Thread(
            target=self.serve_forever, args=(_POLL_S,), name="metrics", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where it listens."""
        host = self.server_name
        return f"http://{f'[{host}]' if ':' in host else host}:{self.server_port}"

    def __exit__(self, *_: object) -> None:
        """Listen no more and cut every connection."""
        self.shutdown()
        self.server_close()
        self._thread.join()
        self._cut(opened_before=time.monotonic())

    def server_bind(self) -> None:
        """Bind without asking the resolver for the host's name, as `HTTPServer` does."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), self.server_address[1]
        self.setup_environ()

    def service_actions(self) -> None:
        """Cut overdue connections."""
        self._cut(opened_before=time.monotonic() - _REQUEST_S)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread of its own, where there is room."""
        if len(self._opened) >= _MAX_CONNECTIONS:
            self.shutdown_request(request)
            return
        self._opened[request] = time.monotonic()
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self._opened.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002
        """Log what went wrong, unless it is the connection."""
        if not isinstance(sys.exception(), OSError):
            structlog.get_logger("hub").exception("a scrape failed")

    def _cut(self, opened_before: float) -> None:
        for connection, opened in self._opened.copy().items():
            if opened <= opened_before:
                with suppress(OSError):  # closed meanwhile
                    connection.shutdown(socket.SHUT_RDWR)

    def _answer(self, environ: WSGIEnvironment, start: StartResponse) -> Iterable[bytes]:
        kind = "text/plain"
        try:
            match environ["REQUEST_METHOD"], environ["PATH_INFO"]:
                case "GET", "/metrics":
                    return self._metrics(environ, start)
                case "GET", "/healthz":
                    healthy, report = self._health()
                    status = HTTPStatus.OK if healthy else HTTPStatus.SERVICE_UNAVAILABLE
                    kind, body = "application/json", json.dumps(report)
                case "GET", _:
                    status, body = HTTPStatus.NOT_FOUND, "/metrics or /healthz"
                case _:
                    status, body = HTTPStatus.NOT_IMPLEMENTED, "expected GET"
        except Exception:
            structlog.get_logger("hub").exception("a scrape failed")
            status, body = HTTPStatus.INTERNAL_SERVER_ERROR, "the hub's log says why"
        start(f"{status} {status.phrase}", [("Content-Type", kind), ("Cache-Control", "no-store")])
        return [body.encode() + b"\n"]


class _Handler(WSGIRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Log nothing: a scrape every few seconds is no event."""
