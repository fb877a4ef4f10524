"""A device's depth and colour streams: opened, started, and read by copy."""

import ctypes
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from primesense import openni2
from primesense.utils import OpenNIError

from denseface.capture.calibration import MAX_SIDE
from denseface.capture.errors import SensorError, WrongSizeError
from denseface.capture.openni2._calibration import SensorProperties
from denseface.capture.openni2._library import binding_errors, close_handle

DEPTH, COLOR = "depth", "color"
"""Kinds of stream."""
Image = tuple[int, NDArray[Any]]
"""Stamp (sensor clock, microseconds) and pixels: (H, W) uint16 counts or (H, W, 3) uint8 RGB."""

_FOV, _MIRRORING = 1, 7
"""OpenNI2's numbers of stream properties."""
_ZPD, _ZPPS, _DCRCDIS = 0x1080100C, 0x1080100D, 0x1080100F
"""PrimeSense's numbers of stream properties (PS1080.h); see `_calibration`."""
_LIVE_SIZE, _LIVE_FPS = (640, 480), 30
"""Video mode of live sensors: pixels, frames a second."""
_PIXEL_BYTES = {DEPTH: 2, COLOR: 3}
"""Of a frame as it is read."""
_C = TypeVar("_C", bound="ctypes._SimpleCData[Any]")
_1_MM, _100_UM = int(openni2.PIXEL_FORMAT_DEPTH_1_MM), int(openni2.PIXEL_FORMAT_DEPTH_100_UM)
_PIXEL_FORMATS = {DEPTH: {_1_MM: "depth in 1 mm", _100_UM: "depth in 100 um"},
                  COLOR: {int(openni2.PIXEL_FORMAT_RGB888): "RGB888"}}
"""What can be read of each kind of stream, the best first, and how messages name it."""


@dataclass
class _Stream:
    kind: str
    handle: Any
    size: tuple[int, int]
    pixel_format: int
    mirrored: bool


