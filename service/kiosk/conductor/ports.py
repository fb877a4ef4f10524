"""What the conductor needs of others: the hub, and links to faces."""

from collections.abc import AsyncIterator
from typing import Protocol

from denseface.recon.face import Consent, Face
from denseface.service.client import PublishedPreview
from denseface.service.kiosk.page_messages import KeepScreen
from denseface.service.protocol.messages import Status
from denseface.service.protocol.sensor_messages import Gate

__all__ = ["Hub", "LinkMaker"]


class Hub(Protocol):
    """Of `AsyncClient`, with its errors."""

    async def press(
        self, capture_id: str | None = None, *, timeout: float = ..., sensor: str | None = ...,
        gate: Gate = ..., gate_timeout: float = ..., frames: int = ...,
        consent: Consent | None = ...,
    ) -> str:
        """Take a frame."""

    async def get(self, capture_id: str, *, timeout: float = ...) -> Face:
        """Wait for a face."""

    async def withdraw(self, capture_id: str, *, timeout: float = ...) -> int:
        """Remove a capture."""

    def previews(
        self, *, sensor: str | None = ..., timeout: float | None = ...
    ) -> AsyncIterator[PublishedPreview]:
        """Follow what a sensor sees."""

    def statuses(self, *, timeout: float | None = ...) -> AsyncIterator[Status | None]:
        """Follow how it is, None where it is gone."""


class LinkMaker(Protocol):
    """Of `links.Links`."""

    @property
    def reachable(self) -> bool:
        """Whether a link could be made now."""

    async def make(self, capture_id: str, language: str) -> KeepScreen:
        """Make links to a capture's files, or give those again that were made. ServiceError."""

    async def forget(self, capture_id: str) -> None:
        """End all links to a capture."""
