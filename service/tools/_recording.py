"""Frames for a recording, read by a thread: who writes them waits for no driver."""

import math
import queue
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from denseface.capture import CaptureError, RgbdFrame, open_source
from denseface.capture.errors import SensorError
from denseface.capture.live.sensor import LiveSensor, open_sensor
from denseface.capture.live.states import LiveState

__all__ = ["FrameReader"]

_QUEUED = 60
"""Frames in memory that wait for the disk, at most: two seconds of a sensor, 90 MB."""
_SLICE_S = 0.1
"""Longest single wait, seconds."""
_ABSENT_S, _OPENING_S = 2.0, 20.0
"""Longest wait for a sensor that is not there or cannot be had, and for one that is being opened,
seconds."""
_CLOSING_S = 3.0
"""Longest wait for the driver's last call, seconds."""


class FrameReader:
    """Reads a source from its making on; the thread alone calls it.

    Attributes
    ----------
    live : whether frames come by themselves: those that are not fetched in time are lost
    lost : how many were lost so far
    """

    def __init__(self, uri: str, calibration: Path | None) -> None:
        self._uri, self._calibration = uri, calibration
        self.live = False
        self.lost = 0
        self.waits_for = "the source"
        """What is waited for before the first frame, for people."""
        self._frames: queue.Queue[RgbdFrame | CaptureError | None] = queue.Queue(_QUEUED)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="frames", daemon=True)
        self._thread.start()

    def next(self) -> RgbdFrame | None:
        """Give the next frame, or None where none came for a moment.

        Raises
        ------
        EOFError
            There are no more.
        CaptureError
            The source cannot be opened or read, or the sensor was lost or fell silent.
        """
        try:
            found = self._frames.get(timeout=_SLICE_S)
        except queue.Empty:
            return None
        if found is None:
            raise EOFError
        if isinstance(found, CaptureError):
            raise found
        return found

    def close(self) -> bool:
        """End the thread; False where the driver hangs, and the process is to be ended."""
        self._stop.set()
        self._thread.join(_CLOSING_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        end: CaptureError | None = None
        try:
            sensor = open_sensor(self._uri, self._calibration, raw=True)
            frames = self._recorded() if sensor is None else self._taken(sensor)
            for frame in frames:
                if not self._put(frame):
                    return
        except CaptureError as error:
            end = error
        self._put(end, always=True)

    def _recorded(self) -> Iterator[RgbdFrame]:
        with open_source(self._uri, self._calibration, raw=True) as source:
            yield from source

    def _taken(self, sensor: LiveSensor) -> Iterator[RgbdFrame]:
        """Give every pair of a live sensor."""
        self.live = True
        try:
            self._wait_for(sensor)
            number, after_s, why = 0, -math.inf, ""
            while not self._stop.is_set():
                if sensor.wait(number, _SLICE_S) and (shot := sensor.first_after(after_s)):
                    self.lost += max(shot.number - number - 1, 0) if number else 0
                    number, after_s = shot.number, math.nextafter(shot.earliest_s, math.inf)
                    yield shot.frame
                elif (state := sensor.state) is LiveState.STALLED:
                    why = sensor.reason  # it is closed next, and opened again
                elif state is not LiveState.STREAMING:
                    raise SensorError(why or sensor.reason)
        finally:
            sensor.close(_CLOSING_S)

    def _wait_for(self, sensor: LiveSensor) -> None:
        begun_s = time.monotonic()
        while sensor.state is not LiveState.STREAMING and not self._stop.is_set():
            self.waits_for = sensor.reason or sensor.state.value
            gone = sensor.state in (LiveState.ABSENT, LiveState.BLOCKED)
            if time.monotonic() - begun_s > (_ABSENT_S if gone else _OPENING_S):
                raise SensorError(sensor.reason)
            self._stop.wait(_SLICE_S)

    def _put(self, frame: RgbdFrame | CaptureError | None, *, always: bool = False) -> bool:
        """Queue a frame; False where nobody wants one any more."""
        while not self._stop.is_set():
            with suppress(queue.Full):
                self._frames.put(frame, timeout=0 if self.live and not always else _SLICE_S)
                return True
            if self.live and not always:
                self.lost += 1
                return True
        return False
