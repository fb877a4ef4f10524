"""Recording a live sensor to an `.oni` file with OpenNI2's own recorder."""

import os
import time
from contextlib import closing
from pathlib import Path

from primesense import openni2

from denseface.capture.errors import SensorTimeoutError
from denseface.capture.openni2 import LiveSource
from denseface.capture.openni2._library import binding_errors
from denseface.capture.openni2._oni_file import check_oni, written_frames
from denseface.capture.openni2._path import ascii_name
from denseface.capture.openni2._streams import COLOR, DEPTH
from denseface.files import replacing_by_name

__all__ = ["record"]

_SILENCE_S = 3.0
"""Seconds without a frame after which the sensor has fallen silent."""
_POLL_S = 0.01
"""Seconds between looks at what was written."""


def record(device_uri: str | None, path: str | Path, frames: int) -> int:
    """Record a live sensor.

    Depth is stored without loss (but the codec can get some of the last 32 pixels of the last row
    wrong), colour as JPEG. OpenNI2's recorder starts the stamps of each stream at 0, so the skew
    between the two is not in the file.

    Parameters
    ----------
    device_uri : OpenNI2's URI of the device; None for the first one
    path : of the `.oni`; it appears only when it is whole
    frames : how many pairs to wait for; a sensor that goes on may add one or two to the file

    Returns
    -------
    how many frames of each stream the file holds at least

    Raises
    ------
    SensorError
        No sensor, or the recorder refuses.
    SensorTimeoutError
        Too few frames came.
    """
    if frames < 1:
        raise ValueError(f"frames must be at least 1, got {frames}")
    path = Path(path)
    with replacing_by_name(path) as part:
        _record(device_uri, part, frames)
        _, end = check_oni(part)
        found = written_frames(part)
        if found < frames:
            raise SensorTimeoutError(
                f"{path}: the sensor fell silent after {found} of {frames} frames")
        # The recorder reserves space in steps and leaves the rest behind.
        os.truncate(part, end)
    return found


def _record(device_uri: str | None, part: Path, frames: int) -> None:
    with (LiveSource(device_uri, start=False) as source,
          binding_errors(f"{part}: recording failed")):
        with ascii_name(part) as name:
            recorder = openni2.Recorder(name)
        with closing(recorder):
            # Both before the start: a stream that is attached later is not recorded.
            for each in (DEPTH, COLOR):
                recorder.attach(source.streams.handle(each), each == COLOR)
            recorder.start()
            source.start()
            left = {DEPTH: frames, COLOR: frames}
            while max(left.values()) > 0:
                kind = source.streams.wait(_SILENCE_S)
                if kind is None:
                    break
                source.streams.read(kind)
                left[kind] -= 1
            _wait_until_written(part, frames)
            recorder.stop()


def _wait_until_written(part: Path, frames: int) -> None:
    """Wait for the recorder's own thread: when stopped, it drops what it has not yet written."""
    deadline = time.monotonic() + _SILENCE_S
    while written_frames(part) < frames and time.monotonic() < deadline:
        time.sleep(_POLL_S)
