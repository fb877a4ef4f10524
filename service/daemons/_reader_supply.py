"""Frames of a source that is read frame after frame, for the capture process; in a thread."""

from collections import deque
from collections.abc import Iterator
from contextlib import suppress

import structlog

from denseface.capture import CaptureError, RgbdFrame
from denseface.capture.errors import SensorError
from denseface.service.daemons._supply import NotTaken, Outcome, Picture, Supply, SupplyState, Taken
from denseface.service.daemons.sensor import SensorReader
from denseface.service.protocol import messages
from denseface.service.runtime.background import Background

_CLOSING_S = 3.0
"""Longest wait for the driver's last call when the process stops, seconds."""
_log = structlog.get_logger("capture")


class ReaderSupply(Supply):
    """Presses go before pictures; a press gets the frame that the last picture showed.

    Parameters
    ----------
    timeout_s : how long the driver may take for one frame
    """

    def __init__(
        self, reader: SensorReader, driver: Background[RgbdFrame | None], timeout_s: float
    ) -> None:
        self.wake = self._driver = driver
        self._reader = reader
        self._timeout_s = timeout_s
        self._open = False
        self._presses: deque[str] = deque()
        """Captures that wait for their frame, oldest first."""
        self._preview_due = False
        self._peeking = False
        """Whether the driver's call is for a preview."""
        driver.start(reader.open)

    @property
    def state(self) -> SupplyState:
        return SupplyState("streaming") if self._open else SupplyState(
            "opening", "the source is being opened")

    def press(self, take: messages.Take) -> None:
        if take.capture_id not in self._presses:
            self._presses.append(take.capture_id)

    def preview(self) -> None:
        self._preview_due = True

    def step(self, *, busy: bool) -> Iterator[Outcome]:
        if self._driver.done():
            yield from self._finish_call()
        if self._driver:
            return
        if self._presses:
            self._driver.start(self._reader.take)
        elif self._preview_due and not busy:
            self._peeking = True
            self._driver.start(self._reader.peek)

    def _finish_call(self) -> Iterator[Outcome]:
        if not self._open:
            self._driver.result()
            self._open = True
            _log.info("source open", source=self._reader.uri)
            return
        peeking, self._peeking = self._peeking, False
        live = self._reader.live
        try:
            frame = self._driver.result()
        except CaptureError as error:
            if peeking:
                self._preview_due = False
                _log.warning("no preview", reason=str(error))
            else:
                yield NotTaken(self._presses.popleft(), str(error))
            if isinstance(error, SensorError):
                raise
            return
        if frame is None:
            return
        # A live sensor's frame that came after a press is the press's, for whatever it was taken.
        if self._presses and (not peeking or live):
            yield Taken(self._presses.popleft(), frame)
        if self._preview_due and not self._presses and (peeking or live):
            self._preview_due = False
            yield Picture(frame)

    def hangs(self) -> str:
        seconds = self._driver.elapsed_s
        if seconds <= self._timeout_s or self._driver.done():
            return ""
        return f"{self._reader.uri}: no frame within {seconds:.0f} s"

    def close(self) -> bool:
        if not self._driver.wait(_CLOSING_S):
            return False
        with suppress(CaptureError):
            if self._driver:
                self._driver.result()
        self._driver.start(self._reader.close)
        return self._driver.wait(_CLOSING_S)
