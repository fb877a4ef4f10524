"""Recording frames into an `.oni` file that OpenNI2 and its tools play.

OpenNI2's own recorder is not used: what it writes is playable only after its `stop` and `close`
came through, it drops what it has not written when it is stopped, lets the stamps of both streams
start at 0, says nothing where the disk is full, and knows no time, sensor or calibration. Here each
frame is in the file when `add` returns, and the file can be played from its first frame on.
"""

import math
import os
import struct
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import cv2

from denseface.capture.errors import FrameError
from denseface.capture.frame import RgbdFrame
from denseface.capture.oni import records
from denseface.capture.oni.depth_codec import compress_depth
from denseface.capture.oni.description import Description

__all__ = ["OniWriter"]

_DEPTH_FORMATS = {1000: 100, 100: 101}
"""OpenNI2's number of the pixel format for depth of a unit, um."""
_RGB888 = 200
"""Its number for colour."""
_GRAY16, _RGB24 = 4, 1
"""OpenNI 1's numbers for both."""
_FPS = 30
"""Written where a mode has to be said; the stamps tell what it was."""
_ZPD_MM, _COLUMNS = 120, 1280
"""Distance of the zero plane, and columns of the image in whose pixels its pixel size is."""
_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 95,
         cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]


@dataclass
class _Node:
    """A stream, and where its frames are."""

    number: int
    kind: int
    name: str
    codec: bytes
    pixel_format: tuple[int, int]
    """OpenNI2's number, and OpenNI 1's."""
    size: tuple[int, int]
    """Width and height, pixels."""
    pixel_bytes: int
    added_at: int = 0
    ends: bool = False
    """Whether the file ends: the number of frames is known."""
    seek_table_at: int = 0
    entries: list[tuple[int, int, int]] = field(default_factory=list)
    """Of the table of frames: stamp, configuration, position."""

    def added(self) -> bytes:
        """Give the record that adds it; before the end, the number of frames is not known."""
        frames, last = records.UNKNOWN_FRAMES, records.UNKNOWN_STAMP
        if self.ends:
            frames, last = len(self.entries), max(stamp for stamp, _, _ in self.entries)
        tail = records.NODE_TAIL.pack(self.codec, frames, 0, last, self.seek_table_at)
        return records.record(records.Kind.NODE_ADDED, self.number, records.counted(self.name)
                              + records.U32.pack(self.kind) + tail)

    def begun(self, further: bytes) -> bytes:
        """Give the records that stand before the first frame, with further properties."""
        mode = records.MODE.pack(*self.size, _FPS)
        number, (modern, old) = self.number, self.pixel_format
        return b"".join([
            self.added(),
            records.int_property(number, "oniRequiredFrameSize", self.image_bytes),
            records.int_property(number, "xnIsGenerating", 1),
            records.int_property(number, "xnSupportedMapOutputModesCount", 1),
            records.general_property(number, "xnSupportedMapOutputModes", mode),
            records.general_property(number, "xnMapOutputMode", mode),
            records.int_property(number, "xnPixelFormat", old),
            records.int_property(number, "oniPixelFormat", modern),
            records.cropping_properties(number),
            records.int_property(number, "Mirror", 1),
            records.int_property(number, "xnMirror", 0),
            further,
            records.record(records.Kind.STATE_READY, number),
        ])

    def frame(self, stamp_us: int, payload: bytes) -> bytes:
        """Give the record of the next frame."""
        replaces = self.entries[-1][-1] if self.entries else 0
        return records.record(records.Kind.NEW_DATA, self.number,
                              records.FRAME.pack(stamp_us, len(self.entries) + 1), payload,
                              replaces)

    def ended(self, at: int) -> bytes:
        """Give the records that end it, to stand at that position."""
        self.ends = True
        removed = records.record(records.Kind.NODE_REMOVED, self.number, replaces=self.added_at)
        table = b"".join(records.SEEK_ENTRY.pack(*entry) for entry in [(0, 0, 0), *self.entries])
        if len(table) > records.MAX_IMAGE_BYTES:  # the player reads it into the same buffer
            return removed
        self.seek_table_at = at + len(removed)
        return removed + records.record(records.Kind.SEEK_TABLE, self.number, payload=table)

    @property
    def image_bytes(self) -> int:
        """Size of an image in memory."""
        return self.size[0] * self.size[1] * self.pixel_bytes


