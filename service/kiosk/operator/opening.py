"""The operator's page of a kiosk, put together; its token is made at the first start."""

import os
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import structlog
from starlette.routing import Route

from denseface.service.kiosk.operator.desk import Desk, Hub
from denseface.service.kiosk.operator.log_lines import keep_lines
from denseface.service.kiosk.operator.page import OperatorPage
from denseface.service.kiosk.operator.token import OperatorToken
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.web.files import Files
from denseface.service.settings import ServiceSettings
from denseface.version import VERSION

__all__ = ["operator_routes"]

_STDERR = 2


def operator_routes(
    hub: Hub, service: ServiceSettings, settings: KioskSettings, files: Files,
    statistics: Callable[[], Mapping[str, Any]], forget: Callable[[str], Awaitable[None]],
) -> list[Route]:
    """Give the routes of the operator's page.

    Parameters
    ----------
    files : of the kiosk's page
    statistics : gives why visitors wait
    forget : ends the links to a capture

    Raises
    ------
    SettingsError
        The kiosk's folder or the token's file cannot be used.
    """
    token = OperatorToken(settings.folder)
    _ensure(token)
    keep_lines()
    lan = settings.lan
    desk = Desk(
        hub,
        {"version": VERSION, "consent": settings.consent,
         "links": settings.lan_url or (f"{lan[0]}:{lan[1]}" if lan else None),
         "links_tls": settings.lan_certificate is not None
         or (settings.lan_url or "").startswith("https:"),
         "reserve_bytes": service.reserve_mib * 2**20},
        statistics, forget)
    return OperatorPage(desk, token, files, time.monotonic).routes()


def _ensure(token: OperatorToken) -> None:
    """See to it that there is a token, and show a new one on the terminal: never in a log."""
    if os.isatty(_STDERR):
        if secret := token.ensure():
            os.write(_STDERR, f"the operator's token, shown this once: {secret}\n".encode())
    elif not token.path.exists():
        structlog.get_logger("operator").info(
            "there is no operator's token yet: denseface kiosk --new-operator-token makes one")
    else:
        token.ensure()
