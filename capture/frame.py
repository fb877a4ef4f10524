"""A synchronized depth + colour frame with its calibration."""

from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.errors import FrameError

__all__ = ["RgbdFrame"]


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """One synchronized depth + colour pair with its calibration.

    Attributes
    ----------
    depth : (H, W) uint16, mm along z, 0 = no reading, as the depth camera sees it
        (in the colour camera's pixels where `registered`)
    color : (H', W', 3) uint8, RGB
    depth_timestamp_us, color_timestamp_us : sensor clock, microseconds
    calibration : both cameras and their relative pose
    registered : depth is already in the colour camera's pixels
    calibration_origin : which calibration this is, for the report

    Raises
    ------
    FrameError
        Where an array's shape or dtype is not as above or not as the calibration states.
    """

    depth: NDArray[np.uint16]
    color: NDArray[np.uint8]
    depth_timestamp_us: int
    color_timestamp_us: int
    calibration: Calibration
    registered: bool = False
    calibration_origin: str = field(default="unspecified", kw_only=True)

    def __post_init__(self) -> None:
        _check("depth", self.depth, np.uint16, 2)
        _check("color", self.color, np.uint8, 3)
        if self.color.shape[2] != 3:
            raise FrameError(f"color must have 3 channels (RGB), found shape {self.color.shape}")
        for name, image, camera in (("depth", self.depth, self.depth_camera),
                                    ("color", self.color, self.calibration.color)):
            height, width = image.shape[:2]
            if (width, height) != (camera.width, camera.height):
                raise FrameError(f"{name} is {width}x{height}, its calibration says "
                                 f"{camera.width}x{camera.height}")

    @property
    def depth_camera(self) -> CameraModel:
        """The camera in whose pixels `depth` is given."""
        return self.calibration.color if self.registered else self.calibration.depth

    @property
    def depth_to_color(self) -> DepthToColor:
        """From the frame of `depth_camera` to the colour camera's: identity where registered."""
        return DepthToColor() if self.registered else self.calibration.depth_to_color

    @property
    def skew_us(self) -> int:
        """How much later the depth was taken than the colour, microseconds."""
        return self.depth_timestamp_us - self.color_timestamp_us

    def with_calibration(self, calibration: Calibration, origin: str) -> Self:
        """Give the same images under another calibration."""
        return replace(self, calibration=calibration, calibration_origin=origin)


def _check(name: str, array: NDArray[Any], dtype: type[np.generic], ndim: int) -> None:
    if not isinstance(array, np.ndarray) or array.dtype != dtype or array.ndim != ndim:
        is_array = isinstance(array, np.ndarray)
        found = f"{array.dtype} {array.shape}" if is_array else type(array).__name__
        raise FrameError(
            f"{name} must be a {ndim}-dimensional {np.dtype(dtype)} array, found {found}")
