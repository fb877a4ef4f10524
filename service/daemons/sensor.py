"""A source as the capture process uses it: without an end, and to be looked at before a press."""

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, runtime_checkable

from denseface.capture import CaptureError, RgbdFrame, Source, open_source
from denseface.capture.errors import SensorError, UnreadableSourceError

__all__ = ["Sensor"]


@runtime_checkable
class _Live(Protocol):
    """A source that goes on by itself."""

    def flush(self) -> None:
        """Throw away what waits."""


class Sensor:
    """All methods but `live` are called in the driver's thread."""

    def __init__(self, uri: str, calibration: Path | None) -> None:
        self.uri = uri
        self._calibration = calibration
        self._source: Source | None = None
        self._frames: Iterator[RgbdFrame] = iter(())
        self._ahead: RgbdFrame | CaptureError | None = None
        """What the next `take` gives of a recording, where it was looked at before."""
        self._looked = False

    @property
    def live(self) -> bool:
        """Say whether it shows the world rather than a recording."""
        return isinstance(self._source, _Live)

    def open(self) -> None:
        """Open the source; raises as `open_source`."""
        self._source = open_source(self.uri, calibration=self._calibration)

    def take(self) -> RgbdFrame:
        """Give the next frame of a recording, over and over; the newest of a live sensor.

        Raises
        ------
        CaptureError
            Where there is none.
        """
        ahead, self._ahead = self._ahead, None
        if isinstance(ahead, CaptureError):
            raise ahead
        if ahead is not None:
            return ahead
        if self._looked and isinstance(self._source, _Live):
            self._source.flush()  # what was not looked at since is from before the press
        self._looked = False
        return self._next()

    def look(self) -> RgbdFrame:
        """Give the frame that the next `take` gives of a recording; the newest of a live sensor.

        Raises as `take`; what is wrong with a recording, the next `take` says again.
        """
        self._looked = True
        if self.live:
            return self._next()
        if self._ahead is None:
            try:
                self._ahead = self._next()
            except CaptureError as error:
                self._ahead = error
        if isinstance(self._ahead, CaptureError):
            raise self._ahead
        return self._ahead

    def close(self) -> None:
        """Let go of it."""
        if self._source is not None:
            self._source.close()

    def _next(self) -> RgbdFrame:
        if self._source is None:
            raise SensorError(f"{self.uri}: is not open")
        for _ in range(2):
            frame = next(self._frames, None)
            if frame is not None:
                return frame
            self._frames = iter(self._source)
        raise UnreadableSourceError(f"{self.uri}: holds no pair of a depth and a colour frame")
