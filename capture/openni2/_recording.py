"""Recordings: read forward only, one frame for each read, and never past the last."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO

from numpy.typing import NDArray

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.errors import SensorError, UnreadableSourceError
from denseface.capture.frame import DepthMeaning, RgbdFrame
from denseface.capture.oni.mend import mended, what_is_missing
from denseface.capture.oni.recorded import Recorded
from denseface.capture.oni.records import DEPTH_NODE, IMAGE_NODE
from denseface.capture.openni2._base import OpenNI2Source
from denseface.capture.openni2._binding import openni2
from denseface.capture.openni2._library import binding_errors, load, open_sources
from denseface.capture.openni2._path import ascii_name
from denseface.capture.openni2._streams import COLOR, DEPTH, Streams
from denseface.capture.pairing import Pair, Pairer

_FILE_WAIT_S = 2.0
"""Longest wait for a frame of a file, seconds: longer, and the file is damaged."""
_SETTLE_S = 0.1
"""Wait between stopping and destroying streams, seconds."""
_NODES = {DEPTH: DEPTH_NODE, COLOR: IMAGE_NODE}


class RecordingSource(OpenNI2Source):
    """An `.oni` recording; each pass over it starts at the first frame.

    One that was cut gives the frames before. What OpenNI2 cannot play for want of something that
    can be supplied is played from a temporary copy. Either is said in each frame's `origin.notes`.

    Raises
    ------
    UnreadableSourceError
        The file is missing, damaged, has no depth stream or no pair, or OpenNI2 refuses it.
    SensorError
        The OpenNI2 library is missing.
    """

    _live = False
    _copy: BinaryIO | None = None

    def __init__(self, path: Path, chosen: ChosenCalibration | None = None) -> None:
        self._recorded = Recorded(path)
        super().__init__(str(path), chosen or self._recorded.calibration)
        self._unread = True
        self._stopped_s = math.inf
        """When the streams were stopped; infinite while they are not."""
        self._registered = self._recorded.depth.registered
        self._expected = {
            kind: node.frames for kind, node in
            ((DEPTH, self._recorded.depth), (COLOR, self._recorded.color)) if node is not None}
        self._pairer: Pairer[Any, Any] = Pairer(0) if self._recorded.in_pairs else Pairer()
        self.frame_count = self._recorded.pairs
        if not self.frame_count:
            raise UnreadableSourceError(f"{self.uri}: holds no pair of depth and color: "
                                        f"{_counted(self._expected)}")
        self._open()

    def __iter__(self) -> Iterator[RgbdFrame]:
        streams = self._streams
        if not self._unread or streams is None:
            # Seeking hangs, so each new pass opens the file again.
            self._close_device()
            streams = self._open()
        self._unread = False
        self._pairer.clear()
        given = 0
        self._stopped_s = math.inf
        streams.start()
        left = dict(self._expected)
        while max(left.values()) > 0 and self._streams is streams:
            try:
                kind = streams.wait(_FILE_WAIT_S)
                image = streams.read(kind) if kind is not None else None
            except SensorError as error:
                raise UnreadableSourceError(str(error)) from error
            if kind is None or image is None:
                raise UnreadableSourceError(
                    f"{self.uri}: holds {_counted(self._expected)}, of which {_counted(left)} "
                    "cannot be read: damaged")
            left[kind] -= 1
            if max(left.values()) <= 0:
                # At the end the player's thread would busy-wait.
                streams.stop()
                self._stopped_s = time.monotonic()
            if pair := self._paired(kind, self._expected[kind] - left[kind], *image):
                yield self._frame(pair, given)
                given += 1

    def _paired(
        self, kind: str, number: int, stamp_us: int, pixels: NDArray[Any]
    ) -> Pair[Any, Any] | None:
        """Pair an image by its stamp, or by its number in a file of pairs."""
        stamp_us += self._recorded.shift_us[_NODES[kind]]
        if not self._recorded.in_pairs or COLOR not in self._expected:
            return self._add(kind, (stamp_us, pixels))
        pair = self._add(kind, (number, (stamp_us, pixels)))
        if pair is None:
            return None
        return Pair(pair.depth[1], pair.color[1], pair.depth[0], pair.color[0])

    def _add(self, kind: str, image: tuple[int, Any]) -> Pair[Any, Any] | None:
        if COLOR not in self._expected:
            return Pair(image[1], None, image[0], image[0])
        return (self._pairer.add_depth if kind == DEPTH else self._pairer.add_color)(*image)

    def close(self) -> None:
        """Stop the streams and close the file; harmless when repeated."""
        self._close_device()
        if self._copy is not None:
            self._copy.close()
            self._copy = None

    def _close_device(self) -> None:
        if self._streams is not None and not self._unread:
            # The player's thread reads the list of streams without a lock, and crashes when one
            # is destroyed meanwhile. While all are stopped, it sleeps 10 ms a round.
            self._streams.stop()
            settled_s = min(self._stopped_s, time.monotonic()) + _SETTLE_S
            time.sleep(max(0.0, settled_s - time.monotonic()))
        super().close()

    def _frame(self, pair: Pair[Any, Any], number: int) -> RgbdFrame:
        if self._streams is None:
            raise SensorError(f"{self._name}: is closed")
        return self._make_frame(self._streams, pair.depth, pair.color,
                                (pair.depth_us, pair.color_us),
                                self._recorded.origin(pair.depth_us, number))

    def _meaning(self, streams: Streams) -> DepthMeaning:
        return self._recorded.meaning(super()._meaning(streams))

    def _open(self) -> Streams:
        load()
        path = Path(self.uri).absolute()
        try:
            with (binding_errors(f"{self.uri}: OpenNI2 cannot open it", UnreadableSourceError),
                  ExitStack() as stack):
                if what_is_missing(self._recorded.file):
                    self._copy = self._copy or mended(path, self._recorded.file)
                    name = b"/proc/self/fd/%d" % self._copy.fileno()
                else:
                    # Devices that were opened by the same name share their position in the file.
                    again = any(other is not self and other._streams is not None
                                and Path(other.uri).absolute() == path
                                for other in list(open_sources))
                    name = stack.enter_context(ascii_name(path, unique=again))
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


def _counted(frames: dict[str, int]) -> str:
    return " and ".join(f"{number} {kind}" for kind, number in frames.items()) + " frames"
