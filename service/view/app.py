"""What the page's server answers, all of it below one path that nobody can guess."""

import secrets
from collections.abc import Iterable
from http import HTTPStatus

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from denseface.service.errors import UsageError
from denseface.service.kiosk.web.app import guarded, kiosk_files
from denseface.service.kiosk.web.asgi import App, Receive, Scope, Send, refuse
from denseface.service.view.messages import Listing
from denseface.service.view.pages import Pages
from denseface.service.view.peers import OwnUser
from denseface.service.view.shelf import Shelf
from denseface.service.view.telling import Told
from denseface.version import VERSION

__all__ = ["view_app"]

_ITEM = "/items/{item:int}/{number:int}"


def view_app(
    shelf: Shelf, pages: Pages, token: str, origins: Iterable[str], *, once: bool = False
) -> App:
    """Give the application.

    Parameters
    ----------
    shelf : what can be looked at
    pages : is told of each page that is opened and closed
    token : first part of every path; anything else is not found
    origins : of the page
    once : whether the server ends with the last page
    """
    files = kiosk_files()
    listing = Listing(items=shelf.heads, version=VERSION, once=once)

    async def page(request: Request) -> Response:
        return files.answer("static/view.html", request)

    async def file(request: Request) -> Response:
        return files.answer(f"static/{request.path_params['name']}", request)

    async def texts(request: Request) -> Response:
        return files.answer("languages/en.json", request)

    async def items(_: Request) -> Response:
        return _json(listing.model_dump_json())

    async def seen(request: Request) -> Response:
        told = await _told(request)
        return told if isinstance(told, Response) else _json(told.seen.model_dump_json())

    async def shape(request: Request) -> Response:
        told = await _told(request)
        return told if isinstance(told, Response) else _bytes(told.shape,
                                                              "application/octet-stream")

    async def picture(request: Request) -> Response:
        told = await _told(request)
        return told if isinstance(told, Response) else _bytes(told.picture, "image/png")

    async def _told(request: Request) -> Told | Response:
        try:
            return await shelf.told(request.path_params["item"], request.path_params["number"])
        except LookupError:
            return PlainTextResponse("there is no such item\n", 404)
        except UsageError as error:
            return PlainTextResponse(f"{error}\n", 404)

    async def opened(socket: WebSocket) -> None:
        await socket.accept()
        with pages.open():
            try:
                while True:
                    await socket.receive_text()
            except WebSocketDisconnect:
                pass

    app = Starlette(routes=[
        Route("/", page), Route("/items.json", items), Route("/texts.json", texts),
        Route(f"{_ITEM}/seen.json", seen), Route(f"{_ITEM}/shape.bin", shape),
        Route(f"{_ITEM}/picture.png", picture), WebSocketRoute("/open", opened),
        Route("/{name}", file)])
    app.router.redirect_slashes = False
    # A link in a terminal that is itself a page may lead here: it knows the token.
    return guarded(OwnUser(_Behind(app, token)), origins, linked=True)


def _json(text: str) -> Response:
    return Response(text, media_type="application/json")


def _bytes(data: bytes, kind: str) -> Response:
    if not data:
        return PlainTextResponse("there is none\n", 404)
    return Response(data, media_type=kind)


class _Behind:
    """Gives what lies below a path's first part, the token, and nothing else."""

    def __init__(self, app: App, token: str) -> None:
        self._app = app
        self._token = token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        _, _, rest = scope["path"].partition("/")
        given, slash, rest = rest.partition("/")
        if slash and secrets.compare_digest(given.encode(), self._token):
            below = f"/{rest}"
            await self._app({**scope, "path": below, "raw_path": below.encode(), "root_path": ""},
                            receive, send)
        else:
            await refuse(scope, send, HTTPStatus.NOT_FOUND, "there is nothing here")
