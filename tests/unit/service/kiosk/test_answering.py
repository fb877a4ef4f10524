"""Whether a kiosk answers, asked of its own machine."""

import re
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from denseface.service.kiosk.answering import why_silent
from denseface.service.kiosk.settings import KioskSettings
from tests.ports import free_port


@contextmanager
def answering(status, body):
    """Answer so; gives the address, and the hosts that were asked for."""
    hosts = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            hosts.append(self.headers["Host"])
            self.send_response(status if self.path == "/healthz" else 404)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            """Say nothing."""

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield server.server_port, hosts
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_one_that_serves():
    with answering(200, b'{"serving": true, "consent": true}') as (port, hosts):
        assert why_silent(KioskSettings(address=("127.0.0.1", port))) == ""
        # Every address of a container: asked on its loopback, by a name that the page knows.
        assert why_silent(KioskSettings(address=("0.0.0.0", port),  # noqa: S104
                                        proxy=("http://localhost:1",))) == ""
    assert hosts[0] == f"127.0.0.1:{port}"
    assert hosts[1] in (f"127.0.0.1:{port}", "localhost:1")


@pytest.mark.parametrize(("status", "body", "why"), [
    (403, b"", "answers with status 403"), (200, b"hello", "what answers there is no kiosk"),
    (200, b"[]", "what answers there is no kiosk"),
    (200, b'{"serving": false}', "what answers there is no kiosk")])
def test_what_is_no_kiosk(status, body, why):
    with answering(status, body) as (port, _):
        assert why_silent(KioskSettings(address=("127.0.0.1", port))) == (
            f"http://127.0.0.1:{port}: {why}")


def test_nobody():
    address = "127.0.0.1", free_port()
    assert why_silent(KioskSettings(address=address)).endswith(": Connection refused")
    assert re.search("any free port", why_silent(KioskSettings(address=("127.0.0.1", 0))))
