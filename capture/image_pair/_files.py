"""An image file as an array: what it may be is checked, then it is decoded."""

import os
from math import prod
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import MAX_SIDE
from denseface.capture.errors import FrameError, UnreadableSourceError
from denseface.capture.image_pair._headers import read_header
from denseface.capture.zipped_arrays import read_npy_header
from denseface.files import open_regular, read_bounded

__all__ = ["MAX_PIXELS", "read_color_image", "read_depth_image", "read_grey_image"]

MAX_PIXELS = 2**24
"""Of an image, where the caller does not say; more than any sensor's."""
_MAX_FILE_BYTES = 256 * 2**20
"""Of an image file; 16 million pixels of 3 floats are less."""
_MAX_VALUE_BYTES = 8
"""Of a number in a `.npy`."""
_NUMBERS = "uif"
"""NumPy's letters of whole numbers and floats."""
_STRETCHED = (0.5, 99.5)
"""Percentiles of an infrared image that become black and white: a reflex of the projector is far
brighter than all else."""
_DEPTH_DTYPES = "16 or 32 bits, or float"

# OpenCV reads EXR files only where it is told to, when it first meets one.
os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")


def read_depth_image(path: str | Path, max_pixels: int = MAX_PIXELS) -> NDArray[Any]:
    """Read a depth image: PNG, TIFF, EXR or `.npy`.

    Returns
    -------
    (H, W), whole numbers or float as the file holds them, in the file's unit

    Raises
    ------
    UnreadableSourceError
        Missing, damaged, or no image.
    FrameError
        An image that is no depth: 8 bits, several channels, or too large.
    """
    image = _read(path, max_pixels)
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[..., 0]
    if image.ndim == 3 and image.dtype.kind == "f" and (image == image[..., :1]).all():
        image = image[..., 0]  # grey, written as three channels
    if image.ndim != 2:
        raise FrameError(f"{path}: has {image.shape[-1]} channels, expected a depth image of one "
                         "(a coloured picture of a depth holds no distances)")
    if image.dtype.itemsize == 1:
        raise FrameError(f"{path}: has 8 bits a pixel, expected {_DEPTH_DTYPES}: 255 steps are a "
                         "picture of a depth, no measurement")
    return np.ascontiguousarray(image)


def read_color_image(path: str | Path, max_pixels: int = MAX_PIXELS) -> NDArray[np.uint8]:
    """Read a colour image, PNG, JPEG, WebP, TIFF or `.npy`: (H, W, 3) uint8, RGB.

    A grey image has three equal channels, an alpha channel is left out, 16 bits become 8. It is
    not turned by what its EXIF says: a calibration is of the sensor's own pixels.

    Raises
    ------
    UnreadableSourceError, FrameError
        As from `read_depth_image`.
    """
    image = _read(path, max_pixels)
    if image.ndim == 2:
        image = image[..., None]
    if image.dtype not in (np.uint8, np.uint16) or image.shape[2] not in (1, 3, 4):
        raise FrameError(f"{path}: is {image.dtype} with {image.shape[2]} channels, expected a "
                         "colour image: 8 or 16 bits and 1, 3 or 4 channels")
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    return np.ascontiguousarray(np.broadcast_to(image[..., :3], (*image.shape[:2], 3)))


def read_grey_image(path: str | Path, max_pixels: int = MAX_PIXELS) -> NDArray[np.uint8]:
    """Read an image of any bits as grey, (H, W) uint8, stretched to what its pixels span.

    Infrared images of 16 bits use a small part of them.

    Raises
    ------
    UnreadableSourceError, FrameError
        As from `read_depth_image`.
    """
    image = _read(path, max_pixels).astype(np.float32)
    if image.ndim == 3:
        image = image[..., :3].mean(axis=2)
    dark, bright = np.percentile(image[np.isfinite(image)], _STRETCHED) if image.size else (0, 0)
    stretched = (image - dark) * (255 / max(bright - dark, 1e-6))
    return np.nan_to_num(stretched, nan=0, posinf=255, neginf=0).clip(0, 255).astype(np.uint8)


def _read(path: str | Path, max_pixels: int) -> NDArray[Any]:
    """Give (H, W) or (H, W, C), colour channels as RGB."""
    try:
        if Path(path).suffix.lower() == ".npy":
            return _read_npy(path, max_pixels)
        data = read_bounded(path, _MAX_FILE_BYTES)
    except OSError as error:
        if isinstance(error, UnreadableSourceError):
            raise
        raise UnreadableSourceError(f"{path}: {error.strerror or error}") from error
    try:
        kind, width, height = read_header(data)
    except ValueError as error:
        raise UnreadableSourceError(f"{path}: {error}") from error
    _check_size(path, width, height, max_pixels)
    image = _decoded(data)
    if image is None:
        raise UnreadableSourceError(f"{path}: a {kind} image that cannot be decoded: cut short, "
                                    "damaged or of an unusual kind")
    if image.shape[:2] != (height, width):
        raise UnreadableSourceError(
            f"{path}: a {kind} image that says {width}x{height} and holds "
            f"{image.shape[1]}x{image.shape[0]}")
    if image.ndim == 3 and image.shape[2] in (3, 4):
        image = image[..., [2, 1, 0, 3][:image.shape[2]]]
    return image


def _decoded(data: bytes) -> NDArray[Any] | None:
    # What a library prints by itself would be a second line of an error.
    log = cv2.utils.logging
    before = log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        image: NDArray[Any] | None = cv2.imdecode(
            np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        log.setLogLevel(before)
    return image


def _read_npy(path: str | Path, max_pixels: int) -> NDArray[Any]:
    with open_regular(path) as file:
        shape, fortran, dtype = read_npy_header(str(path), file)
        if (dtype.kind not in _NUMBERS or dtype.itemsize > _MAX_VALUE_BYTES
                or len(shape) not in (2, 3) or any(type(side) is not int for side in shape)
                or (len(shape) == 3 and shape[2] not in (1, 3, 4))):
            raise FrameError(f"{path}: expected an image of numbers, (H, W) or (H, W, 3), found "
                             f"{dtype} {shape}")
        _check_size(path, shape[1], shape[0], max_pixels)
        size = prod(shape) * dtype.itemsize
        data = file.read(size + 1)
    if len(data) != size:
        raise UnreadableSourceError(
            f"{path}: {dtype} {shape} needs {size} bytes, the file holds "
            f"{'fewer' if len(data) < size else 'more'}")
    array = np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
    return array.astype(dtype.newbyteorder("="), order="C")


def _check_size(path: str | Path, width: int, height: int, max_pixels: int) -> None:
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
        raise FrameError(f"{path}: {width}x{height} pixels, expected sides of 1 to {MAX_SIDE}")
    if width * height > max_pixels:
        raise FrameError(f"{path}: {width}x{height} = {width * height} pixels, at most "
                         f"{max_pixels} allowed (DENSEFACE_MAX_FRAME_PIXELS)")
