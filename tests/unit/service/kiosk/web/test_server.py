"""The server itself: who is cut off, how it ends, and what it does without its port."""

import asyncio
import contextlib
import socket
import ssl
import subprocess
import time

import pytest
from structlog.testing import capture_logs
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from denseface.service.errors import AddressError
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.web import connections, server
from denseface.service.kiosk.web.app import kiosk_app, kiosk_files
from denseface.service.kiosk.web.guard import origins_of
from denseface.service.kiosk.web.server import bind, serve, url_of
from tests.waiting import LIMIT_S


async def echo(socket):
    await socket.accept()
    while True:
        text = await socket.receive_text()
        await socket.send_text(str(len(text)))


@contextlib.asynccontextmanager
async def serving(endpoint=echo, tls=None):
    """Serve a page, give its URL."""
    bound = await bind(("127.0.0.1", 0), "--kiosk-address")
    scheme = "https" if tls else "http"
    url = url_of(scheme, bound)
    app = kiosk_app(endpoint, origins_of(scheme, *bound.getsockname()),
                    kiosk_files())
    task = asyncio.create_task(serve(app, bound, tls))
    try:
        yield url
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.wait_for(task, LIMIT_S)


def run(main):
    asyncio.run(asyncio.wait_for(main(), LIMIT_S))


def _address(url):
    host, port = url.rpartition("/")[2].split(":")
    return host, int(port)


async def opened(url):
    return await asyncio.open_connection(*_address(url))


async def said(url, request):
    """Send bytes and give all that comes until the other side closes."""
    reader, writer = await opened(url)
    writer.write(request)
    try:
        return await reader.read()
    except ConnectionResetError:
        return b""
    finally:
        await closed(writer)


async def closed(writer):
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


def request_to(url, head="GET /healthz HTTP/1.1", *lines):
    return "\r\n".join([head, f"Host: {url.rpartition('/')[2]}", *lines, "Connection: close", "",
                        ""]).encode()


def web_socket(url, **named):
    return connect(url.replace("http", "ws", 1) + "/ws", origin=url, compression=None, **named)


def test_it_says_nothing_of_itself_and_answers_what_is_whole():
    async def main():
        async with serving() as url:
            answer = await said(url, request_to(url))
            assert answer.startswith(b"HTTP/1.1 200 ")
            assert b"\r\nserver:" not in answer.lower()
            assert b"content-security-policy: default-src 'none'" in answer
    run(main)


MALFORMED = [
    ("GET /healthz HTTP/1.1", "Host: 127.0.0.1"),  # a second one
    ("GET /healthz HTTP/1.1", "Content-Length: 1", "Content-Length: 2"),
    ("GET /healthz HTTP/1.1", "Transfer-Encoding: gzip, chunked"),
    ("POST / HTTP/1.1", "Content-Length: 5", "Transfer-Encoding: chunked"),
    ("GET /healthz HTTP/1.1", "X: " + "a" * 20_000),
    ("GET /healthz HTTP/1.1", *["X: a"] * 5000),
    ("GET /" + "a" * 20_000 + " HTTP/1.1",),
    ("GET  /healthz  HTTP/1.1",), ("GET /healthz",), ("\x00\x01\x02",),
    ("GET /healthz HTTP/1.1", "Bad Header: x"), ("GET /healthz HTTP/1.1", "X : y"),
    ("GET /healthz HTTP/1.1", " folded"), ("CONNECT evil.example:443 HTTP/1.1",),
    ("GET http://evil.example/healthz HTTP/1.1", "Host: evil.example"),
    ("TRACE /healthz HTTP/1.1",), ("DELETE /healthz HTTP/1.1",), ("OPTIONS * HTTP/1.1",),
    ("PRI * HTTP/2.0", "", "SM")]


def test_what_is_malformed_or_smuggled_gets_nothing():
    async def main():
        async with serving() as url:
            for lines in MALFORMED:
                answer = await said(url, request_to(url, *lines))
                status = answer.partition(b"\r\n")[0]
                assert status == b"" or status.split()[1] in (
                    b"400", b"403", b"405", b"413", b"431"), (lines, status)
                assert answer.count(b"HTTP/1.1 ") <= 1
                assert b"evil" not in answer
            assert b" 200 " in await said(url, request_to(url))
    run(main)


def test_who_does_not_ask_in_time_is_cut_off(monkeypatch):
    monkeypatch.setattr(connections, "_ASK_S", 0.2)

    async def main():
        async with serving() as url:
            host = url.rpartition("/")[2]
            for begun in (b"", b"G", f"GET /healthz HTTP/1.1\r\nHost: {host}\r\nX: ".encode(),
                          f"POST /healthz HTTP/1.1\r\nHost: {host}\r\nOrigin: {url}\r\n"
                          "Content-Length: 9\r\n\r\nabc".encode()):
                assert b" 200 " not in await said(url, begun)
    run(main)


def test_a_connection_may_ask_again_and_is_closed_when_it_does_not(monkeypatch):
    monkeypatch.setattr(connections, "_ASK_S", 0.2)

    async def main():
        async with serving() as url:
            reader, writer = await opened(url)
            for _ in range(3):
                writer.write(request_to(url).replace(b"Connection: close\r\n", b""))
                assert b" 200 " in await reader.readuntil(b"}")
            assert await reader.read() == b""
            await closed(writer)
    run(main)


