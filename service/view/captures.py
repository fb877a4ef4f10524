"""Captures of a hub: connected to when the first one is asked for."""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from types import TracebackType
from typing import Self

from denseface.service.client import Operator
from denseface.service.errors import ServiceError, UnknownCaptureError
from denseface.service.export import FaceFiles
from denseface.service.tools.fetch import fetch_face
from denseface.service.view.items import FaceItem

__all__ = ["Captures"]


class Captures:
    """Fetches captures, until its `with` block ends.

    Parameters
    ----------
    connect : gives an operator of the hub
    timeout : longest wait for a face that is being made, seconds
    """

    def __init__(
        self, connect: Callable[[], AbstractContextManager[Operator]], timeout: float
    ) -> None:
        self._connect = connect
        self._timeout = timeout
        self._open = ExitStack()
        self._operator: Operator | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.close()

    def fetch(self, capture_id: str) -> FaceItem:
        """Fetch a capture's face and, where the hub has it yet, its frame.

        Raises
        ------
        CaptureFailedError
            It has no face.
        ServiceError
            As `Client.get`.
        """
        hub = self._connected()
        face = fetch_face(hub, capture_id, FaceFiles(), self._timeout)
        try:
            frame = hub.get_frame(capture_id, timeout=self._timeout)
        except ServiceError:
            frame = None
        return FaceItem(capture_id, face, frame, capture=True)

    def last(self) -> FaceItem:
        """Fetch the capture that was accepted last; errors as `fetch`, and where there is none."""
        if not (newest := self._connected().captures(1)):
            raise UnknownCaptureError("--last: the hub keeps no capture")
        return self.fetch(newest[0].capture_id)

    def _connected(self) -> Operator:
        if self._operator is None:
            self._operator = self._open.enter_context(self._connect())
        return self._operator
