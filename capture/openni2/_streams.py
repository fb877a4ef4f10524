"""A device's depth and colour streams: opened, started, and read by copy.

A driver is asked for the best pair of modes that it offers and for images as the cameras see them:
not cropped, not mirrored, not registered. That it agrees proves nothing. Each frame is read by its
own word on its size and format, and what was not done is undone or said.
"""

import ctypes
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import MAX_SIDE
from denseface.capture.errors import SensorError, WrongSizeError
from denseface.capture.modes import COLOR_FORMATS, DEPTH_FORMATS, Mode, listed, rank
from denseface.capture.openni2 import _orbbec
from denseface.capture.openni2._binding import OpenNIError, openni2
from denseface.capture.openni2._calibration import SensorProperties
from denseface.capture.openni2._exposure import Exposure
from denseface.capture.openni2._library import binding_errors, close_handle
from denseface.capture.openni2._pixels import (
    Layout,
    copy_raw,
    format_name,
    format_number,
    image_of,
    layout_of,
    raw_bytes,
)

DEPTH, COLOR = "depth", "color"
"""Kinds of stream."""
Image = tuple[int, NDArray[Any]]
"""Stamp (sensor clock, microseconds) and pixels: (H, W) uint16 counts or (H, W, 3) uint8 RGB."""

_CROPPING, _FOV, _MAX_VALUE, _MIRRORING = 0, 1, 4, 7
"""OpenNI2's numbers of stream properties."""
_ANY = 65535
"""The farthest reading of a stream where each number may be one."""
_LEAST_MAX_MM = 3000
"""No sensor's farthest reading is nearer, mm; a driver that says less may mean another unit."""
_REGISTRATION = 5
"""OpenNI2's number of a device's property: 1 where depth comes in the colour camera's pixels."""
_ZPD, _ZPPS, _DCRCDIS = 0x1080100C, 0x1080100D, 0x1080100F
"""PrimeSense's numbers of stream properties (PS1080.h); see `_calibration`."""
_FORMATS = {DEPTH: DEPTH_FORMATS, COLOR: COLOR_FORMATS}
_MAX_TRIES = 16
"""Pairs of modes that a driver is asked for, at most."""
_ADOPTED = 3
"""Frames in a row of one other size after which that is the stream's, whatever its mode says."""
_C = TypeVar("_C", bound="ctypes._SimpleCData[Any]")


@dataclass
class _Stream:
    kind: str
    handle: Any
    mode: Mode
    mirrored: bool = False
    other: Layout | None = None
    """The last frame's, where it was not of the mode's size."""
    others: int = 0
    """How many of the last frames were like that one."""
    note: str = ""


