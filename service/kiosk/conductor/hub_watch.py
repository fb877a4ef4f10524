"""How the hub is, told at each change, and at once when it says nothing any more."""

import asyncio
from collections.abc import Callable

from denseface.service.errors import ServiceError
from denseface.service.kiosk.conductor.ports import Hub
from denseface.service.kiosk.conductor.trouble import GONE, service_is
from denseface.service.kiosk.visit.events import ServiceIs

__all__ = ["watch_hub"]

_ASK_S = 0.3
"""Time between two questions, seconds: what is gone is to be known within a second."""
_ANSWER_S = 0.6
"""Longest wait for an answer, seconds."""


async def watch_hub(
    hub: Hub, sensor: str | None, reserve_bytes: int, tell: Callable[[ServiceIs], None]
) -> None:
    """Ask until cancelled; parameters as of `service_is`."""
    while True:
        try:
            tell(service_is(await hub.status(timeout=_ANSWER_S), sensor, reserve_bytes))
        except ServiceError:
            tell(GONE)
        await asyncio.sleep(_ASK_S)
