"""Who may ask: a page of this very server, in a browser that went to it by a name it knows.

A page of anybody else's that runs in the same browser can have requests sent here, and by a name
that it lets point here (DNS rebinding) it could read the answers too. So the host, with its port,
is one of a short list, and so is the origin where a browser says it; nothing is matched by parts.
"""

from collections.abc import Iterable
from http import HTTPStatus
from ipaddress import ip_address

from denseface.service.kiosk.web.asgi import App, Receive, Scope, Send, header_values, refuse

__all__ = ["METHODS", "Guard", "origins_of"]

METHODS = frozenset({"GET", "HEAD", "POST"})
"""All others are refused."""
_READING = frozenset({"GET", "HEAD"})
"""Change nothing, so they need no origin: browsers send none with them."""
_DEFAULT_PORTS = {"http": 80, "https": 443}
"""Ports that browsers leave out."""
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


def origins_of(scheme: str, host: str, port: int, others: Iterable[str] = ()) -> frozenset[str]:
    """Give the origins of a page that is served at an address.

    Parameters
    ----------
    scheme : http or https
    host : IP address that is bound; of a wildcard, and of plain HTTP off the loopback, only
        loopback names and `others` are known
    others : of a reverse proxy
    """
    address = ip_address(host)
    names: tuple[str, ...] = ()
    if address.is_loopback or address.is_unspecified:
        names = _LOOPBACK
    elif scheme == "https":
        names = (f"[{address}]" if address.version == 6 else str(address),)
    end = "" if port == _DEFAULT_PORTS[scheme] else f":{port}"
    return frozenset({*(f"{scheme}://{name}{end}" for name in names), *others})


class Guard:
    """Lets through what a page of one of these origins asks, of every method and WebSockets.

    Parameters
    ----------
    app : what is guarded
    origins : scheme, host and port, as `origins_of` gives them
    linked : whether a link on another site may lead here; what that asks changes nothing
    """

    def __init__(self, app: App, origins: Iterable[str], *, linked: bool = False) -> None:
        self._app = app
        self._linked = linked
        self._origins: dict[str, set[str]] = {}
        """Host and port -> origins with them."""
        for origin in origins:
            self._origins.setdefault(origin.partition("://")[2].lower(), set()).add(origin)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through, or refuse with one line."""
        if scope["type"] not in ("http", "websocket"):
            return
        if why := self._wrong(scope):
            await refuse(scope, send, HTTPStatus.FORBIDDEN, why)
        elif scope["type"] == "http" and scope["method"] not in METHODS:
            await refuse(scope, send, HTTPStatus.METHOD_NOT_ALLOWED, "expected GET or POST",
                         [(b"allow", ", ".join(sorted(METHODS)).encode())])
        else:
            await self._app(scope, receive, send)

    def _wrong(self, scope: Scope) -> str:
        """Say what is wrong with a request; empty where nothing is."""
        hosts = header_values(scope, b"host")
        origins = self._origins.get(hosts[0].lower()) if len(hosts) == 1 else None
        if origins is None:
            return "this is not the address of the page"
        reading = scope["type"] == "http" and scope["method"] in _READING
        given = header_values(scope, b"origin")
        if (given or not reading) and not (len(given) == 1 and given[0] in origins):
            return "asked by another page"
        sites = header_values(scope, b"sec-fetch-site")
        if any(site not in ("same-origin", "none") for site in sites) and not (
                self._linked and reading and _follows_a_link(scope)):
            return "asked by another site"
        return ""


def _follows_a_link(scope: Scope) -> bool:
    return (header_values(scope, b"sec-fetch-mode") == ["navigate"]
            and header_values(scope, b"sec-fetch-dest") == ["document"])
