"""What the LAN door serves: the page of a link and its files, and nothing else.

Whoever asks is a stranger on the network, in a browser that may be anywhere. All that counts is the
token, which is in no log, is told to no other site, and is not tried out: it has 192 bits.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from datetime import datetime
from functools import partial
from http import HTTPStatus

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route

from denseface.service.errors import ServiceError, StoreError
from denseface.service.kiosk.links.download import Download
from denseface.service.kiosk.links.face_files import (
    FORMATS,
    MEDIA_TYPES,
    FaceFiles,
    Format,
    NoFaceError,
    TryLaterError,
)
from denseface.service.kiosk.links.kept_links import KeptLinks
from denseface.service.kiosk.links.lan_guard import LanGuard
from denseface.service.kiosk.links.link_store import (
    BusyLinkError,
    GoneLinkError,
    LinkRecord,
    UnknownLinkError,
)
from denseface.service.kiosk.links.page import CONTENT_SECURITY_POLICY, message_page, page
from denseface.service.kiosk.texts import Texts
from denseface.service.kiosk.web.asgi import App
from denseface.service.kiosk.web.headers import SecurityHeaders

__all__ = ["lan_door"]

_RETRY_AFTER_S = 3
"""When to come again, as told to a client, seconds."""
_REFUSALS: dict[type[ServiceError], tuple[HTTPStatus, str]] = {
    UnknownLinkError: (HTTPStatus.NOT_FOUND, "unknown"),
    GoneLinkError: (HTTPStatus.GONE, "gone"),
    NoFaceError: (HTTPStatus.GONE, "gone"),
    BusyLinkError: (HTTPStatus.SERVICE_UNAVAILABLE, "busy"),
    TryLaterError: (HTTPStatus.SERVICE_UNAVAILABLE, "busy"),
}
"""What is answered, and the page's words, by what is wrong."""


def lan_door(
    links: KeptLinks, files: FaceFiles, texts: Mapping[str, Texts],
    hosts: Callable[[], Iterable[str]],
) -> App:
    """Give the door's application.

    Parameters
    ----------
    texts : by language, the first is for strangers
    hosts : gives the names, with ports, by which browsers may have come here
    """
    door = _Door(links, files, texts)
    app = Starlette(
        routes=[
            Route("/d/{token}", door.page, methods=["GET"]),
            Route("/d/{token}/face.{kind}", door.file, methods=["GET"]),
        ],
        exception_handlers={HTTPException: door.nothing})
    app.router.redirect_slashes = False
    return SecurityHeaders(LanGuard(app, hosts))


class _Door:
    def __init__(self, links: KeptLinks, files: FaceFiles, texts: Mapping[str, Texts]) -> None:
        self._links = links
        self._files = files
        self._texts = texts

    async def page(self, request: Request) -> Response:
        """Show what can be fetched; that takes no use."""
        token = request.path_params["token"]
        try:
            link = self._links.find(token)
        except (UnknownLinkError, GoneLinkError) as error:
            return self._refusal(request, error)
        until = datetime.fromtimestamp(link.expires_at).astimezone()
        return _html(page(self._texts_of(link), token, link.uses_left, until))

    async def file(self, request: Request) -> Response:
        """Give a file, which takes one use once all of it went out."""
        token, kind = request.path_params["token"], request.path_params["kind"]
        if kind not in FORMATS:
            raise HTTPException(HTTPStatus.NOT_FOUND)
        try:
            link = self._links.find(token)
            headers = {"content-disposition": f'attachment; filename="face.{kind}"',
                   "accept-ranges": "none", "connection": "close"}
            if request.method == "HEAD":
                return Response(headers=headers, media_type=MEDIA_TYPES[kind])
            return await self._download(token, link, kind, headers)
        except tuple(_REFUSALS) as error:
            return self._refusal(request, error)

    async def _download(
        self, token: str, link: LinkRecord, kind: Format, headers: Mapping[str, str]
    ) -> Download:
        await self._files.hold()
        begun = False
        try:
            self._links.begin(token)
            begun = True
            data = await self._files.make(link.capture_id, kind)
            self._links.find(token)  # it may have been withdrawn meanwhile
        except BaseException as error:
            self._files.release()
            if begun:
                await self._links.finish(link.digest, complete=False)
            if isinstance(error, NoFaceError):
                with suppress(StoreError):  # which is logged, and tried again
                    await self._links.forget(link.capture_id)
            raise

        async def ended(complete: bool) -> None:
            self._files.release()
            await self._links.finish(link.digest, complete=complete)

        return Download(data, MEDIA_TYPES[kind], headers, ended=ended,
                        wanted=partial(self._links.under_way, link.digest))

    async def nothing(self, request: Request, error: Exception) -> Response:
        """Answer what is no page and no file."""
        status = error.status_code if isinstance(error, HTTPException) else HTTPStatus.NOT_FOUND
        headers = error.headers if isinstance(error, HTTPException) else None
        return _html(message_page(self._stranger(request), "unknown"), status, headers)

    def _refusal(self, request: Request, error: ServiceError) -> Response:
        status, what = _REFUSALS[type(error)]
        texts = self._texts.get(getattr(error, "language", ""), self._stranger(request))
        headers = {"retry-after": str(_RETRY_AFTER_S)} if what == "busy" else None
        return _html(message_page(texts, what), status, headers)

    def _texts_of(self, link: LinkRecord) -> Texts:
        return self._texts.get(link.language) or next(iter(self._texts.values()))

    def _stranger(self, request: Request) -> Texts:
        """Choose a language that the browser asks for."""
        for asked in request.headers.get("accept-language", "").split(","):
            language = asked.partition(";")[0].partition("-")[0].strip().lower()
            if language in self._texts:
                return self._texts[language]
        return next(iter(self._texts.values()))


def _html(
    text: str, status: int = HTTPStatus.OK, more: Mapping[str, str] | None = None
) -> Response:
    return HTMLResponse(text, status, {
        "content-security-policy": CONTENT_SECURITY_POLICY, "connection": "close", **(more or {})})
