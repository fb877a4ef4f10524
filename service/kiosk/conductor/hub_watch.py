"""How the hub is, told at each change, and at once when it says nothing any more."""

import asyncio
from collections.abc import Callable

import structlog

from denseface.service.errors import ServiceError
from denseface.service.kiosk.conductor.ports import Hub
from denseface.service.kiosk.conductor.trouble import GONE, service_is
from denseface.service.kiosk.visit.events import ServiceIs

__all__ = ["watch_hub"]

_AGAIN_S = 0.5
"""Time until it is followed again where that ended, seconds."""


async def watch_hub(hub: Hub, sensor: str | None, tell: Callable[[ServiceIs], None]) -> None:
    """Follow what it publishes until cancelled; `sensor` as of `service_is`."""
    while True:
        try:
            async for status in hub.statuses():
                tell(GONE if status is None else service_is(status, sensor))
        except ServiceError as error:
            tell(GONE)
            structlog.get_logger("kiosk").warning("the hub is not followed", reason=str(error))
        await asyncio.sleep(_AGAIN_S)
