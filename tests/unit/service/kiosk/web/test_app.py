"""What is served where, and that it stands behind its guards."""

from functools import partial
from pathlib import Path

import pytest
from starlette.requests import Request

from denseface.service.kiosk.web import app as module
from denseface.service.kiosk.web.app import kiosk_app, kiosk_files
from denseface.service.kiosk.web.files import Files
from denseface.service.kiosk.web.limits import Limits
from tests.unit.service.kiosk.web.asking import ask

HOST = ("Host", "127.0.0.1:8080")
ORIGINS = ["http://127.0.0.1:8080"]


@pytest.fixture
def app(tmp_path, monkeypatch):
    """A page of a few files, with secrets beside it."""
    static = tmp_path / "static"
    (static / "fonts").mkdir(parents=True)
    for name, text in (("index.html", "<!doctype html>"), ("kiosk.js", "start()"),
                       ("fonts/a.woff2", "font"), ("secret.pem", "secret"), (".env", "secret")):
        (static / name).write_text(text)
    (tmp_path / "secret.js").write_text("secret")
    (static / "link.js").symlink_to(tmp_path / "nothing.js")
    languages = tmp_path / "languages"
    languages.mkdir()
    (languages / "en.json").write_text("{}")
    monkeypatch.setattr(module, "STATIC", static)
    monkeypatch.setattr(module, "LANGUAGES", languages)

    async def accept(socket):
        await socket.accept()

    # However long this machine takes to ask.
    monkeypatch.setattr(module, "Limits", partial(Limits, clock=lambda: 5.0))
    return kiosk_app(accept, ORIGINS, kiosk_files())


def get(app, path, *headers, method="GET"):
    return ask(app, method, path, [HOST, *headers])


@pytest.mark.parametrize(("path", "kind"), [
    ("/", "text/html; charset=utf-8"), ("/static/kiosk.js", "text/javascript; charset=utf-8"),
    ("/static/fonts/a.woff2", "font/woff2"), ("/languages/en.json", "application/json"),
    ("/healthz", "application/json")])
def test_files_have_their_types_and_all_headers(app, path, kind):
    answer = get(app, path)
    assert (answer.status, answer.headers["content-type"]) == (200, kind)
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert get(app, path, method="HEAD").status == 200


def test_a_file_that_the_browser_has_is_not_sent_again(app):
    first = get(app, "/static/kiosk.js")
    assert first.headers["cache-control"] == "no-cache"
    for tag in (first.headers["etag"], f'"x", W/{first.headers["etag"]}'):
        again = get(app, "/static/kiosk.js", ("If-None-Match", tag))
        assert (again.status, again.body) == (304, b"")
    assert get(app, "/static/kiosk.js", ("If-None-Match", '"other"')).body == b"start()"


@pytest.mark.parametrize("path", [
    "/static/../secret.js", "/static/..%2fsecret.js", "/static//secret.js", "/static/./kiosk.js",
    "/static/fonts/../kiosk.js", "/static/fonts/../../secret.js", "/static/\x00kiosk.js",
    "/static/..\\secret.js", "/languages/../static/kiosk.js", "/static/", "/static",
    "/static/fonts", "/static/secret.pem", "/static/.env", "/static/link.js",
    "//static/kiosk.js", "/index.html", "/static/kiosk.js/", "/STATIC/kiosk.js", "/.git/config",
    "/etc/passwd", "/healthz/"])
def test_no_name_leads_anywhere_else(app, path):
    answer = get(app, path)
    assert answer.status == 404
    assert b"secret" not in answer.body
    assert "location" not in answer.headers


@pytest.mark.parametrize("path", ["/", "/static/kiosk.js", "/healthz", "/languages/en.json", "/x"])
def test_everything_stands_behind_the_guard(app, path):
    assert ask(app, path=path, headers=[("Host", "evil.example")]).status == 403
    assert ask(app, path=path, headers=[HOST, ("Sec-Fetch-Site", "cross-site")]).status == 403
    refused = ask(app, "DELETE", path, [HOST, ("Origin", ORIGINS[0])])
    assert refused.status == 405
    assert refused.headers["x-frame-options"] == "DENY"


def test_the_web_socket_stands_behind_the_guard_too(app):
    headers = [HOST, ("Origin", ORIGINS[0])]
    assert ask(app, path="/ws", headers=headers, kind="websocket") == "websocket.accept"
    assert ask(app, path="/ws", headers=[HOST], kind="websocket") == "websocket.close"
    assert ask(app, path="/other", headers=headers, kind="websocket") == "websocket.close"


def test_everything_is_limited(app):
    statuses = {get(app, "/healthz").status for _ in range(300)}
    assert statuses == {200, 429}


def test_a_folder_that_is_missing_is_empty(tmp_path):
    files = Files({"static/": tmp_path / "none"})
    request = Request({"type": "http", "headers": []})
    assert files.answer("static/kiosk.js", request).status_code == 404
    assert "static/kiosk.js" not in files


def test_a_file_that_is_too_large_is_not_served(tmp_path):
    with Path(tmp_path / "large.js").open("wb") as file:
        file.truncate(16 * 2**20 + 1)
    assert "large.js" not in Files({"": tmp_path})
