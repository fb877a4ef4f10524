"""Links for visitors: made when they keep a face, served at the LAN door, gone with the capture."""

import asyncio
import socket
import ssl
from collections.abc import Awaitable, Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

import segno
import structlog

from denseface.recon.face import Face
from denseface.service.errors import AddressError, ServiceError
from denseface.service.kiosk.links.addresses import (
    best_address,
    interfaces,
    own_addresses,
    url_host,
)
from denseface.service.kiosk.links.face_files import FORMATS, FaceFiles
from denseface.service.kiosk.links.kept_links import KeptLinks
from denseface.service.kiosk.links.lan_door import lan_door
from denseface.service.kiosk.links.lan_server import BoundedListener, LanConnection
from denseface.service.kiosk.links.link_file import LinkFile
from denseface.service.kiosk.page_messages import KeepScreen, Link
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.texts import Texts, load_texts
from denseface.service.kiosk.web.server import bind, serve
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.files import private_folder

__all__ = ["LinkOptions", "Links", "NoAddressError", "links_of", "qr_rows"]

_FILE = "links.json"
"""In the kiosk's folder."""
_BIND_S = 5.0
"""Time between two tries to have an address that is not there, seconds."""
_TIDY_S = 60.0
"""Time between two looks for links that have expired, seconds."""
_HUB_S = 10.0
"""Longest wait for the hub's face of a download, seconds."""
_MAX_SHOWN = 64
"""Captures whose link is given again where it is asked for again."""
_DEFAULT_PORTS = {"http": 80, "https": 443}


class NoAddressError(ServiceError, OSError):
    """No network is up by which a visitor could reach this machine."""


@dataclass(frozen=True)
class LinkOptions:
    """What the operator has set of links."""

    address: tuple[str, int]
    """Where the LAN door listens: IP address and port."""
    folder: Path
    """The kiosk's own, where links are kept over a restart."""
    uses: int = 5
    lifetime_s: float = 1800.0
    tls: ssl.SSLContext | None = None
    url: str | None = None
    """How visitors reach the door, `https://face.example:8443`; None for the address that is up."""


class Links:
    """The links of one kiosk, and the door where they lead; for one event loop.

    Parameters
    ----------
    get : gives a capture's face, as `AsyncClient.get`
    texts : by language, the first is the default

    Attributes
    ----------
    port : of the door; 0 until it listens
    listening : set when it does
    """

    def __init__(
        self, options: LinkOptions, get: Callable[[str], Awaitable[Face]],
        texts: Mapping[str, Texts],
    ) -> None:
        self._options = options
        self._scheme = "https" if options.tls else "http"
        self._links = KeptLinks(LinkFile(options.folder / _FILE), uses=options.uses,
                                lifetime_s=options.lifetime_s)
        self._shown: BoundedDict[str, str] = BoundedDict(_MAX_SHOWN)
        """Capture -> token of the link that was made for it; in memory alone."""
        self._door = lan_door(self._links, FaceFiles(get), texts, self._hosts)
        self.port = 0
        self.listening = asyncio.Event()

    async def make(self, capture_id: str, language: str) -> KeepScreen:
        """Make a link to a capture's files, or give the one again that was made and is good.

        Raises
        ------
        NoAddressError
            No network is up.
        """
        base = self._base()
        token = self._shown.get(capture_id, "")
        try:
            link = self._links.find(token)
        except LookupError:
            token, link = await self._links.make(capture_id, language)
            self._shown[capture_id] = token
        page = f"{base}/d/{token}"
        return KeepScreen(
            page=page, qr=qr_rows(page), uses=link.uses_left,
            expires_s=max(0.0, self._links.left_s(link)),
            links=tuple(Link(format=one, url=f"{page}/face.{one}") for one in FORMATS))

    async def forget(self, capture_id: str) -> None:
        """End all links to a capture, downloads under way too. Raises as `KeptLinks.forget`."""
        self._shown.pop(capture_id, None)
        await self._links.forget(capture_id)

    @property
    def reachable(self) -> bool:
        """Whether a link could be made now: a network is up."""
        with suppress(NoAddressError):
            return bool(self._base())
        return False

    async def serve(self) -> None:
        """Serve the door until cancelled; where it cannot have its address, wait for that.

        Visitors need not: until then they are offered no links.
        """
        bound = BoundedListener(await self._bind())
        self.port = bound.getsockname()[1]
        self.listening.set()
        structlog.get_logger("links").info("links are served", scheme=self._scheme,
                                           host=self._options.address[0], port=self.port)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(serve(self._door, bound, self._options.tls, http=LanConnection))
            tasks.create_task(self._tidy())

    async def _bind(self) -> socket.socket:
        """Bind, once a cable is in and the address is there; say once what is waited for."""
        said = ""
        while True:
            try:
                return await bind(self._options.address, "--kiosk-lan")
            except AddressError as error:
                if str(error) != said:
                    said = str(error)
                    structlog.get_logger("links").warning("no links yet", reason=said)
            await asyncio.sleep(_BIND_S)

    async def _tidy(self) -> None:
        while True:
            await asyncio.sleep(_TIDY_S)
            await self._links.tidy()

    def _base(self) -> str:
        """Give the beginning of a link's URL as it is now: addresses come and go."""
        if not self.port:
            raise NoAddressError("the port of the links is another program's")
        if self._options.url:
            return self._options.url.rstrip("/")
        bound = ip_address(self._options.address[0])
        if bound.is_unspecified:
            found = best_address(one for one in interfaces()
                                 if bound.version == 6 or one.address.version == 4)
        else:
            found = bound if url_host(bound) in own_addresses() else None
        if found is None:
            raise NoAddressError("no network is up by which a visitor could reach this machine")
        return f"{self._scheme}://{self._with_port(url_host(found))}"

    def _hosts(self) -> Iterable[str]:
        """Give all names of the door."""
        yield from map(self._with_port, own_addresses())
        if self._options.url:
            yield urlsplit(self._options.url).netloc.lower()

    def _with_port(self, host: str) -> str:
        return host if self.port == _DEFAULT_PORTS[self._scheme] else f"{host}:{self.port}"


def links_of(
    settings: KioskSettings, get: Callable[..., Awaitable[Face]]
) -> Links | None:
    """Give the links that the operator has set; None where they are off. Raises SettingsError.

    Parameters
    ----------
    get : `AsyncClient.get`
    """
    if settings.lan is None:
        return None
    options = LinkOptions(
        settings.lan, private_folder(settings.folder), uses=settings.link_uses,
        lifetime_s=settings.link_minutes * 60, tls=settings.lan_tls(), url=settings.lan_url)
    return Links(options, partial(get, timeout=_HUB_S), load_texts(settings.languages))


def qr_rows(text: str) -> tuple[str, ...]:
    """Encode a text as a QR code, 15 % of which may be unreadable (level M): rows of 0 and 1."""
    code = segno.make_qr(text, error="m", boost_error=False)
    return tuple("".join(map(str, row)) for row in code.matrix)
