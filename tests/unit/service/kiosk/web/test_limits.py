"""How much one may ask, and what every answer says."""

import pytest
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from denseface.service.kiosk.web.headers import SecurityHeaders
from denseface.service.kiosk.web.limits import MAX_BODY_BYTES, Limits
from tests.unit.service.kiosk.web.asking import ask, let_through


def test_who_asks_too_often_waits_and_nobody_else_does():
    now = [0.0]
    app = Limits(let_through, lambda: now[0])
    statuses = [ask(app).status for _ in range(250)]
    assert statuses == [200] * 200 + [429] * 50
    assert ask(app).headers["retry-after"] == "1"
    assert ask(app, kind="websocket") == "websocket.close"
    assert ask(app, client="192.168.1.7").status == 200
    now[0] += 1.0
    assert [ask(app).status for _ in range(51)] == [200] * 50 + [429]


def test_the_addresses_that_are_counted_are_bounded():
    app = Limits(let_through, lambda: 0.0)
    for number in range(1200):
        ask(app, client=f"10.0.{number // 256}.{number % 256}")
    assert len(app._buckets) == 1000


@pytest.mark.parametrize("length", [str(MAX_BODY_BYTES + 1), "-1", "1e3", "", "\u0661"])
def test_a_body_that_says_it_is_too_long_is_not_read(length):
    headers = [("Content-Length", length)]
    assert ask(Limits(let_through, lambda: 0.0), "POST", headers=headers).status == 413


def test_a_body_that_is_longer_than_it_says_is_cut_off():
    taken = []

    async def take(request: Request) -> PlainTextResponse:
        try:
            taken.append(len(await request.body()))
        except ClientDisconnect:
            taken.append("cut off")
        return PlainTextResponse("")

    app = Limits(Starlette(routes=[Route("/", take, methods=["POST"])]), lambda: 0.0)
    ask(app, "POST", body=[b"x" * MAX_BODY_BYTES])
    ask(app, "POST", body=[b"x" * 1000] * 17)
    assert taken == [MAX_BODY_BYTES, "cut off"]


@pytest.mark.parametrize(("path", "headers"), [
    ("/" + "a" * 1024, []), ("/", [("X", "a")] * 65), ("/", [("X", "a" * 16384)])])
def test_a_head_that_is_too_long_is_refused(path, headers):
    app = Limits(let_through, lambda: 0.0)
    assert ask(app, path=path, headers=headers).status == 431
    assert ask(app, path=path[:1024], headers=[(name, value[:16000]) for name, value in
                                               headers[:64]]).status == 200


EXPECTED = {
    "x-content-type-options": "nosniff", "x-frame-options": "DENY",
    "referrer-policy": "no-referrer", "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin", "cache-control": "no-store",
    "x-robots-tag": "noindex"}


def test_every_answer_says_what_a_browser_may():
    headers = ask(SecurityHeaders(let_through)).headers
    policy = headers.pop("content-security-policy").split("; ")
    features = headers.pop("permissions-policy").split(", ")
    assert headers == EXPECTED
    assert {"default-src 'none'", "script-src 'self'", "frame-ancestors 'none'",
            "base-uri 'none'", "form-action 'self'"} <= set(policy)
    assert not any(word in " ".join(policy) for word in ("unsafe", "http", "*"))
    assert {"camera=()", "microphone=()", "geolocation=()"} <= set(features)


def test_an_answer_that_says_so_itself_is_not_contradicted():
    async def cached(scope, receive, send):
        await send({"type": "http.response.start", "status": 200,
                    "headers": [(b"Cache-Control", b"no-cache")]})
        await send({"type": "http.response.body"})

    headers = ask(SecurityHeaders(cached)).headers
    assert headers["Cache-Control"] == "no-cache"
    assert "cache-control" not in headers
