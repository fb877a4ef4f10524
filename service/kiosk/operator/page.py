"""The routes of the operator's page; all but the page's frame and the log-in need a session."""

import json
import re
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any

import structlog
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from denseface.service.errors import (
    CaptureFailedError,
    ClientTimeoutError,
    RequestFailedError,
    ServiceError,
    SettingsError,
    UnknownCaptureError,
)
from denseface.service.kiosk.operator.desk import MOST_CAPTURES, Desk
from denseface.service.kiosk.operator.sessions import Sessions, TooManyTriesError
from denseface.service.kiosk.operator.token import OperatorToken
from denseface.service.kiosk.web.files import Files

__all__ = ["PUBLIC", "OperatorPage"]

_PATH = "/operator"
_API = f"{_PATH}/api"
PUBLIC = frozenset({("GET", _PATH), ("HEAD", _PATH), ("GET", f"{_API}/session"),
                    ("HEAD", f"{_API}/session"), ("POST", f"{_API}/login")})
"""What needs no session: an empty page, whether there is a session, and the way in."""
_COOKIE = "denseface_operator"
_MAX_JSON = 4096
"""Characters of a request's body."""
_MAX_TOKEN = 200
_Answer = Callable[[Request], Awaitable[Response]]
_STATUS: dict[type[ServiceError], tuple[HTTPStatus, str]] = {
    UnknownCaptureError: (HTTPStatus.NOT_FOUND, "unknown"),
    CaptureFailedError: (HTTPStatus.NOT_FOUND, "no_face"),
    RequestFailedError: (HTTPStatus.CONFLICT, "refused"),
    ClientTimeoutError: (HTTPStatus.SERVICE_UNAVAILABLE, "hub"),
    SettingsError: (HTTPStatus.SERVICE_UNAVAILABLE, "settings"),
}
"""What is answered by what is wrong; the page has the words under `operator.error.NAME`."""
_log = structlog.get_logger("operator")


