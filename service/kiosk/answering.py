"""Whether the kiosk of these settings answers, asked from the machine that it runs on."""

import json
import ssl
from dataclasses import dataclass
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from ipaddress import ip_address

from denseface.service.errors import reason_of
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.web.guard import origins_of

__all__ = ["Answer", "ask"]

_ANSWER_S = 5.0
"""Longest wait, seconds."""
_MAX_ANSWER = 4096
"""Bytes of an answer."""


@dataclass(frozen=True)
class Answer:
    """What was heard at the kiosk's address."""

    ailment: str
    """Why no kiosk answers there; empty where one does."""
    another: bool = False
    """Whether something else answers there."""
    asks_consent: bool | None = None
    """Whether the kiosk asks its visitors first; None where none answers."""


def ask(settings: KioskSettings, within_s: float = _ANSWER_S) -> Answer:
    """Ask at the address of these settings whether a kiosk serves there."""
    host, port = settings.address
    if not port:
        return Answer(f"{settings.url}: any free port, so that it cannot be asked there")
    address = ip_address(host)
    if address.is_unspecified:
        address = ip_address("::1" if address.version == 6 else "127.0.0.1")
    origin = min(origins_of(settings.scheme, host, port, settings.proxy))
    connection = _connection(settings.scheme, str(address), port, within_s)
    said: object = None
    try:
        connection.request("GET", "/healthz", headers={"Host": origin.partition("://")[2]})
        answer = connection.getresponse()
        if answer.status != HTTPStatus.OK:
            return Answer(f"{settings.url}: answers with status {answer.status}", another=True)
        said = json.loads(answer.read(_MAX_ANSWER))
    except OSError as error:
        return Answer(f"{settings.url}: {reason_of(error)}")
    except (HTTPException, ValueError):
        pass
    finally:
        connection.close()
    match said:
        case {"serving": True, "consent": bool(asks)}:
            return Answer("", asks_consent=asks)
    return Answer(f"{settings.url}: what answers there is no kiosk", another=True)


def _connection(scheme: str, host: str, port: int, within_s: float) -> HTTPConnection:
    if scheme == "http":
        return HTTPConnection(host, port, timeout=within_s)
    # It is for the name that browsers use. Nothing is sent that is to be kept.
    unchecked = ssl.create_default_context()
    unchecked.check_hostname = False
    unchecked.verify_mode = ssl.CERT_NONE
    return HTTPSConnection(host, port, timeout=within_s, context=unchecked)
