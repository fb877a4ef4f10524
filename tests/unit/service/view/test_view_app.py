"""What the page's server answers to whom."""

import asyncio
import os
import socket
from functools import partial

import pytest
from starlette.websockets import WebSocketDisconnect

from denseface.service.kiosk.web import app as web_module
from denseface.service.kiosk.web.limits import Limits
from denseface.service.view import peers
from denseface.service.view.app import view_app
from denseface.service.view.items import FaceItem
from denseface.service.view.pages import Pages
from denseface.service.view.peers import user_of
from denseface.service.view.shelf import Shelf
from tests.unit.service.faces import small_face
from tests.unit.service.kiosk.web.asking import ask

TOKEN = "u" * 32
ORIGIN = "http://127.0.0.1:8080"
HOST = ("Host", "127.0.0.1:8080")
ITEM = f"/{TOKEN}/items/0/0"


@pytest.fixture
def app(monkeypatch):
    # However long this machine takes to ask.
    monkeypatch.setattr(web_module, "Limits", partial(Limits, clock=lambda: 5.0))

    async def make():
        return view_app(Shelf([FaceItem("/a/face.npz", small_face())]), Pages(), TOKEN, [ORIGIN])

    return asyncio.run(make())


def get(app, path, *headers, method="GET"):
    return ask(app, method, path, [HOST, *headers])


@pytest.mark.parametrize(("path", "kind", "start"), [
    (f"/{TOKEN}/", "text/html; charset=utf-8", b"<!doctype html>"),
    (f"/{TOKEN}/view.js", "text/javascript; charset=utf-8", b"import"),
    (f"/{TOKEN}/view.css", "text/css; charset=utf-8", b""),
    (f"/{TOKEN}/texts.json", "application/json", b"{"),
    (f"/{TOKEN}/items.json", "application/json", b'{"kind":"listing","items":[{"name":"face.npz"'),
    (f"{ITEM}/seen.json", "application/json", b'{"kind":"seen"'),
    (f"{ITEM}/shape.bin", "application/octet-stream", b"DFGR")])
def test_all_is_there_below_the_token_with_all_headers(app, path, kind, start):
    answer = get(app, path)
    assert (answer.status, answer.headers["content-type"]) == (200, kind)
    assert answer.body.startswith(start)
    assert answer.headers["referrer-policy"] == "no-referrer", "which would tell the token"
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert get(app, path, method="HEAD").status == 200


@pytest.mark.parametrize("path", [
    "/", "/view.js", "/items.json", f"/{TOKEN}", f"/{TOKEN[:-1]}/", f"/{TOKEN}u/", f"/x/{TOKEN}/",
    f"//{TOKEN}/", f"/{TOKEN.upper()}/", f"/{TOKEN}/../view.js", f"/{TOKEN}//", f"/{TOKEN}/none.js",
    f"/{TOKEN}/items/1/0/seen.json", f"/{TOKEN}/items/0/1/seen.json", f"/{TOKEN}/items/0/0/x",
    f"/{TOKEN}/items/-1/0/seen.json", f"/{TOKEN}/items/0/{'9' * 300}/seen.json",
    f"{ITEM}/picture.png", f"/{TOKEN}/languages/en.json", "/é/"])
def test_anything_else_is_not_found(app, path):
    answer = get(app, path)
    assert answer.status == 404
    assert "location" not in answer.headers


def test_another_site_and_another_name_are_refused(app):
    page = f"/{TOKEN}/"
    assert ask(app, path=page, headers=[("Host", "evil.example:8080")]).status == 403
    assert ask(app, path=page, headers=[("Host", "127.0.0.1:9999")]).status == 403
    assert get(app, page, ("Origin", "http://evil.example")).status == 403
    assert get(app, ITEM + "/shape.bin", ("Sec-Fetch-Site", "cross-site")).status == 403
    linked = [("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Mode", "navigate"),
              ("Sec-Fetch-Dest", "document")]
    assert get(app, page, *linked).status == 200, "a link in a terminal that is a page"
    assert get(app, page, ("Origin", ORIGIN), method="DELETE").status == 405
    assert get(app, page, method="POST").status == 403
    assert get(app, page, ("Origin", ORIGIN), method="POST").status == 405


def test_another_user_of_the_machine_is_refused(app, monkeypatch):
    monkeypatch.setattr(peers, "user_of", lambda *_: 4242)
    assert get(app, f"/{TOKEN}/").status == 403
    monkeypatch.setattr(peers, "user_of", lambda *_: os.getuid())
    assert get(app, f"/{TOKEN}/").status == 200


@pytest.mark.parametrize(("family", "host"), [
    (socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")])
def test_the_system_says_whose_a_connection_is(family, host):
    with socket.socket(family) as server, socket.socket(family) as client:
        try:
            server.bind((host, 0))
        except OSError:
            pytest.skip(f"this machine has no {host}")
        server.listen()
        client.connect(server.getsockname()[:2])
        here, there = client.getsockname()[:2], client.getpeername()[:2]
        assert user_of(here, there) == os.getuid()
        assert user_of((host, here[1] ^ 1), there) is None
    assert user_of(("nowhere", 1), there) is None


def test_the_socket_counts_pages_and_the_last_one_ends_it():
    class Socket:
        def __init__(self):
            self.gone = asyncio.Event()

        async def accept(self):
            pass

        async def receive_text(self):
            await self.gone.wait()
            raise WebSocketDisconnect

    async def visits():
        pages = Pages(gone_s=0.0)
        with pages.open():
            with pages.open():
                pass
            await asyncio.sleep(0)
            assert not pages.closed.done()
        await asyncio.wait_for(pages.closed, 10)
        anew = Pages(gone_s=3600.0)
        with anew.open():
            pass
        with anew.open():  # loaded anew: what was due is not
            assert not anew.closed.done()

    asyncio.run(visits())