class OperatorPage:
    """Answers what an operator's browser asks.

    Parameters
    ----------
    desk : what is done
    token : who may
    files : of the page
    clock : monotonic, seconds
    """

    def __init__(
        self, desk: Desk, token: OperatorToken, files: Files, clock: Callable[[], float]
    ) -> None:
        self._desk = desk
        self._token = token
        self._files = files
        self._clock = clock
        self._sessions = Sessions(clock())

    def routes(self) -> list[Route]:
        """Give all routes."""
        desk, guarded = self._desk, self._guarded
        return [
            Route(_PATH, self._frame, methods=["GET"]),
            Route(f"{_API}/session", _explained(self._session), methods=["GET"]),
            Route(f"{_API}/login", _explained(self._log_in), methods=["POST"]),
            Route(f"{_API}/logout", guarded(self._log_out), methods=["POST"]),
            Route(f"{_API}/overview", guarded(_json(desk.overview)), methods=["GET"]),
            Route(f"{_API}/captures", guarded(self._captures), methods=["GET"]),
            Route(f"{_API}/captures/{{capture_id}}/thumbnail.png", guarded(self._thumbnail),
                  methods=["GET"]),
            Route(f"{_API}/captures/{{capture_id}}/report.json", guarded(self._report),
                  methods=["GET"]),
            Route(f"{_API}/captures/{{capture_id}}/delete", guarded(_done(desk.delete)),
                  methods=["POST"]),
            Route(f"{_API}/dead", guarded(_json(desk.dead)), methods=["GET"]),
            Route(f"{_API}/dead/{{capture_id}}/retry", guarded(_done(desk.retry)),
                  methods=["POST"]),
            Route(f"{_API}/dead/{{capture_id}}/drop", guarded(_done(desk.drop)), methods=["POST"]),
            Route(f"{_API}/sensor/restart", guarded(self._restart_sensor), methods=["POST"]),
            Route(f"{_API}/log.txt", guarded(self._log_lines), methods=["GET"]),
        ]

    def _guarded(self, answer: _Answer) -> _Answer:
        async def guarded(request: Request) -> Response:
            if not self._is_in(request):
                return _error(HTTPStatus.UNAUTHORIZED, "login")
            return await answer(request)

        return _explained(guarded)

    def _is_in(self, request: Request) -> bool:
        secret = request.cookies.get(_COOKIE, "")
        return self._sessions.knows(secret, self._token.digest(), self._clock())

    async def _session(self, request: Request) -> Response:
        return JSONResponse({"session": self._is_in(request)})

    async def _frame(self, request: Request) -> Response:
        return self._files.answer("static/operator.html", request)

    async def _log_in(self, request: Request) -> Response:
        address = request.client.host if request.client else ""
        try:
            self._sessions.may_try(address, self._clock())
        except TooManyTriesError as error:
            wait_s = int(error.wait_s) + 1
            return _error(HTTPStatus.TOO_MANY_REQUESTS, "tries", wait_s=wait_s,
                          headers={"retry-after": str(wait_s)})
        given = (await _body(request)).get("token")
        if not isinstance(given, str) or len(given) > _MAX_TOKEN or not self._token.fits(given):
            self._sessions.wrong(address, self._clock())
            _log.warning("a wrong token", address=address)
            return _error(HTTPStatus.FORBIDDEN, "token")
        secret = self._sessions.begin(address, self._token.digest(), self._clock())
        _log.info("an operator has logged in", address=address)
        answer = JSONResponse({"ok": True})
        answer.set_cookie(
            _COOKIE, secret, path=_PATH, httponly=True, samesite="strict", secure=_by_tls(request))
        return answer

    async def _log_out(self, request: Request) -> Response:
        self._sessions.end(request.cookies.get(_COOKIE, ""))
        answer = JSONResponse({"ok": True})
        answer.delete_cookie(
            _COOKIE, path=_PATH, httponly=True, samesite="strict", secure=_by_tls(request))
        return answer

    async def _captures(self, request: Request) -> Response:
        last = request.query_params.get("last", str(MOST_CAPTURES))
        if not re.fullmatch(r"[0-9]{1,3}", last) or not 1 <= int(last) <= MOST_CAPTURES:
            return _error(HTTPStatus.BAD_REQUEST, "request")
        return JSONResponse(await self._desk.captures(int(last)))

    async def _thumbnail(self, request: Request) -> Response:
        look = await self._desk.look(request.path_params["capture_id"])
        return Response(look.thumbnail, media_type="image/png")

    async def _report(self, request: Request) -> Response:
        look = await self._desk.look(request.path_params["capture_id"])
        return Response(look.report, media_type="application/json")

    async def _restart_sensor(self, request: Request) -> Response:
        name = (await _body(request)).get("sensor")
        if not isinstance(name, str):
            return _error(HTTPStatus.BAD_REQUEST, "request")
        await self._desk.restart_sensor(name)
        return JSONResponse({"ok": True})

    async def _log_lines(self, _: Request) -> Response:
        return Response(await self._desk.log(), media_type="text/plain; charset=utf-8", headers={
            "content-disposition": 'attachment; filename="denseface.log"'})


def _explained(answer: _Answer) -> _Answer:
    """Answer errors of the service by their names."""
    async def explained(request: Request) -> Response:
        try:
            return await answer(request)
        except ServiceError as error:
            status, name = _STATUS.get(type(error), (HTTPStatus.BAD_GATEWAY, "hub"))
            if isinstance(error, SettingsError):  # names files of this machine, to anybody
                _log.warning("the operator's page cannot be used", reason=str(error))
                return _error(status, name)
            return _error(status, name, str(error))

    return explained


def _json(give: Callable[[], Awaitable[Any]]) -> _Answer:
    async def answer(_: Request) -> Response:
        return JSONResponse(await give())

    return answer


def _done(do: Callable[[str], Awaitable[None]]) -> _Answer:
    """Make an answer of what is done to one capture."""
    async def answer(request: Request) -> Response:
        await do(request.path_params["capture_id"])
        return JSONResponse({"ok": True})

    return answer


async def _body(request: Request) -> dict[str, Any]:
    """Read an object of JSON; an empty one where it is none."""
    if request.headers.get("content-type", "").partition(";")[0] != "application/json":
        return {}
    try:
        body = json.loads((await request.body())[:_MAX_JSON])
    except (ValueError, RecursionError):
        return {}
    return body if isinstance(body, dict) else {}


def _by_tls(request: Request) -> bool:
    """Say whether the browser came by TLS; its origin is one that the guard knows."""
    return request.headers.get("origin", "").startswith("https://")


def _error(status: HTTPStatus, name: str, message: str = "", *,
           headers: dict[str, str] | None = None, **more: object) -> Response:
    return JSONResponse({"error": name, "message": message, **more}, status, headers)