class Streams:
    """The streams of an open device, started by `start`; a sensor may have no colour camera.

    Parameters
    ----------
    device : an open `openni2.Device`; it stays the caller's
    name : of the source, for messages
    live : choose modes and switch off what changes the images; a recording is as it is

    Attributes
    ----------
    kinds : DEPTH, and COLOR where there is a colour camera
    offered : the modes that each of a live sensor offers
    registered : the driver says that depth comes in the colour camera's pixels, also after it was
        told not to
    exposure : of the colour camera

    Raises
    ------
    SensorError
        There is no depth stream, or no mode that can be read.
    """

    def __init__(self, device: Any, name: str, *, live: bool) -> None:
        self._name = name
        self._streams: dict[str, _Stream] = {}
        self._notes: list[str] = []
        self.offered: dict[str, list[Mode]] = {}
        self._pairs: Iterator[dict[str, Mode]] = iter(())
        self.registered = False
        try:
            # All are created before one starts: a sensor may send from the first start on.
            for kind in (DEPTH, COLOR):
                self._create(device, kind)
            if live:
                self._pairs = self._ranked(device)
                self._choose_modes()
                self._switch_off(device)
            self._check_modes()
            self.properties = self._read_properties(device, live=live)
            self.max_mm = self._read_max_mm()
            """The farthest reading, mm, as the driver says; None where it says nothing possible."""
        except BaseException:
            self.close()
            raise
        self.kinds = tuple(self._streams)
        color = self._streams.get(COLOR)
        self.exposure = Exposure(None if color is None else color.handle,
                                 by_freenect=self.properties.by_freenect)

    def start(self) -> None:
        """Start all, before any `wait` or `read`; in the next best modes where they do not."""
        while True:
            try:
                for kind, stream in self._streams.items():
                    with binding_errors(f"{self._name}: the {kind} stream does not start"):
                        stream.handle.start()
            except SensorError:
                self.stop()
                if not self._choose_modes():
                    raise
                self._check_modes()
            else:
                return

    def stop(self) -> None:
        """Stop all; a device that is gone may refuse."""
        for stream in self._streams.values():
            with suppress(OpenNIError):
                stream.handle.stop()

    def handle(self, kind: str) -> Any:
        """Give the binding's own stream, for its recorder."""
        return self._streams[kind].handle

    def mode(self, kind: str) -> Mode:
        """Give the mode that the frames have."""
        return self._streams[kind].mode

    def size(self, kind: str) -> tuple[int, int]:
        """Give (width, height), pixels."""
        return self._streams[kind].mode.size

    @property
    def depth_unit_um(self) -> int:
        """Micrometres of one count of a depth."""
        return 100 if self._streams[DEPTH].mode.pixel_format == "DEPTH_100_UM" else 1000

    def _read_max_mm(self) -> int | None:
        count = _property(self._streams[DEPTH].handle, _MAX_VALUE, ctypes.c_int)
        if count is None or count >= _ANY:
            return None
        most = count * self.depth_unit_um // 1000
        return most if most >= _LEAST_MAX_MM else None

    @property
    def notes(self) -> tuple[str, ...]:
        """What the frames are not as they should be, for `FrameOrigin.notes`."""
        return *self._notes, *(s.note for s in self._streams.values() if s.note)

    def wait(self, timeout_s: float, kinds: tuple[str, ...] | None = None) -> str | None:
        """Wait until a stream has a frame; None where none came in time, or the file is at its end.

        A `read` of what was not announced here may block for ever.
        """
        kinds = self.kinds if kinds is None else kinds
        handles = [self.handle(kind) for kind in kinds]
        with binding_errors(f"{self._name}: waiting for a frame failed"):
            ready = openni2.wait_for_any_stream(handles, timeout_s)
        return next((k for k, h in zip(kinds, handles, strict=True) if h is ready), None)

    def read(self, kind: str) -> Image:
        """Copy the frame that `wait` announced out of the driver's memory.

        Raises
        ------
        WrongSizeError
            It is garbled or of another size than the stream's: the next may be right.
        """
        memory = np.empty(self.frame_bytes(kind), np.uint8)
        stamp_us = self.copy_frame(kind, memory)
        return stamp_us, self.image(kind, memory)

    def frame_bytes(self, kind: str) -> int:
        """Give the size of a whole frame as the driver sends it, bytes; see `copy_frame`."""
        mode = self._streams[kind].mode
        return raw_bytes(mode.size, mode.pixel_format)

    def copy_frame(self, kind: str, memory: NDArray[np.uint8]) -> int:
        """Copy the frame that `wait` announced, as it is, and give its stamp, microseconds.

        A driver that keeps to another size or format than its mode's is believed after some frames:
        then `mode` and `frame_bytes` change.

        Parameters
        ----------
        memory : (`frame_bytes`,) uint8, contiguous

        Raises
        ------
        WrongSizeError
            It is garbled or of another size than the stream's; it is read all the same.
        """
        stream = self._streams[kind]
        with binding_errors(f"{self._name}: reading a {kind} frame failed"):
            frame = stream.handle.read_frame()
        try:
            self._copy(stream, frame, memory)
            # A driver may mean a time below zero, as of a clock that was set back.
            return ctypes.c_int64(frame.timestamp).value
        finally:
            frame.close()

    def image(self, kind: str, memory: NDArray[np.uint8]) -> NDArray[Any]:
        """Make an image of what `copy_frame` copied: an array of its own, RGB, not mirrored.

        Raises
        ------
        WrongSizeError
            It was copied before the mode changed.
        """
        stream = self._streams[kind]
        if memory.nbytes != self.frame_bytes(kind):
            raise WrongSizeError(f"{self._name}: a {kind} frame from before its mode changed")
        return image_of(memory, stream.mode.pixel_format, stream.mode.size,
                        mirrored=stream.mirrored)

    def close(self) -> None:
        """Stop and destroy all, also of a device that is gone; `image` still works."""
        for stream in self._streams.values():
            close_handle(stream.handle)

    def _create(self, device: Any, kind: str) -> None:
        make = device.create_depth_stream if kind == DEPTH else device.create_color_stream
        with binding_errors(f"{self._name}: the {kind} stream cannot be opened"):
            handle = make()
        if handle is not None:
            self._streams[kind] = _Stream(kind, handle, Mode(0, 0, 0, ""))
        elif kind == DEPTH:
            raise SensorError(f"{self._name}: has no depth stream; depth is needed")

    def _ranked(self, device: Any) -> Iterator[dict[str, Mode]]:
        """Give the pairs of modes to be tried, the best first.

        Raises SensorError where there is none.
        """
        offered = self.offered = {kind: [_mode(m) for m in device.get_sensor_info(
            stream.handle.sensor_type).videoModes] for kind, stream in self._streams.items()}
        pairs = rank(offered[DEPTH], offered.get(COLOR))
        if not pairs and all(offered.values()):
            raise SensorError(f"{self._name}: offers no modes that can be read: " + ", ".join(
                f"{kind} {listed(modes)} (expected {' or '.join(_FORMATS[kind])})"
                for kind, modes in offered.items()))
        return iter([{DEPTH: depth} | ({} if color is None else {COLOR: color})
                     for depth, color in pairs[:_MAX_TRIES]])

    def _choose_modes(self) -> bool:
        """Set the best pair of modes that the driver takes; False where it takes no more."""
        for pair in self._pairs:
            with suppress(OpenNIError):
                for kind, mode in pair.items():
                    self._streams[kind].handle.configure_mode(
                        *mode.size, mode.fps, format_number(mode.pixel_format))
                return True
        return False

    def _check_modes(self) -> None:
        """Read the modes back; raises SensorError where one cannot be read."""
        for kind, stream in self._streams.items():
            with binding_errors(f"{self._name}: the {kind} stream has no video mode"):
                stream.mode = _mode(stream.handle.video_mode)
            if stream.mode.pixel_format not in _FORMATS[kind]:
                raise SensorError(f"{self._name}: the {kind} stream is {stream.mode.pixel_format}, "
                                  f"expected {' or '.join(_FORMATS[kind])}")
            if not all(0 < side <= MAX_SIDE for side in stream.mode.size):
                raise SensorError(
                    f"{self._name}: the {kind} stream is {stream.mode.width}x"
                    f"{stream.mode.height}, expected sides of 1 to {MAX_SIDE}")
            stream.mirrored = bool(_property(stream.handle, _MIRRORING, ctypes.c_int))

    def _switch_off(self, device: Any) -> None:
        """Ask for images as the cameras see them."""
        for kind, stream in self._streams.items():
            with suppress(OpenNIError):
                stream.handle.reset_cropping()
            with suppress(OpenNIError):
                stream.handle.set_mirroring_enabled(False)
            if _property(stream.handle, _MIRRORING, ctypes.c_int) is None:
                self._notes.append(f"the driver does not say whether its {kind} is mirrored")
        # After the depth stream exists: Freenect's driver crashes otherwise.
        with suppress(OpenNIError):
            device.set_property(_REGISTRATION, ctypes.c_int(0))
        self.registered = bool(_property(device, _REGISTRATION, ctypes.c_int))
        if self.registered:
            self._notes.append("the driver keeps registering depth to the color camera")

    def _read_properties(self, device: Any, *, live: bool) -> SensorProperties:
        depth = self.handle(DEPTH)
        info = device.device_info
        color = self._streams.get(COLOR)
        orbbec = info.usbVendorId == _orbbec.VENDOR or b"orbbec" in bytes(info.vendor).lower()
        return SensorProperties(
            zpd_mm=_property(depth, _ZPD, ctypes.c_uint64),
            zpps_mm=_property(depth, _ZPPS, ctypes.c_double),
            dcrcdis_cm=_property(depth, _DCRCDIS, ctypes.c_double),
            depth_fov=_property(depth, _FOV, ctypes.c_float),
            color_fov=None if color is None else _property(color.handle, _FOV, ctypes.c_float),
            usb_vendor=int(info.usbVendorId),
            uri=bytes(info.uri).decode("utf-8", "replace") if live else "",
            orbbec=_factory_calibration(device) if live and orbbec else None,
        )

    def _copy(self, stream: _Stream, frame: Any, memory: NDArray[np.uint8]) -> None:
        mode = stream.mode
        layout = layout_of(frame, mode.pixel_format)
        try:
            copy_raw(int(frame.data or 0), layout, mode.size, mode.pixel_format, memory)
        except WrongSizeError as error:
            self._adopt(stream, layout)
            raise WrongSizeError(f"{self._name}: {stream.kind}: {error}") from error
        stream.other = None
        stream.note = "" if layout.crop is None else (
            f"the driver sends {layout.width}x{layout.height} pixels of {stream.kind} from "
            f"{layout.crop[0]}, {layout.crop[1]}, cropped")

    def _adopt(self, stream: _Stream, layout: Layout) -> None:
        """Take a size and format that the frames keep to for the stream's."""
        stream.others = stream.others + 1 if layout == stream.other else 1
        stream.other = layout
        mode = Mode(layout.width, layout.height, stream.mode.fps, layout.pixel_format)
        if (stream.others >= _ADOPTED and layout.crop is None and mode != stream.mode
                and mode.pixel_format in _FORMATS[stream.kind]
                and all(0 < side <= MAX_SIDE for side in mode.size)):
            self._notes.append(f"the driver says that {stream.kind} is {stream.mode}, and sends "
                               f"{mode.width}x{mode.height} as {mode.pixel_format}")
            stream.mode = mode


def _mode(mode: Any) -> Mode:
    return Mode(int(mode.resolutionX), int(mode.resolutionY), int(mode.fps),
                format_name(int(mode.pixelFormat)))


def _property(handle: Any, number: int, kind: type[_C]) -> Any:
    """Give a property of a stream or device, None where it has none."""
    with suppress(OpenNIError):
        return handle.get_property(number, kind).value
    return None


def _factory_calibration(device: Any) -> tuple[float, ...] | None:
    for size in _orbbec.PROPERTY_BYTES:
        with suppress(OpenNIError):
            return _orbbec.unpack(bytes(device.get_property(_orbbec.PROPERTY,
                                                            ctypes.c_char * size)))
    return None
