"""What an operator sees and does, without HTTP."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from functools import partial
from typing import Any, Protocol

from pydantic import TypeAdapter, ValidationError

from denseface.recon.face import Face
from denseface.service.errors import ServiceError, UnknownCaptureError
from denseface.service.kiosk.operator.log_lines import recent_log
from denseface.service.kiosk.operator.looks import Look, Looks
from denseface.service.protocol.message_base import CaptureId, CaptureSummary, DeadLetter
from denseface.service.protocol.messages import Status

__all__ = ["MOST_CAPTURES", "Desk", "Hub"]

MOST_CAPTURES = 50
"""That the hub lists."""
_MOST_DEAD = 100
_STATUS_S = 3.0
"""Longest wait for the status, seconds."""
_FACE_S = 10.0
"""Longest wait for a face, seconds: it is there or it is not."""
_CAPTURE_ID: TypeAdapter[str] = TypeAdapter(CaptureId)


class Hub(Protocol):
    """Of `AsyncOperator`, with its errors."""

    async def status(self, *, timeout: float = ...) -> Status:
        """Ask how it is."""

    async def get(self, capture_id: str, *, timeout: float = ...) -> Face:
        """Wait for a face."""

    async def captures(
        self, last: int = ..., *, timeout: float = ...
    ) -> tuple[CaptureSummary, ...]:
        """List the captures that were accepted last."""

    async def purge(self, *, capture_id: str | None = ..., timeout: float = ...) -> int:
        """Remove captures."""

    def dead(self, *, timeout: float = ...) -> AsyncIterator[DeadLetter]:
        """List the captures that were given up."""

    async def retry(self, capture_id: str, *, timeout: float = ...) -> None:
        """Try one of them again."""

    async def drop(self, capture_id: str, *, timeout: float = ...) -> None:
        """Remove one of them."""

    async def restart_sensor(self, name: str, *, timeout: float = ...) -> None:
        """Have a capture process begin anew."""


class Desk:
    """The operator's of one kiosk.

    Parameters
    ----------
    hub : what is asked
    kiosk : what is set here, as the page shows it
    statistics : gives why visitors wait, as `HintStatistics.as_dict`
    forget : ends the links to a capture
    """

    def __init__(
        self, hub: Hub, kiosk: Mapping[str, Any], statistics: Callable[[], Mapping[str, Any]],
        forget: Callable[[str], Awaitable[None]],
    ) -> None:
        self._hub = hub
        self._looks = Looks(partial(hub.get, timeout=_FACE_S))
        self._kiosk = kiosk
        self._statistics = statistics
        self._forget = forget

    async def overview(self) -> dict[str, Any]:
        """Give how all is; the hub's part is None where it does not answer."""
        try:
            status = (await self._hub.status(timeout=_STATUS_S)).model_dump(mode="json")
        except ServiceError:  # the rest of the page is good, and says it
            status = None
        return {"kiosk": dict(self._kiosk), "statistics": dict(self._statistics()),
                "status": status}

    async def captures(self, last: int) -> list[dict[str, Any]]:
        """List the last captures, at most `MOST_CAPTURES`, newest first."""
        captures = await self._hub.captures(MOST_CAPTURES)
        self._looks.keep_only(frozenset(one.capture_id for one in captures))
        return [one.model_dump(mode="json") for one in captures[:last]]

    async def look(self, capture_id: str) -> Look:
        """Show one that the hub has still; raises as `AsyncClient.get`."""
        capture_id = _checked(capture_id)
        await self.captures(MOST_CAPTURES)  # what was removed meanwhile, by a visitor too, is gone
        return await self._looks.of(capture_id)

    async def delete(self, capture_id: str) -> None:
        """Remove all of a capture, its links first."""
        capture_id = _checked(capture_id)
        await self._forget(capture_id)
        self._looks.forget(capture_id)
        await self._hub.purge(capture_id=capture_id)

    async def dead(self) -> list[dict[str, Any]]:
        """List the dead letters, the oldest hundred."""
        letters = []
        async for letter in self._hub.dead():
            letters.append(letter.model_dump(mode="json"))
            if len(letters) == _MOST_DEAD:
                break
        return letters

    async def retry(self, capture_id: str) -> None:
        """Try a dead letter again."""
        await self._hub.retry(_checked(capture_id))

    async def drop(self, capture_id: str) -> None:
        """Remove a dead letter."""
        capture_id = _checked(capture_id)
        self._looks.forget(capture_id)
        await self._hub.drop(capture_id)

    async def restart_sensor(self, name: str) -> None:
        """Have a sensor closed and opened again."""
        await self._hub.restart_sensor(name)

    async def log(self) -> bytes:
        """Give the last lines of the log."""
        return await asyncio.to_thread(recent_log)


def _checked(capture_id: str) -> str:
    try:
        return _CAPTURE_ID.validate_python(capture_id)
    except ValidationError as error:
        raise UnknownCaptureError("not the id of a capture") from error
