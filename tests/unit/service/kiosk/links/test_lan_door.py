"""The LAN door on a real socket, attacked by raw requests."""

import asyncio
import contextlib
import json
import logging
import re
import ssl
import struct
from functools import partial
from pathlib import Path

import pytest

from denseface.recon.face import Face
from denseface.service.errors import AddressError, ClientTimeoutError, UnknownCaptureError
from denseface.service.kiosk.certificates import tls_context
from denseface.service.kiosk.links import lan_door
from denseface.service.kiosk.links.lan_guard import LanGuard
from denseface.service.kiosk.links.links import LinkOptions, Links, NoAddressError
from denseface.service.kiosk.texts import Texts
from denseface.service.kiosk.web.server import bind as real_bind
from tests.unit.service.faces import small_face
from tests.unit.service.kiosk.links.certificate_files import make_certificate
from tests.waiting import LIMIT_S

TEXTS = {"en": Texts("en", {}), "de": Texts("de", {}),
         "ar": Texts("ar", {"language.direction": "rtl", "links.gone.title": "a < b"})}
KINDS = ("glb", "png", "stl", "ply")


class Hub:
    """Has faces, until they are taken from it."""

    def __init__(self) -> None:
        self.faces: dict[str, Face] = {"capture-1": small_face(), "capture-2": small_face(20, 20)}
        self.asked = 0
        self.silent = False

    async def get(self, capture_id: str) -> Face:
        self.asked += 1
        if self.silent:
            raise ClientTimeoutError("no answer")
        if capture_id not in self.faces:
            raise UnknownCaptureError(capture_id)
        return self.faces[capture_id]


