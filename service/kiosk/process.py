"""The kiosk's process: its servers, the conductor, and the end of all at a signal."""

import asyncio
import os
import signal
import ssl
from typing import Any

import structlog
from starlette.websockets import WebSocket

from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.web.app import kiosk_app
from denseface.service.kiosk.web.guard import origins_of
from denseface.service.kiosk.web.server import bind, serve, url_of
from denseface.service.runtime.supervisor_link import SupervisorLink
from denseface.service.settings import ServiceSettings

__all__ = ["run"]

_BEAT_S = 1.0
"""Time between two signs of life, seconds."""
_log = structlog.get_logger("kiosk")


def run(service: ServiceSettings, settings: KioskSettings,
        supervisor: SupervisorLink | None = None) -> int:
    """Serve the page until SIGINT or SIGTERM and give the exit status.

    Raises
    ------
    SettingsError
        Where a certificate cannot be used, or an address not be had.
    """
    os.umask(0o077)
    tls = settings.tls()
    with asyncio.Runner() as runner:
        return runner.run(_serve(service, settings, supervisor or SupervisorLink(), tls))


async def _serve(service: ServiceSettings, settings: KioskSettings, supervisor: SupervisorLink,
                 tls: ssl.SSLContext | None) -> int:
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[signal.Signals] = loop.create_future()

    def stop(number: signal.Signals) -> None:
        if not stopped.done():
            stopped.set_result(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop, number)
    serving: list[asyncio.Future[Any]] = [
        asyncio.create_task(_beat(supervisor)), asyncio.create_task(_page(service, settings, tls))]
    ended, _ = await asyncio.wait([stopped, *serving], return_when=asyncio.FIRST_COMPLETED)
    for task in serving:
        task.cancel()
    results = await asyncio.gather(*serving, return_exceptions=True)
    for error in results:
        if isinstance(error, Exception):
            raise error
    _log.info("stopped")
    return 130 if stopped in ended and stopped.result() is signal.SIGINT else 0


async def _beat(supervisor: SupervisorLink) -> None:
    while True:
        supervisor.beat()
        await asyncio.sleep(_BEAT_S)


async def _page(
    service: ServiceSettings, settings: KioskSettings, tls: ssl.SSLContext | None
) -> None:
    """Serve the page until cancelled."""
    bound = await bind(settings.address, "--kiosk-address")
    url = url_of(settings.scheme, bound)
    host, port = bound.getsockname()[:2]
    origins = origins_of(settings.scheme, host, port, settings.proxy)
    _log.info("the page for visitors", url=" ".join([url, *settings.proxy]),
              hub=service.address)
    await serve(kiosk_app(_nothing_yet, origins), bound, tls)


async def _nothing_yet(socket: WebSocket) -> None:
    await socket.close()
