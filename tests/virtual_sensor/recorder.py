"""Recording with OpenNI2's own recorder, as other programs do."""

import os
import time
from contextlib import closing, suppress
from pathlib import Path

from denseface.capture.errors import CaptureError, SensorTimeoutError
from denseface.capture.oni.file import read_oni
from denseface.capture.openni2._binding import openni2
from denseface.capture.openni2._library import load

__all__ = ["record"]

_SILENCE_S = 3.0
"""Seconds without a frame after which the sensor has fallen silent."""
_POLL_S = 0.01
"""Seconds between looks at what was written."""


def record(path: Path, frames: int, *, mirrored: bool = False) -> None:
    """Record so many pairs of the first sensor.

    The recorder stores depth without loss (but the codec can get some of the last 32 pixels of the
    last row wrong), colour as JPEG, and lets the stamps of each stream start at 0.

    Raises
    ------
    SensorTimeoutError
        Too few frames came; the file is removed.
    """
    _record(path, frames, mirrored=mirrored)
    # The recorder reserves space in steps and leaves the rest behind.
    os.truncate(path, read_oni(path).end)
    if (found := _written(path)) < frames:
        path.unlink()
        raise SensorTimeoutError(
            f"{path}: the sensor fell silent after {found} of {frames} frames")


def _record(path: Path, frames: int, *, mirrored: bool) -> None:
    load()
    with closing(openni2.Device.open_any()) as device:
        streams = [device.create_depth_stream(), device.create_color_stream()]
        for stream in streams:
            stream.set_mirroring_enabled(mirrored)
        with closing(openni2.Recorder(os.fsencode(path))) as recorder:
            # Both before the start: a stream that is attached later is not recorded.
            for stream in streams:
                recorder.attach(stream, stream is streams[1])
            recorder.start()
            for stream in streams:
                stream.start()
            read = [0, 0]
            while min(read) < frames and (
                    ready := openni2.wait_for_any_stream(streams, _SILENCE_S)) is not None:
                ready.read_frame().close()
                read[streams.index(ready)] += 1
            _wait_until_written(path, frames)
            recorder.stop()
        for stream in streams:
            stream.close()


def _wait_until_written(path: Path, frames: int) -> None:
    """Wait for the recorder's own thread: when stopped, it drops what it has not yet written."""
    deadline = time.monotonic() + _SILENCE_S
    while _written(path) < frames and time.monotonic() < deadline:
        time.sleep(_POLL_S)


def _written(path: Path) -> int:
    """Count the pairs in a file that may still be recorded."""
    with suppress(CaptureError):
        nodes = read_oni(path).nodes.values()
        return min((node.frames for node in nodes), default=0)
    return 0
