"""A small HTTP server on loopback, in threads of its own: `/metrics` and `/healthz`."""

import json
import socket
import socketserver
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any

import structlog
from prometheus_client import CONTENT_TYPE_LATEST

from denseface.service.errors import AddressError, reason_of
from denseface.service.runtime.closing import Closing

__all__ = ["MetricsServer"]

_MOST_CLIENTS = 8
_REQUEST_S = 2.0
"""Longest time for a whole request to come and its answer to be taken, seconds."""
_MAX_REQUEST_BYTES = 16 * 1024


class MetricsServer(Closing):
    """Answers until closed; whoever is slow or talks nonsense is cut off, and nobody waits for it.

    Parameters
    ----------
    place : host and port; port 0 is any free one
    metrics : gives Prometheus' text
    health : says whether all is well, and what there is to say

    Raises
    ------
    AddressError
        Where the port cannot be had.
    """

    def __init__(
        self, place: tuple[str, int], metrics: Callable[[], bytes],
        health: Callable[[], tuple[bool, dict[str, Any]]],
    ) -> None:
        try:
            self._server = _Server(place, metrics, health)
        except OSError as error:
            raise AddressError(
                f"--metrics {place[0]}:{place[1]}: {reason_of(error)}") from error
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, name="scrape",
            daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where it listens."""
        host, port = self._server.server_address[:2]
        host = host.decode() if isinstance(host, bytes | bytearray) else host
        return f"http://{f'[{host}]' if ':' in host else host}:{port}"

    def close(self) -> None:
        """Listen no more; a client that is being answered is left to its time-out."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(socketserver.ThreadingMixIn, socketserver.TCPServer):
    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False

    def __init__(
        self, place: tuple[str, int], metrics: Callable[[], bytes],
        health: Callable[[], tuple[bool, dict[str, Any]]],
    ) -> None:
        self.address_family = socket.AF_INET6 if ":" in place[0] else socket.AF_INET
        self.metrics = metrics
        self.health = health
        self._free = threading.BoundedSemaphore(_MOST_CLIENTS)
        super().__init__(place, _Handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except BaseException:  # no thread was to be had
            self._free.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002
        structlog.get_logger("hub").exception("a scrape failed")


class _Hurried:
    """Reads lines from a socket, all of them within one time and size."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._deadline = time.monotonic() + _REQUEST_S
        self._left = _MAX_REQUEST_BYTES
        self._buffer = b""

    def readline(self, limit: int = -1) -> bytes:
        while b"\n" not in self._buffer:
            left_s = self._deadline - time.monotonic()
            if left_s <= 0 or self._left <= 0:
                raise TimeoutError
            self._connection.settimeout(left_s)
            more = self._connection.recv(min(4096, self._left))
            if not more:
                break
            self._left -= len(more)
            self._buffer += more
        line, end, self._buffer = self._buffer.partition(b"\n")
        return line + end if limit < 0 else (line + end)[:limit]

    def close(self) -> None:
        """Leave the socket to whoever opened it."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    server_version = "denseface"
    sys_version = ""

    def setup(self) -> None:
        super().setup()
        self.rfile.close()
        self.rfile = _Hurried(self.connection)  # type: ignore[assignment]

    def handle(self) -> None:
        try:
            super().handle()
        except (OSError, ValueError):
            self.close_connection = True

    def do_GET(self) -> None:
        self.connection.settimeout(_REQUEST_S)
        match self.path.partition("?")[0]:
            case "/metrics":
                self._answer(HTTPStatus.OK, CONTENT_TYPE_LATEST, self.server.metrics())
            case "/healthz":
                well, said = self.server.health()
                self._answer(HTTPStatus.OK if well else HTTPStatus.SERVICE_UNAVAILABLE,
                             "application/json", json.dumps(said).encode() + b"\n")
            case _:
                self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"/metrics or /healthz\n")

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Log nothing: a scrape every few seconds is no event."""
