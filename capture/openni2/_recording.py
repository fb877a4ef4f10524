"""Recordings: read forward only, one frame for each read, and never past the last."""

import time
from collections.abc import Iterator
from pathlib import Path

from primesense import openni2

from denseface.capture.calibration import MAX_SIDE, ChosenCalibration
from denseface.capture.errors import SensorError, UnreadableSourceError
from denseface.capture.frame import RgbdFrame
from denseface.capture.openni2._base import OpenNI2Source
from denseface.capture.openni2._library import binding_errors, load, open_sources
from denseface.capture.openni2._oni_file import DEPTH_NODE, IMAGE_NODE, OniNode, check_oni
from denseface.capture.openni2._path import ascii_name
from denseface.capture.openni2._streams import COLOR, DEPTH, Streams

_FILE_WAIT_S = 2.0
"""Longest wait for a frame of a file, seconds: longer, and the file is damaged."""
_SETTLE_S = 0.1
"""Wait between stopping and destroying streams, seconds."""


class RecordingSource(OpenNI2Source):
    """An `.oni` recording; each pass over it starts at the first frame.

    Raises
    ------
    UnreadableSourceError
        The file is missing, damaged, has no depth or no colour stream, or OpenNI2 refuses it.
    SensorError
        The OpenNI2 library is missing.
    """

    _live = False

    def __init__(self, path: Path, chosen: ChosenCalibration | None = None) -> None:
        super().__init__(str(path), chosen)
        self._unread = True
        nodes, _ = check_oni(path)
        depth, color = (self._find_node(nodes, kind, what)
                        for kind, what in ((DEPTH_NODE, DEPTH), (IMAGE_NODE, COLOR)))
        self._open()
        self._registered = depth.registered
        self._expected = {DEPTH: depth.frames, COLOR: color.frames}
        self.frame_count = min(self._expected.values())

    def _find_node(self, nodes: list[OniNode], kind: int, what: str) -> OniNode:
        """Find a stream that has a size: without one, OpenNI2 invents it and crashes."""
        node = next((node for node in nodes if node.kind == kind), None)
        if node is None:
            raise UnreadableSourceError(
                f"{self.uri}: has no {what} stream; depth and color are needed")
        if node.sides is None or not all(1 <= side <= MAX_SIDE for side in node.sides):
            found = "no size" if node.sides is None else "{}x{}".format(*node.sides)
            raise UnreadableSourceError(
                f"{self.uri}: the {what} stream has {found}, expected sides of 1 to {MAX_SIDE}")
        return node

    def __iter__(self) -> Iterator[RgbdFrame]:
        streams = self._streams
        if not self._unread or streams is None:
            # Seeking hangs, so each new pass opens the file again.
            self.close()
            streams = self._open()
        self._unread = False
        self.pairer.clear()
        streams.start()
        left = dict(self._expected)
        while max(left.values()) > 0 and self._streams is streams:
            try:
                kind = streams.wait(_FILE_WAIT_S)
                image = streams.read(kind) if kind is not None else None
            except SensorError as error:
                raise UnreadableSourceError(str(error)) from error
            if kind is None or image is None:
                read = {k: self._expected[k] - n for k, n in left.items()}
                raise UnreadableSourceError(
                    f"{self.uri}: ends after {read[DEPTH]} of {self._expected[DEPTH]} depth and "
                    f"{read[COLOR]} of {self._expected[COLOR]} color frames: damaged")
            left[kind] -= 1
            if max(left.values()) <= 0:
                # At the end the player's thread would busy-wait.
                streams.stop()
            if pair := self._add(kind, image):
                yield self._frame(pair)

    def close(self) -> None:
        """Stop the streams and close the file; harmless when repeated."""
        if self._streams is not None and not self._unread:
            # The player's thread reads the list of streams without a lock, and crashes when one
            # is destroyed meanwhile. While all are stopped, it sleeps 10 ms a round.
            self._streams.stop()
            time.sleep(_SETTLE_S)
        super().close()

    def _open(self) -> Streams:
        load()
        path = Path(self.uri).absolute()
        # Devices that were opened by the same name share their position in the file.
        again = any(other is not self and other._streams is not None
                    and Path(other.uri).absolute() == path for other in list(open_sources))
        try:
            with binding_errors(f"{self.uri}: OpenNI2 cannot open it", UnreadableSourceError):
                with ascii_name(path, unique=again) as name:
                    device = openni2.Device.open_file(name)
                if not device.is_file():
                    device.close()
                    raise UnreadableSourceError(
                        f"{self.uri}: OpenNI2 does not take it as a recording")
                # A float: the binding would reinterpret an int's bits as one.
                device.playback.set_speed(-1.0)
                device.playback.set_repeat_enabled(False)
                return self._open_streams(device)
        except SensorError as error:
            raise UnreadableSourceError(str(error)) from error