def test_who_does_not_listen_is_cut_off(monkeypatch, tmp_path):
    from denseface.service.kiosk.web import app as module

    monkeypatch.setattr(connections, "_ANSWER_S", 0.2)
    monkeypatch.setattr(module, "STATIC", tmp_path)
    (tmp_path / "large.js").write_bytes(bytes(15 * 2**20))
    lost = connections.BoundedHttp.connection_lost

    async def main():
        cut = asyncio.Event()
        monkeypatch.setattr(connections.BoundedHttp, "connection_lost",
                            lambda self, exc: (lost(self, exc), cut.set()))
        async with serving() as url:
            with socket.create_connection(_address(url)) as reader:
                reader.sendall(request_to(url, "GET /static/large.js HTTP/1.1"))
                reader.setblocking(False)
                await cut.wait()
                loop, length = asyncio.get_running_loop(), 0
                with contextlib.suppress(ConnectionResetError):
                    while got := await loop.sock_recv(reader, 2**20):
                        length += len(got)
                assert 0 < length < 15 * 2**20
    run(main)


def test_connections_are_bounded_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 20)

    async def main():
        async with serving() as url, web_socket(url) as page:
            idle = await asyncio.gather(*(opened(url) for _ in range(60)))
            cut = sum(await asyncio.gather(*(_is_closed(one) for one, _ in idle)))
            assert cut >= 60 - 20
            await page.send("abc")
            assert await page.recv() == "3"
            for _, writer in idle:
                await closed(writer)
            while b" 200 " not in await said(url, request_to(url)):
                await asyncio.sleep(0.05)
    run(main)


async def _is_closed(reader):
    try:
        return await asyncio.wait_for(reader.read(1), 0.5) == b""
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True


@pytest.mark.parametrize("pieces", [["x" * 5000], ["x" * 1500] * 4])
def test_a_message_that_is_too_long_ends_the_connection(pieces):
    async def main():
        async with serving() as url, web_socket(url) as page:
            await page.send("x" * 4096)
            assert await page.recv() == "4096"
            await page.send(pieces)
            with pytest.raises(ConnectionClosed) as ended:
                await page.recv()
            assert ended.value.rcvd.code == 1009
    run(main)


async def handshake(url):
    """Open a WebSocket by hand, and give it once it is accepted."""
    reader, writer = await opened(url)
    writer.write(request_to(
        url, "GET /ws HTTP/1.1", f"Origin: {url}", "Upgrade: websocket", "Connection: Upgrade",
        "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==",
    ).replace(b"Connection: close\r\n", b""))
    assert b" 101 " in await reader.readuntil(b"\r\n\r\n")
    return reader, writer


@pytest.mark.parametrize(("begun", "again"), [
    (b"\x01\x80abcd", b"\x00\x80abcd"),  # a message of empty fragments without an end
    (b"", b"\x89\xfdabcd" + bytes(125)),  # pings, whose answers nobody takes
])
def test_what_has_no_end_and_no_length_ends_the_connection(begun, again, monkeypatch):
    monkeypatch.setattr(connections, "_MAX_UNTAKEN_BYTES", 2**20)

    async def main():
        async with serving() as url:
            reader, writer = await handshake(url)
            writer.write(begun)
            answered = b""
            with contextlib.suppress(OSError):
                for _ in range(300):
                    writer.write(again * 1000)
                    await writer.drain()
                answered = await reader.read()
            assert b"keepalive" not in answered  # which would end it in the end
            await closed(writer)
            assert b" 200 " in await said(url, request_to(url))
    run(main)


def test_a_web_socket_of_another_page_is_refused():
    async def main():
        async with serving() as url:
            address = url.replace("http", "ws") + "/ws"
            for origin in ("http://evil.example", "null", None, url.replace("127.0.0.1", "[::1]")):
                with pytest.raises(InvalidStatus) as refused:
                    await connect(address, origin=origin)
                assert refused.value.response.status_code == 403
    run(main)


def test_it_stops_within_seconds_whoever_is_connected():
    async def main():
        async with serving() as url:
            page = await web_socket(url)
            silent = await opened(url)
            begun = time.monotonic()
        assert time.monotonic() - begun < LIMIT_S
        with pytest.raises(ConnectionClosed) as ended:
            await page.recv()
        assert ended.value.rcvd.code == 1012
        assert await silent[0].read() == b""
        await closed(silent[1])
        with pytest.raises(OSError, match="onnect"):
            await opened(url)
    run(main)


def test_a_port_that_is_taken_is_waited_for_and_named_once(monkeypatch):
    monkeypatch.setattr(server, "_RETRY_S", 0.02)

    async def main():
        with socket.socket() as other, capture_logs() as logs:
            other.bind(("127.0.0.1", 0))
            other.listen()
            address = other.getsockname()
            waiting = asyncio.create_task(bind(address, "--kiosk-address"))
            await asyncio.sleep(0.2)
            assert not waiting.done()
            other.close()
            (await waiting).close()
        line, = logs
        assert "--kiosk-address" in line["event"]
        assert line["address"] == f"127.0.0.1:{address[1]}"
    run(main)


def test_an_address_of_another_machine_is_an_error():
    async def main():
        with pytest.raises(AddressError, match=r"--kiosk-address 192\.0\.2\.1:8080: "):
            await bind(("192.0.2.1", 8080), "--kiosk-address")
    run(main)


def test_the_page_is_served_by_tls(tmp_path):
    certificate, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    made = subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
         "-nodes", "-days", "2", "-subj", "/CN=kiosk", "-addext", "subjectAltName=IP:127.0.0.1",
         "-out", certificate, "-keyout", key], capture_output=True, check=False)
    if made.returncode:
        pytest.skip("no openssl")
    tls = KioskSettings.of({}, certificate=certificate, key=key).tls()

    async def main():
        async with serving(tls=tls) as url:
            trusted = ssl.create_default_context(cafile=certificate)
            async with web_socket(url, ssl=trusted) as page:
                await page.send("abc")
                assert await page.recv() == "3"
            answer = await said(url, request_to(url))
            assert b"HTTP/1.1 200" not in answer
    run(main)
