"""What is served where."""

from collections.abc import Awaitable, Callable, Iterable, Sequence

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from denseface.service.kiosk.installed import LANGUAGES, STATIC
from denseface.service.kiosk.web.asgi import App
from denseface.service.kiosk.web.files import Files
from denseface.service.kiosk.web.guard import Guard
from denseface.service.kiosk.web.headers import SecurityHeaders
from denseface.service.kiosk.web.limits import Limits

__all__ = ["guarded", "kiosk_app", "kiosk_files"]


def kiosk_files() -> Files:
    """Read the built page and the languages."""
    return Files({"static/": STATIC, "languages/": LANGUAGES})


def kiosk_app(
    web_socket: Callable[[WebSocket], Awaitable[None]], origins: Iterable[str], files: Files,
    more: Sequence[BaseRoute] = (), *, asks_consent: bool = True,
) -> App:
    """Give the application of the kiosk's page.

    Parameters
    ----------
    web_socket : speaks with a page over its WebSocket
    origins : of the page
    files : of `kiosk_files`
    more : what else is served, such as the operator's page
    asks_consent : whether visitors are asked first, as `/healthz` tells the doctor
    """
    async def page(request: Request) -> Response:
        return files.answer("static/index.html", request)

    async def file(request: Request) -> Response:
        return files.answer(request.url.path.removeprefix("/"), request)

    async def health(_: Request) -> Response:
        return JSONResponse({"serving": True, "consent": asks_consent})

    app = Starlette(routes=[
        Route("/", page), Route("/healthz", health), Route("/static/{name:path}", file),
        Route("/languages/{name:path}", file), WebSocketRoute("/ws", web_socket), *more])
    app.router.redirect_slashes = False
    return guarded(app, origins)


def guarded(app: App, origins: Iterable[str], *, linked: bool = False) -> App:
    """Give an application behind its guards; `linked` as of `Guard`."""
    return SecurityHeaders(Guard(Limits(app), origins, linked=linked))
