"""The kiosk's process: its parts put together, and the end of all at a signal."""

import asyncio
import os
import secrets
import signal
import ssl
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import structlog
from starlette.routing import Route

from denseface.service.client import AsyncOperator
from denseface.service.kiosk.button.watch import check_button, watch_button
from denseface.service.kiosk.conductor.conductor import Conductor, ConductorOptions
from denseface.service.kiosk.conductor.hub_watch import watch_hub
from denseface.service.kiosk.conductor.kept_withdrawals import KeptWithdrawals
from denseface.service.kiosk.conductor.measuring import prepare
from denseface.service.kiosk.consent_text import load_consent_text
from denseface.service.kiosk.operator.opening import operator_routes
from denseface.service.kiosk.page_messages import Hello
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.visit.machine import Kiosk
from denseface.service.kiosk.visit.options import VisitOptions
from denseface.service.kiosk.web.app import kiosk_app, kiosk_files
from denseface.service.kiosk.web.files import Files
from denseface.service.kiosk.web.guard import origins_of
from denseface.service.kiosk.web.server import bind, serve, stop_signal, url_of
from denseface.service.runtime.watching.service_manager import ServiceManager
from denseface.service.runtime.watching.supervisor_link import SupervisorLink
from denseface.service.settings import ServiceSettings
from denseface.version import VERSION

if TYPE_CHECKING:
    from denseface.service.kiosk.links.links import Links

__all__ = ["run", "visit_options"]

_BEAT_S = 1.0
"""Time between two signs of life, seconds."""
_CLOSE_S = 1.5
"""Longest wait at the end for what is being withdrawn, seconds."""
_log = structlog.get_logger("kiosk")


def run(service: ServiceSettings, settings: KioskSettings,
        supervisor: SupervisorLink | None = None) -> int:
    """Serve the page until SIGINT or SIGTERM and give the exit status.

    Raises
    ------
    SettingsError
        Where a file that is named cannot be used, or an address not be had.
    """
    os.umask(0o077)
    tls, options = settings.tls(), visit_options(settings)
    if settings.button is not None:
        check_button(settings.button)
    kept = KeptWithdrawals(settings.folder, service.address)
    with asyncio.Runner() as runner:
        return runner.run(_run(service, settings, options, kept, tls,
                               supervisor or SupervisorLink()))


def visit_options(settings: KioskSettings) -> VisitOptions:
    """Give what the operator has set of a visit; SettingsError where the consent is malformed."""
    options = VisitOptions(
        consent=settings.consent, links=settings.lan is not None, auto=settings.auto,
        countdown=settings.countdown, position_s=settings.idle_s, result_s=settings.result_idle_s)
    if settings.consent_text is None:
        return options
    own = load_consent_text(settings.consent_text, settings.languages)
    return replace(options, text_version=own.version, text=own.text)


async def _run(service: ServiceSettings, settings: KioskSettings, options: VisitOptions,
               kept: KeptWithdrawals, tls: ssl.SSLContext | None,
               supervisor: SupervisorLink) -> int:
    stopped = stop_signal()
    files = kiosk_files()
    hello = Hello(languages=settings.languages, sound=settings.sound, speech=settings.speech,
                  version=f"{VERSION}-{files.digest[:12]}")
    with closing(AsyncOperator(service.address, key=service.key, hub_key=service.hub_key)) as hub:
        kiosk = Kiosk(options, new_id=lambda: secrets.token_hex(16), utc=_utc)
        links = _links(settings, hub)
        conductor = Conductor(
            kiosk, hub, kept, ConductorOptions(hello, settings.sensor, settings.measurements),
            links)
        routes = operator_routes(
            hub, service, settings, files,
            lambda: kiosk.hint_statistics.as_dict() | conductor.figures.as_dict(),
            links.forget if links else _no_links)
        conductor.start()
        also = [asyncio.create_task(asyncio.to_thread(prepare))] if settings.measurements else []
        button = [] if settings.button is None else [
            watch_button(settings.button, conductor.button, grab=settings.button_grab)]
        working: list[asyncio.Future[Any]] = [asyncio.create_task(work) for work in (
            _beat(supervisor),
            watch_hub(hub, settings.sensor, conductor.service_is),
            _serve_page(settings, conductor, files, routes, tls, supervisor.manager),
            *([links.serve()] if links else []), *button)]
        try:
            await asyncio.wait([stopped, *working], return_when=asyncio.FIRST_COMPLETED)
        finally:
            supervisor.manager.stopping()
            for task in (*working, *also):
                task.cancel()
            results = await asyncio.gather(*working, *also, return_exceptions=True)
            await conductor.close(_CLOSE_S)
    for error in results:
        if isinstance(error, Exception):
            raise error
    _log.info("stopped")
    return 130 if stopped.result() is signal.SIGINT else 0


async def _serve_page(
    settings: KioskSettings, conductor: Conductor, files: Files, routes: Sequence[Route],
    tls: ssl.SSLContext | None, manager: ServiceManager,
) -> None:
    """Serve the page until cancelled."""
    manager.status("waits for its port")
    bound = await bind(settings.address, "--kiosk-address")
    host, port = bound.getsockname()[:2]
    origins = origins_of(settings.scheme, host, port, settings.proxy)
    url = " ".join([url_of(settings.scheme, bound), *settings.proxy])
    _log.info("the page for visitors", url=url)
    await serve(kiosk_app(conductor.page, origins, files, routes, asks_consent=settings.consent),
                bound, tls, served=lambda: manager.ready(f"serves the page at {url}"))


def _links(settings: KioskSettings, hub: AsyncOperator) -> "Links | None":
    """Give the links to faces; None where they are off. Raises SettingsError."""
    if settings.lan is None:
        return None
    # With what knows this machine's addresses and draws QR codes.
    from denseface.service.kiosk.links.links import links_of

    return links_of(settings, hub.get)


async def _no_links(_: str) -> None:
    """There are none to a capture."""


async def _beat(supervisor: SupervisorLink) -> None:
    supervisor.manager.need(3 * _BEAT_S)
    while True:
        supervisor.beat()
        await asyncio.sleep(_BEAT_S)


def _utc() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