class OniWriter:
    """A new `.oni` file.

    Depth is stored without loss, in the codec of OpenNI's recorder; colour as JPEG. Stamps are the
    frames' own. What `RgbdFrame` has besides is in a property that other programs ignore.

    Parameters
    ----------
    mode : of the file, whatever the umask

    Raises
    ------
    OSError
        As from the system; also where there is a file of that name.
    """

    def __init__(self, path: Path, mode: int = 0o600) -> None:
        self.path = path
        self.frames = 0
        """How many are in the file."""
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with suppress(PermissionError):  # a file system without modes
            os.fchmod(self._file, mode)
        self._end = 0
        self._nodes: list[_Node] = []
        self._kind: tuple[object, ...] = ()
        """What all frames have in common."""

    def add(self, frame: RgbdFrame) -> None:
        """Append a frame; where that fails, the file holds what it held before.

        Raises
        ------
        FrameError
            It is not like the first one, or an `.oni` cannot hold it.
        OSError
            As from the system.
        """
        nodes, start = self._nodes, b""
        if not nodes:
            nodes = _nodes(self.path, frame)
            start = _beginning(nodes, frame)
            self._kind = _kind(frame)
        elif _kind(frame) != self._kind:
            raise FrameError(f"{self.path}: a frame differs from the first in size, unit, "
                             "calibration or registration; an .oni has one of each")
        try:
            images = [(frame.depth_timestamp_us, compress_depth(frame.depth))]
        except ValueError as error:
            raise FrameError(f"{self.path}: {error} in an .oni; record into a folder") from error
        if frame.color is not None:
            jpeg = cv2.imencode(".jpg", cv2.cvtColor(frame.color, cv2.COLOR_RGB2BGR), _JPEG)[1]
            images.append((frame.color_timestamp_us, jpeg.tobytes()))
        written, entries = [start], []
        at = self._end + len(start)
        for node, (stamp_us, payload) in zip(nodes, images, strict=True):
            if not 0 <= stamp_us < records.MAX_STAMP_US:
                raise FrameError(f"{self.path}: a time stamp of {stamp_us} us; an .oni has 0 to "
                                 f"{records.MAX_STAMP_US}")
            written.append(node.frame(stamp_us, payload))
            entries.append((stamp_us, 0, at))
            at += len(written[-1])
        self._append(b"".join(written))
        self._nodes = nodes
        for node, entry in zip(nodes, entries, strict=True):
            node.entries.append(entry)
        self.frames += 1

    def close(self) -> None:
        """Complete the file, or remove it where it holds no frame; harmless when repeated.

        Raises
        ------
        OSError
            As from the system, and it names the file. On a full disk this stays without its table
            of frames, and can be played all the same.
        """
        if self._file < 0:
            return
        errors = []
        for step in (self._complete, self._sync) if self.frames else (self._remove,):
            try:
                step()
            except OSError as error:
                errors.append(error)
        file, self._file = self._file, -1
        try:
            os.close(file)
        except OSError as error:
            errors.append(error)
        if errors:
            raise OSError(errors[0].errno, errors[0].strerror, str(self.path)) from errors[0]

    def _sync(self) -> None:
        os.fsync(self._file)

    def _remove(self) -> None:
        self.path.unlink(missing_ok=True)

    def _complete(self) -> None:
        ends, at = b"", self._end
        for node in self._nodes:
            ends += node.ended(at + len(ends))
        self._append(ends + records.record(records.Kind.END, 0))
        last = max(stamp for node in self._nodes for stamp, _, _ in node.entries)
        os.pwrite(self._file, _header(self._nodes, last), 0)
        for node in self._nodes:
            os.pwrite(self._file, node.added(), node.added_at)

    def _append(self, data: bytes) -> None:
        """Write all of it, or nothing."""
        rest, at = memoryview(data), self._end
        try:
            while rest:
                written = os.pwrite(self._file, rest, at)
                rest, at = rest[written:], at + written
        except BaseException:
            with suppress(OSError):
                os.ftruncate(self._file, self._end)
            raise
        self._end = at


