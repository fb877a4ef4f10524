"""A source as the capture process reads it: without an end, and with a look ahead for previews."""

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, runtime_checkable

from denseface.capture import CaptureError, RgbdFrame, Source, open_source
from denseface.capture.errors import SensorError, UnreadableSourceError

__all__ = ["SensorReader"]


@runtime_checkable
class _LiveSource(Protocol):
    """A source that goes on by itself."""

    def flush(self) -> None:
        """Discard the frames that wait."""


class SensorReader:
    """Reads frames of a sensor or recording; all but `live` is called in the driver's thread."""

    def __init__(self, uri: str, calibration: Path | None, rotation: int = 0) -> None:
        self.uri = uri
        self._calibration = calibration
        self._rotation = rotation
        self._source: Source | None = None
        self._frames: Iterator[RgbdFrame] | None = None
        self._peeked: RgbdFrame | CaptureError | None = None
        """What the next `take` gives of a recording, after a `peek`."""
        self._flush_due = False

    @property
    def live(self) -> bool:
        """Whether the source shows the world rather than a recording."""
        return isinstance(self._source, _LiveSource)

    def open(self) -> None:
        """Open the source; raises as `open_source`."""
        self._source = open_source(
            self.uri, calibration=self._calibration, rotation=self._rotation)

    def take(self) -> RgbdFrame:
        """Give the newest frame of a live sensor; of a recording the next one, over and over.

        Raises
        ------
        CaptureError
            Where there is none.
        """
        peeked, self._peeked = self._peeked, None
        if isinstance(peeked, CaptureError):
            raise peeked
        if peeked is not None:
            return peeked
        if self._flush_due and isinstance(self._source, _LiveSource):
            self._source.flush()  # frames that wait since the last preview are older than the press
        self._flush_due = False
        if self._source is not None:
            self._source.look_closely(refuse=True)
        return self._next()

    def peek(self) -> RgbdFrame:
        """Give the newest frame of a live sensor; of a recording the one that `take` gives next.

        Raises as `take`; an error of a recording is raised again by the next `take`.
        """
        self._flush_due = True
        if self.live:
            return self._next()
        if self._peeked is None:
            try:
                self._peeked = self._next()
            except CaptureError as error:
                self._peeked = error
        if isinstance(self._peeked, CaptureError):
            raise self._peeked
        return self._peeked

    def close(self) -> None:
        """Close the source, where it is open."""
        if self._source is not None:
            self._source.close()

    def _next(self) -> RgbdFrame:
        if self._source is None:
            raise SensorError(f"{self.uri}: is not open")
        for _ in range(2):
            if self._frames is not None:
                frame = next(self._frames, None)
                if frame is not None:
                    return frame
                if not getattr(self._source, "repeats", True):  # another's need not say
                    raise UnreadableSourceError(f"{self.uri}: the recording is at its end")
            self._frames = iter(self._source)
        raise UnreadableSourceError(f"{self.uri}: holds no pair of a depth and a colour frame")