class Streams:
    """Both streams of an open device, started.

    Parameters
    ----------
    device : an open `openni2.Device`; it stays the caller's
    name : of the source, for messages
    live : ask for 640x480 at 30 frames a second; a recording has its own modes

    Raises
    ------
    SensorError
        A stream is missing or has no mode that can be used.
    """

    def __init__(self, device: Any, name: str, *, live: bool) -> None:
        self._name = name
        self._streams: dict[str, _Stream] = {}
        try:
            # Both are created before either starts: a sensor may send from the first start on.
            for kind in (DEPTH, COLOR):
                self._streams[kind] = self._create(device, kind, live=live)
            self.properties = self._read_properties(device)
        except BaseException:
            self.close()
            raise

    def start(self) -> None:
        """Start both, before any `wait` or `read`."""
        for kind, stream in self._streams.items():
            with binding_errors(f"{self._name}: the {kind} stream does not start"):
                stream.handle.start()

    def stop(self) -> None:
        """Stop both; a device that is gone may refuse."""
        for stream in self._streams.values():
            with suppress(OpenNIError):
                stream.handle.stop()

    def handle(self, kind: str) -> Any:
        """Give the binding's own stream, for its recorder."""
        return self._streams[kind].handle

    @property
    def depth_unit_um(self) -> int:
        """Micrometres of one count of a depth."""
        return 100 if self._streams[DEPTH].pixel_format == _100_UM else 1000

    def size(self, kind: str) -> tuple[int, int]:
        """Give (width, height), pixels."""
        return self._streams[kind].size

    def wait(self, timeout_s: float, kinds: tuple[str, ...] = (DEPTH, COLOR)) -> str | None:
        """Wait until a stream has a frame; None where none came in time, or the file is at its end.

        A `read` of what was not announced here may block for ever.
        """
        handles = [self.handle(kind) for kind in kinds]
        with binding_errors(f"{self._name}: waiting for a frame failed"):
            ready = openni2.wait_for_any_stream(handles, timeout_s)
        return next((k for k, h in zip(kinds, handles, strict=True) if h is ready), None)

    def read(self, kind: str) -> Image:
        """Copy the frame that `wait` announced out of the driver's memory.

        Raises
        ------
        WrongSizeError
            It is not of the size that the stream's mode says.
        """
        memory = np.empty(self.frame_bytes(kind), np.uint8)
        stamp_us = self.copy_frame(kind, memory)
        return stamp_us, self.image(kind, memory)

    def frame_bytes(self, kind: str) -> int:
        """Give the size of a frame as the driver sends it, bytes."""
        width, height = self.size(kind)
        return width * height * _PIXEL_BYTES[kind]

    def copy_frame(self, kind: str, memory: NDArray[np.uint8]) -> int:
        """Copy the frame that `wait` announced, as it is, and give its stamp, microseconds.

        Parameters
        ----------
        memory : (`frame_bytes`,) uint8, contiguous

        Raises
        ------
        WrongSizeError
            It is not of the size that the stream's mode says; it is read all the same.
        """
        with binding_errors(f"{self._name}: reading a {kind} frame failed"):
            frame = self._streams[kind].handle.read_frame()
        try:
            self._copy(kind, frame, memory)
            return int(frame.timestamp)
        finally:
            frame.close()

    def image(self, kind: str, memory: NDArray[np.uint8]) -> NDArray[Any]:
        """Make an image of what `copy_frame` copied: an array of its own, not mirrored."""
        stream = self._streams[kind]
        width, height = stream.size
        if kind == COLOR:
            image: NDArray[Any] = memory.reshape(height, width, 3)
        else:
            image = memory.view(np.uint16).reshape(height, width)
        return (image[:, ::-1] if stream.mirrored else image).copy()

    def close(self) -> None:
        """Stop and destroy both, also of a device that is gone; `image` still works."""
        for stream in self._streams.values():
            close_handle(stream.handle)

    def _create(self, device: Any, kind: str, *, live: bool) -> _Stream:
        make = device.create_depth_stream if kind == DEPTH else device.create_color_stream
        with binding_errors(f"{self._name}: the {kind} stream cannot be opened"):
            handle = make()
        if handle is None:
            raise SensorError(f"{self._name}: has no {kind} stream; depth and color are needed")
        try:
            with binding_errors(f"{self._name}: the {kind} stream has no video mode"):
                return self._configure(device, kind, handle, live=live)
        except BaseException:
            close_handle(handle)
            raise

    def _configure(self, device: Any, kind: str, handle: Any, *, live: bool) -> _Stream:
        if live:
            self._choose_mode(device, kind, handle)
        mode = handle.video_mode
        if int(mode.pixelFormat) not in _PIXEL_FORMATS[kind]:
            found = repr(mode.pixelFormat).split("PIXEL_FORMAT_")[-1]
            raise SensorError(f"{self._name}: the {kind} stream is {found}, "
                              f"expected {' or '.join(_PIXEL_FORMATS[kind].values())}")
        if not (0 < mode.resolutionX <= MAX_SIDE and 0 < mode.resolutionY <= MAX_SIDE):
            raise SensorError(f"{self._name}: the {kind} stream is {mode.resolutionX}x"
                              f"{mode.resolutionY}, expected sides of 1 to {MAX_SIDE}")
        return _Stream(kind, handle, (int(mode.resolutionX), int(mode.resolutionY)),
                       int(mode.pixelFormat), self._mirrored(handle))

    def _choose_mode(self, device: Any, kind: str, handle: Any) -> None:
        modes = [(int(m.resolutionX), int(m.resolutionY), int(m.fps), int(m.pixelFormat))
                 for m in device.get_sensor_info(handle.sensor_type).videoModes]
        for pixel_format in _PIXEL_FORMATS[kind]:
            wanted = (*_LIVE_SIZE, _LIVE_FPS, pixel_format)
            if wanted in modes:
                handle.configure_mode(*wanted)
                return
        raise SensorError(
            f"{self._name}: the {kind} stream does not offer 640x480 at 30 frames a second as "
            f"{' or '.join(_PIXEL_FORMATS[kind].values())}")

    def _mirrored(self, handle: Any) -> bool:
        """Switch mirroring off; where that fails, as on recordings, say whether it is on."""
        with suppress(OpenNIError):
            handle.set_mirroring_enabled(False)
        return bool(_property(handle, _MIRRORING, ctypes.c_int))

    def _read_properties(self, device: Any) -> SensorProperties:
        depth, color = self.handle(DEPTH), self.handle(COLOR)
        return SensorProperties(
            zpd_mm=_property(depth, _ZPD, ctypes.c_uint64),
            zpps_mm=_property(depth, _ZPPS, ctypes.c_double),
            dcrcdis_cm=_property(depth, _DCRCDIS, ctypes.c_double),
            depth_fov=_property(depth, _FOV, ctypes.c_float),
            color_fov=_property(color, _FOV, ctypes.c_float),
            usb_vendor=int(device.device_info.usbVendorId),
        )

    def _copy(self, kind: str, frame: Any, memory: NDArray[np.uint8]) -> None:
        """Copy at once: the next read reuses the driver's memory, and closing frees it."""
        width, height = self.size(kind)
        row, stride, size = width * _PIXEL_BYTES[kind], int(frame.stride), int(frame.dataSize)
        if ((int(frame.width), int(frame.height)) != (width, height) or stride < row
                or size < stride * (height - 1) + row):
            raise WrongSizeError(
                f"{self._name}: a {kind} frame of {frame.width}x{frame.height} in {size} "
                f"bytes, expected {width}x{height} (cropping is not supported)")
        if stride == row:
            ctypes.memmove(memory.ctypes.data, int(frame.data), row * height)
            return
        for y in range(height):  # a driver that pads its rows
            ctypes.memmove(memory.ctypes.data + y * row, int(frame.data) + y * stride, row)


def _property(handle: Any, number: int, kind: type[_C]) -> Any:
    """Give a stream's property, None where it has none."""
    with suppress(OpenNIError):
        return handle.get_property(number, kind).value
    return None
