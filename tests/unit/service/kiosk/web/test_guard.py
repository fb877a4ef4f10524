"""Who may ask. Each line of the guard has a request that only it refuses."""

import pytest

from denseface.service.kiosk.web.guard import Guard, origins_of
from tests.unit.service.kiosk.web.asking import ask, let_through

HOST = ("Host", "127.0.0.1:8080")
ORIGIN = ("Origin", "http://127.0.0.1:8080")
APP = Guard(let_through, origins_of("http", "127.0.0.1", 8080, ["https://face.example"]))
READING = ["GET", "HEAD"]
METHODS = [*READING, "POST"]
OTHERS = ["DELETE", "PUT", "PATCH", "OPTIONS", "TRACE", "CONNECT", "get", "PROPFIND"]


def status(headers, method="GET", app=APP):
    return ask(app, method, headers=headers).status


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "[::1]:8080",
                                  "LOCALHOST:8080", "face.example"])
@pytest.mark.parametrize("method", METHODS)
def test_a_page_of_this_server_is_let_through(host, method):
    scheme = "https" if host == "face.example" else "http"
    assert status([("Host", host), ("Origin", f"{scheme}://{host.lower()}"),
                   ("Sec-Fetch-Site", "same-origin")], method) == 200
    assert ask(APP, headers=[("Host", host), ("Origin", f"{scheme}://{host.lower()}")],
               kind="websocket") == "websocket.accept"


@pytest.mark.parametrize("method", READING)
def test_who_types_the_address_is_let_through(method):
    assert status([HOST, ("Sec-Fetch-Site", "none")], method) == 200
    assert status([HOST], method) == 200


WRONG_HOSTS = [
    "127.0.0.1", "127.0.0.1:80", "127.0.0.1:8081", "127.0.0.1:08080", "127.0.0.1:8080.evil.example",
    "evil.example", "evil.example:8080", "127.0.0.1.evil.example:8080", "localhost",
    "localhost.:8080", "localhost:8080@evil.example", "127.0.0.2:8080", "0.0.0.0:8080", "[::]:8080",
    "[::1]", "::1:8080", "2130706433:8080", "0x7f.1:8080", "face.example:8080", "face.example:443",
    "www.face.example", "face.example.", "", " 127.0.0.1:8080", "127.0.0.1:8080 ", "*",
    "127.0.0.1:8080,127.0.0.1:8080", "http://127.0.0.1:8080"]


@pytest.mark.parametrize("host", WRONG_HOSTS)
def test_every_other_host_is_refused_with_every_method(host):
    """As a name that anybody lets point to this machine, and another port of it."""
    for method in [*METHODS, *OTHERS]:
        assert status([("Host", host), ORIGIN, ("Sec-Fetch-Site", "same-origin")], method) == 403
        assert status([("Host", host), ("Origin", f"http://{host}")], method) == 403


@pytest.mark.parametrize("host", WRONG_HOSTS)
def test_every_other_host_is_refused_a_web_socket(host):
    headers = [("Host", host), ORIGIN]
    assert ask(APP, headers=headers, kind="websocket") == "websocket.close"


def test_one_host_is_named_and_no_other_header_names_it():
    assert status([HOST, HOST]) == 403
    assert status([("Host", "evil.example"), HOST]) == 403
    assert status([]) == 403
    assert status([("Host", "evil.example"), ("X-Forwarded-Host", HOST[1]),
                   ("Forwarded", f"host={HOST[1]}")]) == 403


WRONG_ORIGINS = [
    "null", "", "http://127.0.0.1", "http://127.0.0.1:8081", "https://127.0.0.1:8080",
    "http://evil.example", "http://127.0.0.1:8080.evil.example", "http://localhost:8080",
    "http://127.0.0.1:8080/", "HTTP://127.0.0.1:8080", "file://", "https://face.example",
    "chrome-extension://abc", "http://127.0.0.1:8080 http://127.0.0.1:8080"]


@pytest.mark.parametrize("origin", WRONG_ORIGINS)
def test_every_other_origin_is_refused_with_every_method(origin):
    for method in [*METHODS, *OTHERS]:
        assert status([HOST, ("Origin", origin)], method) == 403
        assert status([HOST, ("Origin", origin), ORIGIN], method) == 403
        assert status([HOST, ORIGIN, ("Origin", origin)], method) == 403


@pytest.mark.parametrize("origin", WRONG_ORIGINS)
def test_every_other_origin_is_refused_a_web_socket(origin):
    headers = [HOST, ("Origin", origin)]
    assert ask(APP, headers=headers, kind="websocket") == "websocket.close"
    assert ask(APP, headers=[*headers, ORIGIN], kind="websocket") == "websocket.close"


def test_what_changes_something_and_a_web_socket_need_an_origin():
    assert status([HOST], "POST") == 403
    assert ask(APP, headers=[HOST], kind="websocket") == "websocket.close"


@pytest.mark.parametrize("site", ["cross-site", "same-site", "", "Same-Origin", "none, none"])
@pytest.mark.parametrize("method", METHODS)
def test_another_site_is_refused(site, method):
    """`same-site` is another port of this machine."""
    headers = [HOST, ORIGIN, ("Sec-Fetch-Site", site)]
    assert status(headers, method) == 403
    assert status([*headers, ("Sec-Fetch-Site", "same-origin")], method) == 403
    assert ask(APP, headers=headers, kind="websocket") == "websocket.close"


def test_a_link_on_another_site_leads_here_only_where_that_is_wanted():
    app = Guard(let_through, origins_of("http", "127.0.0.1", 8080), linked=True)
    link = [HOST, ("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Mode", "navigate"),
            ("Sec-Fetch-Dest", "document")]
    assert status(link, app=app) == 200
    assert status(link) == 403
    assert status([*link, ORIGIN], "POST", app) == 403
    for at in (2, 3):  # an image, a frame
        other = [*link[:at], (link[at][0], "no-cors"), *link[at + 1:]]
        assert status(other, app=app) == 403
        assert status([*link[:at], *link[at + 1:]], app=app) == 403
    assert ask(app, headers=[*link, ORIGIN], kind="websocket") == "websocket.close"


@pytest.mark.parametrize("method", OTHERS)
def test_no_other_method_is_taken_even_of_this_page(method):
    answer = ask(APP, method, headers=[HOST, ORIGIN, ("Sec-Fetch-Site", "same-origin")])
    assert answer.status == 405
    assert answer.headers["allow"] == "GET, HEAD, POST"


def test_what_is_neither_request_nor_web_socket_is_left():
    async def receive():
        raise AssertionError

    coroutine = APP({"type": "lifespan"}, receive, receive)
    with pytest.raises(StopIteration):
        coroutine.send(None)


@pytest.mark.parametrize(("arguments", "expected"), [
    (("http", "127.0.0.1", 80), {"http://127.0.0.1", "http://localhost", "http://[::1]"}),
    (("https", "::1", 443), {"https://127.0.0.1", "https://localhost", "https://[::1]"}),
    (("https", "192.168.1.7", 8443), {"https://192.168.1.7:8443"}),
    (("https", "fe80::1", 443), {"https://[fe80::1]"}),
    (("https", "::", 443), {"https://127.0.0.1", "https://localhost", "https://[::1]"}),
    (("http", "192.168.1.7", 8080, ["https://a.example"]), {"https://a.example"})])
def test_the_origins_of_an_address(arguments, expected):
    assert origins_of(*arguments) == expected