def _kind(frame: RgbdFrame) -> tuple[object, ...]:
    return (frame.depth.shape, frame.color is not None and frame.color.shape, frame.registered,
            frame.calibration, frame.depth_meaning.unit_um)


def _nodes(path: Path, frame: RgbdFrame) -> list[_Node]:
    """Give the streams of a recording of such frames."""
    unit_um = frame.depth_meaning.unit_um
    if unit_um not in _DEPTH_FORMATS:
        raise FrameError(f"{path}: depth in {unit_um} um; an .oni has "
                         f"{' or '.join(map(str, _DEPTH_FORMATS))} um; record into a folder")
    height, width = frame.depth.shape
    nodes = [_Node(1, records.DEPTH_NODE, "Depth", b"16zT", (_DEPTH_FORMATS[unit_um], _GRAY16),
                   (width, height), 2)]
    if frame.color is not None:
        height, width, _ = frame.color.shape
        nodes.append(_Node(2, records.IMAGE_NODE, "Image", b"JPEG", (_RGB888, _RGB24),
                           (width, height), 3))
    for node in nodes:
        if node.image_bytes > records.MAX_IMAGE_BYTES:
            raise FrameError(
                f"{path}: {node.name.lower()} of {node.size[0]}x{node.size[1]}; OpenNI2 plays "
                f"images of up to {records.MAX_IMAGE_BYTES} bytes; record into a folder")
    return nodes


def _header(nodes: list[_Node], last_us: int) -> bytes:
    return records.HEADER.pack(b"NI10", 1, 0, 1, 0, last_us, max(node.number for node in nodes))


def _beginning(nodes: list[_Node], frame: RgbdFrame) -> bytes:
    """Give the file's content before its first frame."""
    start = _header(nodes, records.UNKNOWN_STAMP)
    cameras = frame.depth_camera, frame.calibration.color
    for node, camera in zip(nodes, cameras, strict=False):
        fov = [2 * math.atan(side / 2 / focal) for side, focal in
               ((camera.width, camera.fx), (camera.height, camera.fy))]
        node.added_at = len(start)
        start += node.begun(
            records.general_property(node.number, "xnFOV", struct.pack("<dd", *fov))
            + (_depth_properties(node, frame) if node is nodes[0] else b""))
    return start + b"".join(
        records.record(records.Kind.DATA_BEGIN, node.number, records.DATA_BEGIN.pack(
            records.UNKNOWN_FRAMES, records.UNKNOWN_STAMP)) for node in nodes)


def _depth_properties(node: _Node, frame: RgbdFrame) -> bytes:
    """Give what only the depth stream says, for other programs as OpenNI's drivers would."""
    calibration = frame.calibration
    zpps_mm = _ZPD_MM / (calibration.depth.fx * _COLUMNS / calibration.depth.width)
    shift_mm = calibration.depth_to_color.translation_mm[0]
    description = Description.of(frame).model_dump_json().encode() + b"\0"
    return b"".join([
        records.int_property(node.number, "xnDeviceMaxDepth", frame.depth_meaning.max_count),
        records.int_property(node.number, "ZPD", _ZPD_MM),
        records.real_property(node.number, "ZPPS", zpps_mm),
        records.real_property(node.number, "DCRCDIS", -shift_mm / 10),
        records.int_property(node.number, "AlternativeViewPoint", int(frame.registered)),
        records.general_property(node.number, records.DESCRIPTION, description,
                                 records.Kind.STRING),
    ])
