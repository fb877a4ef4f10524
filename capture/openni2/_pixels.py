"""A driver's frame as an array: copied once, by its own word on size, format and cropping."""

import ctypes
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.errors import WrongSizeError
from denseface.capture.openni2._binding import openni2

__all__ = ["FORMATS", "Layout", "copy_raw", "format_name", "format_number", "image_of",
           "layout_of", "raw_bytes"]

FORMATS = {
    int(openni2.PIXEL_FORMAT_DEPTH_1_MM): "DEPTH_1_MM",
    int(openni2.PIXEL_FORMAT_DEPTH_100_UM): "DEPTH_100_UM",
    int(openni2.PIXEL_FORMAT_SHIFT_9_2): "SHIFT_9_2",
    int(openni2.PIXEL_FORMAT_SHIFT_9_3): "SHIFT_9_3",
    int(openni2.PIXEL_FORMAT_RGB888): "RGB888",
    int(openni2.PIXEL_FORMAT_YUV422): "YUV422",
    int(openni2.PIXEL_FORMAT_GRAY8): "GRAY8",
    int(openni2.PIXEL_FORMAT_GRAY16): "GRAY16",
    int(openni2.PIXEL_FORMAT_JPEG): "JPEG",
    int(openni2.PIXEL_FORMAT_YUYV): "YUYV",
}
"""Names of OpenNI2's pixel formats."""
_YUV = {"YUV422": cv2.COLOR_YUV2RGB_UYVY, "YUYV": cv2.COLOR_YUV2RGB_YUYV}
"""How OpenCV turns them into RGB (BT.601): U Y V Y and Y U Y V for two pixels."""
_BYTES = {"DEPTH_1_MM": 2, "DEPTH_100_UM": 2, "RGB888": 3, "YUV422": 2, "YUYV": 2}
"""Bytes of a pixel."""
_BLACK = {"YUV422": (128, 16), "YUYV": (16, 128)}
"""Of the formats in which it is not 0: the bytes at even and odd places."""


@dataclass(frozen=True)
class Layout:
    """How the pixels of a frame lie in the driver's memory."""

    width: int
    height: int
    """Pixels that are there."""
    pixel_format: str
    stride: int
    """Bytes from one row to the next."""
    bytes: int
    """Of the whole frame."""
    crop: tuple[int, int] | None = None
    """Column and row of the first pixel in the whole image; None where nothing is cut off."""

    def __str__(self) -> str:
        return f"{self.width}x{self.height} {self.pixel_format} in {self.bytes} bytes"


def format_name(number: int) -> str:
    """Name a pixel format of OpenNI2."""
    return FORMATS.get(number, f"format {number}")


def format_number(name: str) -> int:
    """Give OpenNI2's number of a pixel format that `FORMATS` names."""
    return next(number for number, each in FORMATS.items() if each == name)


def layout_of(frame: Any, otherwise: str) -> Layout:
    """Read what a frame of the binding says of itself.

    otherwise : the stream's pixel format, for a driver that leaves the frame's own out
    """
    number = int(frame.videoMode.pixelFormat)
    crop = (int(frame.cropOriginX), int(frame.cropOriginY)) if frame.croppingEnabled else None
    return Layout(int(frame.width), int(frame.height), FORMATS.get(number, otherwise),
                  int(frame.stride), int(frame.dataSize), crop)


def raw_bytes(size: tuple[int, int], pixel_format: str) -> int:
    """Give the bytes of a whole image in a driver's format, without gaps."""
    return size[0] * size[1] * _BYTES[pixel_format]


def copy_raw(
    address: int, layout: Layout, size: tuple[int, int], pixel_format: str,
    memory: NDArray[np.uint8],
) -> None:
    """Copy a frame as it is out of the driver's memory, which the next read uses again.

    Parameters
    ----------
    address : of the first pixel in the driver's memory
    layout : how they lie there
    size, pixel_format : (width, height), pixels, and format of the whole image; what was cropped
        away becomes no reading, or black
    memory : (`raw_bytes`,) uint8, contiguous, where the whole image goes

    Raises
    ------
    WrongSizeError
        The frame is not of that size or format, or has less memory than it needs.
    """
    pixel = _BYTES[pixel_format]
    row, (left, top) = layout.width * pixel, layout.crop or (0, 0)
    whole = ((layout.width, layout.height) == size if layout.crop is None else
             0 <= left <= size[0] - layout.width and 0 <= top <= size[1] - layout.height
             and layout.width > 0 and layout.height > 0)
    if (not whole or layout.pixel_format != pixel_format or not address or layout.stride < row
            or layout.bytes < layout.stride * (layout.height - 1) + row
            or memory.nbytes != raw_bytes(size, pixel_format)):
        where = "" if layout.crop is None else f", cropped at {left}, {top},"
        raise WrongSizeError(f"a frame of {layout}{where}, expected {size[0]}x{size[1]} "
                             f"{pixel_format}")
    if layout.crop is None and layout.stride == row:
        ctypes.memmove(memory.ctypes.data, address, row * layout.height)
        return
    source = (ctypes.c_uint8 * (layout.stride * (layout.height - 1) + row)).from_address(address)
    there = np.lib.stride_tricks.as_strided(
        np.ctypeslib.as_array(source), (layout.height, row), (layout.stride, 1))
    if layout.crop is not None:
        black = _BLACK.get(pixel_format, (0, 0))
        memory[::2], memory[1::2] = black
    memory.reshape(size[1], -1)[top:top + layout.height, left * pixel:left * pixel + row] = there


def image_of(
    memory: NDArray[np.uint8], pixel_format: str, size: tuple[int, int], *, mirrored: bool = False
) -> NDArray[Any]:
    """Make an image of what `copy_raw` copied, an array of its own.

    Parameters
    ----------
    memory : (`raw_bytes`,) uint8
    mirrored : turn it back

    Returns
    -------
    (H, W) uint16 depth, in the format's unit, or (H, W, 3) uint8 RGB
    """
    width, height = size
    image: NDArray[Any]
    if pixel_format.startswith("DEPTH"):
        image = memory.view(np.uint16).reshape(height, width)
    elif pixel_format in _YUV:
        image = cv2.cvtColor(memory.reshape(height, width, 2), _YUV[pixel_format])
        return np.ascontiguousarray(image[:, ::-1]) if mirrored else image
    else:
        image = memory.reshape(height, width, 3)
    return (image[:, ::-1] if mirrored else image).copy()
