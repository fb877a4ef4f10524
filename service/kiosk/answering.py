"""Whether the kiosk of these settings answers, asked from the machine that it runs on."""

import json
import ssl
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from ipaddress import ip_address

from denseface.service.errors import reason_of
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.web.guard import origins_of

__all__ = ["why_silent"]

_ANSWER_S = 5.0
"""Longest wait, seconds."""
_MAX_ANSWER = 4096
"""Bytes of an answer."""


def why_silent(settings: KioskSettings) -> str:
    """Say why no kiosk answers at its address; empty where one does."""
    host, port = settings.address
    if not port:
        return f"{settings.url}: any free port, so that it cannot be asked there"
    address = ip_address(host)
    if address.is_unspecified:
        address = ip_address("::1" if address.version == 6 else "127.0.0.1")
    origin = min(origins_of(settings.scheme, host, port, settings.proxy))
    connection = _connection(settings.scheme, str(address), port)
    try:
        connection.request("GET", "/healthz", headers={"Host": origin.partition("://")[2]})
        answer = connection.getresponse()
        if answer.status != HTTPStatus.OK:
            return f"{settings.url}: answers with status {answer.status}"
        said = json.loads(answer.read(_MAX_ANSWER))
        well = isinstance(said, dict) and said.get("serving") is True
    except OSError as error:
        return f"{settings.url}: {reason_of(error)}"
    except (HTTPException, ValueError):
        well = False
    finally:
        connection.close()
    return "" if well else f"{settings.url}: what answers there is no kiosk"


def _connection(scheme: str, host: str, port: int) -> HTTPConnection:
    if scheme == "http":
        return HTTPConnection(host, port, timeout=_ANSWER_S)
    # It is for the name that browsers use. Nothing is sent that is to be kept.
    unchecked = ssl.create_default_context()
    unchecked.check_hostname = False
    unchecked.verify_mode = ssl.CERT_NONE
    return HTTPSConnection(host, port, timeout=_ANSWER_S, context=unchecked)
