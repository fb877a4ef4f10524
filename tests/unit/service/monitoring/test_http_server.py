"""The HTTP server: answers, and does not mind slow or garbled clients."""

import errno
import http.client
import json
import socket
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from prometheus_client import CollectorRegistry, Gauge, make_wsgi_app
from structlog.testing import capture_logs

from denseface.service.errors import AddressError
from denseface.service.monitoring import http_server
from denseface.service.monitoring.http_server import MetricsServer
from denseface.service.runtime.parsing import parse_loopback_address
from tests.waiting import LIMIT_S, until

REPOSITORY = Path(__file__).resolve().parents[4]
REGISTRY = CollectorRegistry()
Gauge("figures", "Of a test.", registry=REGISTRY).set(1)
METRICS = make_wsgi_app(REGISTRY)


class Asked:
    """What the server asks when it is asked."""

    def __init__(self):
        self.success = True
        self.missing = []

    def health(self):
        return self.success, {"missing": self.missing}


@pytest.fixture(autouse=True, scope="module")
def _patient():
    """A machine that stands still for a while cuts nobody off, unless a test asks for that."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(http_server, "_REQUEST_S", LIMIT_S)
        yield


@pytest.fixture
def asked():
    return Asked()


@pytest.fixture
def server(asked):
    with MetricsServer(("127.0.0.1", 0), METRICS, asked.health) as server:
        yield server


def place(server):
    host, _, port = server.url.removeprefix("http://").rpartition(":")
    return host, int(port)


def get(server, path):
    connection = http.client.HTTPConnection(*place(server), timeout=LIMIT_S)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.getheader("Content-Type"), answer.read()
    finally:
        connection.close()


def raw(server, data):
    found = b""
    with socket.create_connection(place(server), timeout=LIMIT_S) as one, \
            suppress(BrokenPipeError, ConnectionResetError):  # it may hang up at any time
        try:
            one.sendall(data)
            one.shutdown(socket.SHUT_WR)
        except OSError as error:
            assert error.errno in (errno.ENOTCONN, errno.EPIPE, errno.ECONNRESET)  # noqa: PT017
        while more := one.recv(4096):
            found += more
    return found


def test_the_metrics_and_the_health(server, asked):
    status, kind, body = get(server, "/metrics")
    assert (status, body.splitlines()[-1]) == (200, b"figures 1.0")
    assert kind.startswith("text/plain; version=")
    assert get(server, "/healthz")[::2] == (200, b'{"missing": []}\n')
    asked.success, asked.missing = False, ["worker"]
    status, kind, body = get(server, "/healthz?verbose=1")
    assert (status, kind, json.loads(body)) == (503, "application/json", {"missing": ["worker"]})
    assert get(server, "/")[0] == 404


def test_other_verbs_are_not_known(server):
    assert b"501" in raw(server, b"POST /metrics HTTP/1.0\r\n\r\n").splitlines()[0]


def test_prometheus_own_format_is_given_to_who_asks_for_it(server):
    asking = b"GET /metrics HTTP/1.0\r\nAccept: application/openmetrics-text; version=1.0.0\r\n\r\n"
    assert raw(server, asking).endswith(b"\r\n\r\n# HELP figures Of a test.\n# TYPE figures gauge\n"
                                        b"figures 1.0\n# EOF\n")


def test_a_failure_is_logged_and_answered(server, asked):
    asked.missing = object()  # json cannot write it
    with capture_logs() as logged:
        assert get(server, "/healthz")[0] == 500
    assert [(one["event"], one["log_level"]) for one in logged] == [("a scrape failed", "error")]
    assert get(server, "/metrics")[0] == 200


@given(st.binary(max_size=200))
@hypothesis_settings(deadline=None, max_examples=40)
def test_garbage_ends_the_connection_alone(data):
    with MetricsServer(("127.0.0.1", 0), METRICS, Asked().health) as server:
        raw(server, data)
        assert get(server, "/metrics")[0] == 200


def test_garbage_and_endless_requests_leave_no_trace(server, capfd):
    for data in (b"", b"\r\n", b"\0" * 1000, b"GET /metrics HTTP/9.9\r\n\r\n",
                 b"GET /" + b"x" * 100_000, b"GET / HTTP/1.0\r\n" + b"a: b\r\n" * 10_000):
        raw(server, data)
    assert get(server, "/metrics")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_slow_clients_are_cut_off_and_hold_nobody_up(server, monkeypatch):
    with ExitStack() as stack:
        slow = [stack.enter_context(socket.create_connection(place(server), timeout=LIMIT_S))
                for _ in range(3)]
        for one in slow:
            one.sendall(b"GET /metr")
        assert get(server, "/metrics")[0] == 200
        monkeypatch.setattr(http_server, "_REQUEST_S", 0.1)
        for one in slow:
            assert one.recv(100) == b""


def test_a_client_that_sends_a_byte_now_and_then_is_cut_off_too(server, monkeypatch):
    monkeypatch.setattr(http_server, "_REQUEST_S", 0.5)
    with socket.create_connection(place(server), timeout=LIMIT_S) as one:
        one.settimeout(0.02)

        def is_cut_off():
            try:
                one.sendall(b"x")
                return one.recv(1) == b""
            except TimeoutError:
                return False
            except OSError:
                return True

        until(is_cut_off)


def test_more_clients_than_there_is_room_for_are_turned_away(server, monkeypatch):
    before = threading.active_count()
    with ExitStack() as stack:
        many = [stack.enter_context(socket.create_connection(place(server), timeout=LIMIT_S))
                for _ in range(30)]
        assert threading.active_count() < before + 20
        with monkeypatch.context() as patch:
            patch.setattr(http_server, "_REQUEST_S", 0.0)
            for one in many:
                with suppress(ConnectionResetError):
                    assert one.recv(100) == b""
            until(lambda: not server._opened)  # a connection has its place until it is closed
    assert get(server, "/metrics")[0] == 200


def test_a_port_in_use_is_one_line(server):
    with pytest.raises(AddressError, match=r"^--metrics 127.0.0.1:\d+: Address already in use$"):
        MetricsServer(place(server), METRICS, Asked().health)


@pytest.mark.parametrize(("given", "place"), [
    ("9400", ("127.0.0.1", 9400)), ("0", ("127.0.0.1", 0)), ("127.0.0.5:1", ("127.0.0.5", 1)),
    ("[::1]:9400", ("::1", 9400)), ("off", None), (None, None)])
def test_places(given, place):
    assert parse_loopback_address(given) == place


@pytest.mark.parametrize("given", [
    "0.0.0.0:9400", "192.168.1.1:9400", "[::]:9400", "localhost:1", "65536", "-1", "x", "", ":1",
    "١", "127.0.0.1:", "127.0.0.1"])
def test_other_places_are_refused(given):
    with pytest.raises(ValueError, match="this machine alone"):
        parse_loopback_address(given)