class Door:
    """The door, and raw requests to it."""

    def __init__(self, links: Links, hub: Hub, host: str = "127.0.0.1") -> None:
        self.links = links
        self.hub = hub
        self.host = host
        self.tls: ssl.SSLContext | None = None

    async def send(self, data: bytes) -> bytes:
        """Give all that comes back until the door closes."""
        reader, writer = await asyncio.open_connection(self.host, self.links.port, ssl=self.tls)
        try:
            writer.write(data)
            await writer.drain()
            return await asyncio.wait_for(reader.read(), LIMIT_S)
        except ConnectionError:
            return b""
        finally:
            writer.close()

    async def ask(self, path: str, method: str = "GET", host: str | None = None,
                  more: str = "") -> tuple[int, dict[str, str], bytes]:
        host = f"{self.host}:{self.links.port}" if host is None else host
        answer = await self.send(
            f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n".encode("latin-1"))
        head, _, body = answer.partition(b"\r\n\r\n")
        status, *lines = head.decode("latin-1").split("\r\n")
        headers = dict(line.lower().split(": ", 1) for line in lines)
        return int(status.split(" ")[1]), headers, body

    async def begin(self, path: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Ask, and take no more than a little of the answer."""
        reader, writer = await asyncio.open_connection(self.host, self.links.port, limit=1024)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {self.host}:{self.links.port}\r\n\r\n".encode())
        return reader, writer

    async def token(self, capture_id: str = "capture-1", language: str = "en") -> str:
        return (await self.links.make(capture_id, language)).page.rpartition("/")[2]


@contextlib.asynccontextmanager
async def door(folder: Path, **options):
    hub = Hub()
    links = Links(LinkOptions(**{"address": ("127.0.0.1", 0), "folder": folder} | options),
                  hub.get, TEXTS)
    serving = asyncio.create_task(links.serve())
    try:
        await asyncio.wait_for(links.listening.wait(), LIMIT_S)
        yield Door(links, hub)
    finally:
        serving.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await serving


@pytest.fixture
def served(tmp_path, run):
    """Runs a coroutine function with a door."""
    def serve(use, **options):
        async def life():
            async with door(tmp_path, **options) as one:
                await use(one)
        run(life())
    return serve


def test_a_visitor_sees_what_there_is_in_their_language_and_fetches_it(served):
    async def use(door):
        keep = await door.links.make("capture-1", "ar")
        assert keep.page.startswith(f"http://127.0.0.1:{door.links.port}/d/")
        assert [one.format for one in keep.links] == list(KINDS)
        assert keep.uses == 5
        assert 1790 < keep.expires_s <= 1800
        assert len(keep.qr) == len(keep.qr[0]) >= 25
        assert set("".join(keep.qr)) == {"0", "1"}
        path = "/d/" + keep.page.rpartition("/")[2]
        for _ in range(10):  # looking takes no use
            status, headers, body = await door.ask(path)
        assert status == 200
        text = body.decode()
        assert '<html lang="ar" dir="rtl">' in text
        assert "<script" not in text
        assert TEXTS["ar"]["links.title"] in text
        for kind in KINDS:
            assert f'href="{path.removeprefix("/d/")}/face.{kind}"' in text
        assert headers["cache-control"] == "no-store"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["x-content-type-options"] == "nosniff"
        assert "script-src" not in headers["content-security-policy"]
        assert "default-src 'none'" in headers["content-security-policy"]
        for kind, media, begin in (
                ("glb", "model/gltf-binary", b"glTF"), ("png", "image/png", b"\x89PNG"),
                ("stl", "model/stl", b"by denseface"),
                ("ply", "application/octet-stream", b"ply\n")):
            status, headers, body = await door.ask(f"{path}/face.{kind}")
            assert (status, headers["content-type"]) == (200, media)
            assert body.startswith(begin)
            assert len(body) == int(headers["content-length"])
            assert headers["content-disposition"] == f'attachment; filename="face.{kind}"'
            assert headers["cache-control"] == "no-store"
            assert headers["referrer-policy"] == "no-referrer"
        assert "<dd>1</dd>" in (await door.ask(path))[2].decode()
        assert (await door.links.make("capture-1", "ar")).page == keep.page
        assert (await door.links.make("capture-1", "ar")).uses == 1
        assert (await door.ask(f"{path}/face.glb"))[0] == 200
        for gone in (path, f"{path}/face.glb"):
            status, _, body = await door.ask(gone)
            assert status == 410
            assert "<h1>a &lt; b</h1>" in body.decode()
    served(use)


def test_a_head_and_what_is_broken_off_take_no_use(served):
    async def use(door):
        door.hub.faces["capture-1"] = small_face(300, 300, 0.5)  # larger than what sockets buffer
        token = await door.token()
        path = f"/d/{token}/face.ply"
        for _ in range(3):
            status, headers, body = await door.ask(path, "HEAD")
            assert (status, body) == (200, b"")
            assert headers["content-disposition"]
        assert door.hub.asked == 0
        for _ in range(3):
            reader, writer = await door.begin(path)
            assert (await reader.read(100)).startswith(b"HTTP/1.1 200")
            writer.transport.abort()
        assert (await door.ask(path))[0] == 200
        assert (await door.ask(path))[0] == 410
    served(use, uses=1)


def test_of_many_who_fetch_at_once_exactly_as_many_get_it_as_there_are_uses(served):
    async def use(door):
        token = await door.token()
        got = 0
        while True:
            answers = await asyncio.gather(*(
                door.ask(f"/d/{token}/face.stl") for _ in range(6)))
            assert {status for status, _, _ in answers} <= {200, 410, 503}
            got += sum(status == 200 for status, _, _ in answers)
            if all(status == 410 for status, _, _ in answers):
                break
        assert got == 3
    served(use, uses=3)


def test_nothing_else_is_there(served):
    async def use(door):
        token = await door.token()
        for path in (
                "/", "/d", "/d/", f"/d/{token}/", f"/d/{token}/face.obj", f"/d/{token}/face.npz",
                f"/d/{token}/face", f"/d/{token}/face.", f"/d/{token}/face.glb/", "/operator",
                "/ws", "/healthz", "/metrics", "/favicon.ico", "/robots.txt", "/static/kiosk.js",
                f"/d/{token}/../../etc/passwd", "/d/../../../../etc/passwd",
                "/d/%2e%2e%2f%2e%2e%2fetc%2fpasswd", f"/d/{token}%2fface.glb%00",
                "/d/..%c0%af..%c0%afetc/passwd", f"/d/{token}/face.glb%2f..", "//d/" + token,
                f"/d/{token}%20", f"/d/{token.swapcase()}", "/d/" + "A" * 32, "/d/" + "A" * 8000,
                "/d/\xff\xfe", "/d/" + "%ff" * 16, f"/D/{token}"):
            status, headers, _ = await door.ask(path)
            assert status in (400, 404), path
            if status == 404:
                assert headers["x-content-type-options"] == "nosniff"
        # The same file by another spelling of its path is the same file.
        assert (await door.ask(f"/d/{token}/face%2eglb"))[0] == 200
        assert door.hub.asked == 1
    served(use)


def test_only_reading_is_allowed(served):
    async def use(door):
        token = await door.token()
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "BREW"):
            for path in (f"/d/{token}", f"/d/{token}/face.glb", "/"):
                status, headers, _ = await door.ask(path, method, more="Content-Length: 0\r\n")
                assert status == 405
                assert headers["allow"] == "get, head"
        assert door.hub.asked == 0
    served(use)


def test_a_name_that_is_not_this_machine_s_is_not_answered(served):
    async def use(door):
        token = await door.token()
        port = door.links.port
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}",
                     f"127.0.0.1:{port}.evil.example", f"127.0.0.1:{port}@evil.example", "",
                     f"localhost:{port}", f"127.0.0.1:{port}\r\nHost: evil.example"):
            status, _, _ = await door.ask(f"/d/{token}/face.glb", host=host)
            assert status in (400, 404), host
        assert door.hub.asked == 0
    served(use)


def test_the_name_that_the_operator_gave_is_known_and_named(served):
    async def use(door):
        keep = await door.links.make("capture-1", "en")
        assert keep.page.startswith("https://face.example:8443/d/")
        path = keep.page.removeprefix("https://face.example:8443")
        assert (await door.ask(path, host="face.example:8443"))[0] == 200
    served(use, url="https://face.example:8443")


def test_who_asks_too_often_is_told_so_and_tokens_cannot_be_tried_out(served, monkeypatch):
    # However long this machine takes to ask.
    monkeypatch.setattr(lan_door, "LanGuard", partial(LanGuard, clock=lambda: 5.0))

    async def use(door):
        answers = [await door.ask(f"/d/{n:032d}") for n in range(80)]
        statuses = [status for status, _, _ in answers]
        assert statuses[0] == 404
        assert statuses[-1] == 429
        assert answers[-1][1]["retry-after"]
    served(use)


def test_one_client_holds_no_more_than_its_share_of_connections(served):
    async def use(door):
        writers = []
        for _ in range(30):
            reader, writer = await asyncio.open_connection("127.0.0.1", door.links.port)
            writers.append((reader, writer))
        cut = 0
        for reader, _ in writers[12:]:
            try:
                cut += await asyncio.wait_for(reader.read(), LIMIT_S) == b""
            except ConnectionError:
                cut += 1
        assert cut == 18
        assert not any(reader.at_eof() for reader, _ in writers[:12]), "the first ones are kept"
        for _, writer in writers:
            writer.close()
    served(use)


def test_who_opens_connections_and_says_nothing_does_not_shut_out_others(served, tmp_path):
    """By TLS too, where nothing of HTTP is there before the handshake."""
    make_certificate(tmp_path, "kiosk")
    tls = tls_context(tmp_path / "kiosk.pem", tmp_path / "kiosk.key", "--lan-certificate")

    async def use(door):
        path = f"/d/{await door.token()}"
        writers = [(await asyncio.open_connection("127.0.0.1", door.links.port))[1]
                   for _ in range(100)]
        for writer in writers[:12]:
            writer.transport.abort()
        door.tls = ssl.create_default_context(cafile=tmp_path / "kiosk.pem")
        for _ in range(200):  # until it has seen that they are gone
            with contextlib.suppress(OSError, IndexError):
                assert (await door.ask(path))[0] == 200
                break
        else:
            pytest.fail("shut out")
        for writer in writers:
            writer.transport.abort()
    served(use, tls=tls)


def test_garbage_is_answered_by_400_or_not_at_all(served):
    async def use(door):
        for data in (b"\0" * 100, b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n",
                     b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
                     b"GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: x\r\n\r\n"):
            with contextlib.suppress(TimeoutError):
                answer = await asyncio.wait_for(door.send(data + b"\r\n\r\n"), 2.0)
                assert answer == b"" or answer.startswith((b"HTTP/1.1 400", b"HTTP/1.1 404"))
        assert (await door.ask(f"/d/{await door.token()}"))[0] == 200
    served(use)


def test_a_withdrawn_capture_is_gone_at_once_also_while_it_is_fetched(served):
    async def use(door):
        door.hub.faces["capture-1"] = small_face(300, 300, 0.5)
        token = await door.token()
        reader, writer = await door.begin(f"/d/{token}/face.ply")
        head = await reader.readuntil(b"\r\n\r\n")
        length = int(re.search(rb"content-length: (\d+)", head)[1])
        await door.links.forget("capture-1")
        got = 0
        with contextlib.suppress(ConnectionError):
            while data := await asyncio.wait_for(reader.read(2**16), LIMIT_S):
                got += len(data)
        assert got < length
        writer.close()
        for path in (f"/d/{token}", f"/d/{token}/face.ply"):
            assert (await door.ask(path))[0] == 410
        assert await door.token() != token
    served(use)


def test_what_the_hub_does_not_have_any_more_ends_its_link(served, tmp_path):
    async def use(door):
        token, other = await door.token(), await door.token("capture-2")
        del door.hub.faces["capture-1"]
        assert (await door.ask(f"/d/{token}"))[0] == 200
        assert (await door.ask(f"/d/{token}/face.glb"))[0] == 410
        assert (await door.ask(f"/d/{token}"))[0] == 410
        assert "capture-1" not in (tmp_path / "links.json").read_text()
        assert (await door.ask(f"/d/{other}/face.glb"))[0] == 200
        door.hub.silent = True
        status, headers, body = await door.ask(f"/d/{other}/face.glb")
        assert (status, headers["retry-after"]) == (503, "3")
        assert TEXTS["en"]["links.busy.title"] in body.decode()
        door.hub.silent = False
        assert (await door.ask(f"/d/{other}/face.glb"))[0] == 200
    served(use)


def test_links_are_good_after_a_restart(served):
    tokens = []

    async def before(door):
        tokens.append(await door.token())
        assert (await door.ask(f"/d/{tokens[0]}/face.glb"))[0] == 200

    async def after(door):
        assert (await door.ask(f"/d/{tokens[0]}/face.stl"))[0] == 200
        assert (await door.ask(f"/d/{tokens[0]}/face.stl"))[0] == 410

    served(before, uses=2)
    served(after, uses=2)


def test_a_stranger_is_told_in_a_language_of_their_browser(served):
    async def use(door):
        for asked, language in (("de-AT,en;q=0.5", "de"), ("xx, ar;q=0.1", "ar"), ("", "en")):
            status, _, body = await door.ask("/d/x", more=f"Accept-Language: {asked}\r\n")
            assert status == 404
            assert "links.unknown.title" in body.decode()
            assert f'<html lang="{language}"' in body.decode()
    served(use)


def test_no_token_and_no_digest_gets_into_the_log(served, tmp_path, capfd, caplog):
    caplog.set_level(logging.DEBUG)
    tokens = []

    async def use(door):
        tokens.append(await door.token())
        for path in (f"/d/{tokens[0]}", f"/d/{tokens[0]}/face.glb", f"/d/{tokens[0]}/face.obj",
                     f"/d/{tokens[0]}/face.glb"):
            await door.ask(path)
        await door.ask(f"/d/{tokens[0]}", "POST")
        await door.send(f"GET /d/{tokens[0]} HTTP/1.1\r\nbad header\r\n\r\n".encode())
        door.links._links.find = None  # a fault of ours: a traceback is logged
        await door.ask(f"/d/{tokens[0]}")

    served(use, uses=1)
    kept = json.loads((tmp_path / "links.json").read_text())
    secrets = tokens + [one["digest"] for one in kept["links"] + kept["gone"]]
    written = "".join(capfd.readouterr()) + caplog.text
    assert "Traceback" in written
    assert not any(secret in written for secret in secrets)


def test_with_a_certificate_it_speaks_tls(served, tmp_path):
    make_certificate(tmp_path, "kiosk")
    tls = tls_context(tmp_path / "kiosk.pem", tmp_path / "kiosk.key", "--lan-certificate")

    async def use(door):
        door.hub.faces["capture-1"] = small_face(300, 300, 0.5)
        keep = await door.links.make("capture-1", "en")
        assert keep.page.startswith("https://127.0.0.1")
        door.tls = ssl.create_default_context(cafile=tmp_path / "kiosk.pem")
        path = "/d/" + keep.page.rpartition("/")[2]
        assert (await door.ask(path))[0] == 200
        status, headers, body = await door.ask(f"{path}/face.glb")
        assert status == 200
        assert len(body) == int(headers["content-length"]) == struct.unpack_from("<I", body, 8)[0]
        assert (await door.ask(f"{path}/face.glb"))[0] == 410
    served(use, tls=tls, uses=1)


def test_an_address_that_is_not_up_makes_no_link(served, monkeypatch):
    async def use(door):
        assert door.links.reachable
        monkeypatch.setattr("denseface.service.kiosk.links.links.interfaces", list)
        assert not door.links.reachable
        with pytest.raises(NoAddressError, match="no network is up"):
            await door.token()
    served(use, address=("0.0.0.0", 0))  # noqa: S104


def test_a_port_that_is_taken_is_waited_for(served, tmp_path):
    async def use(door):
        other = Links(LinkOptions(("127.0.0.1", door.links.port), tmp_path), Hub().get, TEXTS)
        waiting = asyncio.create_task(other.serve())
        await asyncio.sleep(0)
        assert not other.reachable
        with pytest.raises(NoAddressError, match="another program"):
            await other.make("capture-1", "en")
        assert not waiting.done()
        waiting.cancel()
    served(use)


def test_an_address_that_is_not_there_yet_is_waited_for(tmp_path, run, monkeypatch, capfd):
    monkeypatch.setattr("denseface.service.kiosk.links.links._BIND_S", 0.0)
    tries = []

    async def bind(address, flag):
        tries.append(address)
        if len(tries) < 5:
            raise AddressError(f"{flag} {address[0]}: Cannot assign requested address")
        return await real_bind(("127.0.0.1", 0), flag)

    monkeypatch.setattr("denseface.service.kiosk.links.links.bind", bind)

    async def life():
        async with door(tmp_path, address=("192.0.2.200", 8090)) as one:
            assert one.links.port
            assert not one.links.reachable, "the address of the settings is what is named"
    run(life())
    assert len(tries) == 5
    assert "".join(capfd.readouterr()).count("Cannot assign requested address") == 1
