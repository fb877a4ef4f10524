"""The geometry of a depth + colour sensor: two cameras and their relative pose.

The camera frame is OpenCV's: x right, y down, z forward; lengths in millimetres, image positions
in pixels with (0, 0) the centre of the top left pixel.
"""

import math
from collections import OrderedDict
from functools import lru_cache
from threading import Lock
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, field_validator, model_validator

from denseface.capture.errors import CalibrationError
from denseface.checked_model import FLATTENED, CheckedModel, first_line
from denseface.short_repr import short_repr

__all__ = ["MAX_SIDE", "Calibration", "CameraModel", "ChosenCalibration", "DepthToColor"]

MAX_SIDE = 16384
"""Pixels: the widest and the highest image."""

_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Side = Annotated[int, Field(gt=0, le=MAX_SIDE)]
_Row = tuple[_Finite, _Finite, _Finite]
_Shift = Annotated[float, Field(ge=-1e4, le=1e4, allow_inf_nan=False)]
"""mm between both cameras, along an axis."""
_Array = NDArray[np.float64]

_FOCAL_PER_SIDE = (1e-2, 1e3)
"""Focal length by the longer side: fields of view of 179 to 0.06 degrees."""
_MAX_ASPECT = 10.0
"""Of a pixel; of a sensor's, binned or not, it is 0.5 to 2."""
_WIDEST, _HIGHEST = 0.5, 0.8
"""Height by width of images of a sensor: 2:1 to 5:4."""
_CENTER_PER_SIDE = 1e3
"""How far the principal point may be off by the longer side: a small part of a large image."""
_RAYS_BYTES = 64 * 2**20
"""Of the maps of rays that are kept: of thirteen cameras with 640x480 pixels, of none with
4096x4096."""
_RAYS_AT_ONCE = 2**20
"""Pixels whose rays are computed at once; each takes some two hundred bytes meanwhile."""
_UNDISTORT_ITERATIONS = 20
"""Newton steps, at most."""
_UNDISTORT_TOLERANCE = 1e-12
"""Residual, at z = 1, at which they end."""
_INVERTIBLE_PX = 1e-6
"""Pixels: a distortion is refused where undoing it is off by more."""
_ROTATION_TOLERANCE = 1e-4
"""Largest entry of R R^T - I."""
_SAME_SHAPE = 0.005
"""By which two images' sides may differ in ratio: 1296x968 of 640x480 is off by 0.4 %."""


class _Model(CheckedModel):
    error = CalibrationError


class CameraModel(_Model):
    """A pinhole camera with Brown-Conrady distortion, as in OpenCV."""

    width: _Side
    """Pixels."""
    height: _Side
    """Pixels."""
    fx: _Positive
    """Focal length along x, pixels."""
    fy: _Positive
    """Focal length along y, pixels."""
    cx: _Finite
    """Principal point along x, pixels."""
    cy: _Finite
    """Principal point along y, pixels."""
    distortion: Annotated[tuple[_Finite, _Finite, _Finite, _Finite, _Finite], FLATTENED] = (
        0.0, 0.0, 0.0, 0.0, 0.0)
    """(k1, k2, p1, p2, k3), OpenCV's order."""

    def project(self, points: NDArray[np.floating]) -> _Array:
        """Project points to pixels, distortion included.

        Parameters
        ----------
        points : (..., 3) float, mm, this camera's frame; z must be positive for a meaningful pixel

        Returns
        -------
        (..., 2) float64, pixels (u, v)
        """
        points = np.asarray(points, np.float64)
        if points.shape[-1:] != (3,):
            raise ValueError(f"points must have shape (..., 3), found {points.shape}")
        x, y = self._distort(points[..., 0] / points[..., 2], points[..., 1] / points[..., 2])
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=-1)

    def back_project(self, pixels: NDArray[np.floating], depth_mm: NDArray[Any] | float) -> _Array:
        """Back-project pixels at a depth: x / (u - u0) = y / (v - v0) = z / f, paper Eq. (1).

        Parameters
        ----------
        pixels : (..., 2) float, pixels (u, v)
        depth_mm : (...) float, mm along z

        Returns
        -------
        (..., 3) float64, mm, this camera's frame
        """
        pixels = np.asarray(pixels, dtype=np.float64)
        if pixels.shape[-1:] != (2,):
            raise ValueError(f"pixels must have shape (..., 2), found {pixels.shape}")
        z = np.broadcast_to(np.asarray(depth_mm, np.float64), pixels.shape[:-1])
        centered = np.subtract(pixels, (self.cx, self.cy), dtype=np.float64)
        x, y = self._undistort(centered[..., 0] / self.fx, centered[..., 1] / self.fy)
        return np.stack([x * z, y * z, z], axis=-1)

    def rays(self) -> _Array:
        """Give the point at z = 1 that each pixel's centre sees: (height, width, 2) float64.

        The array is read-only. Those of the last cameras are kept, as many as 64 MiB hold.
        """
        return _RAY_MAPS.of(self)

    def scaled(self, factor: float) -> Self:
        """Give the same camera at another resolution."""
        return self.model_copy(update={
            "width": round(self.width * factor), "height": round(self.height * factor),
            "fx": self.fx * factor, "fy": self.fy * factor,
            "cx": (self.cx + 0.5) * factor - 0.5, "cy": (self.cy + 0.5) * factor - 0.5,
        })

    def cut_to(self, width: int, height: int) -> Self:
        """Give the same camera in another mode of its sensor, by how these sensors cut their modes.

        The modes of a sensor have its full width. Those of 4:3 and wider are centred on one
        another; an image of 5:4 (1280x1024) has its further rows at the bottom, so that 640x480 is
        its upper 960 rows (openni2_camera: the principal point of both is at 3/8 of the width).

        Raises
        ------
        ValueError
            One of both sizes is neither 5:4 nor 4:3 nor wider.
        """
        if (width, height) == (self.width, self.height):
            return self
        factor = width / self.width
        top = _rows_above(self.width, self.height) * factor - _rows_above(width, height)
        return self.model_copy(update={
            "width": width, "height": height, "fx": self.fx * factor, "fy": self.fy * factor,
            "cx": (self.cx + 0.5) * factor - 0.5, "cy": (self.cy + 0.5) * factor - 0.5 + top,
        })

    def for_size(self, width: int, height: int) -> Self:
        """Give the same camera for images of another resolution and the same shape.

        640x480 and 1280x1024 are the one exception, see `cut_to`.

        Raises
        ------
        CalibrationError
            An image of another shape shows another part of the scene.
        """
        if (width, height) == (self.width, self.height):
            return self
        across, down = width / self.width, height / self.height
        if abs(across / down - 1) > _SAME_SHAPE:
            shapes = {width / height, self.width / self.height}
            if shapes == {4 / 3, 5 / 4}:
                return self.cut_to(width, height)
            raise CalibrationError(
                f"is for images of {self.width}x{self.height}, the image is {width}x{height}: "
                "not the same shape, so not the same part of the scene")
        return type(self)(
            width=width, height=height, fx=self.fx * across, fy=self.fy * down,
            cx=(self.cx + 0.5) * across - 0.5, cy=(self.cy + 0.5) * down - 0.5,
            distortion=self.distortion)

    def _distort(self, x: _Array, y: _Array) -> tuple[_Array, _Array]:
        if not any(self.distortion):
            return x, y
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)

    def _undistort(self, xd: _Array, yd: _Array) -> tuple[_Array, _Array]:
        """Invert `_distort` by Newton's method."""
        if not any(self.distortion):
            return xd, yd
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xd, yd
        for _ in range(_UNDISTORT_ITERATIONS):
            ex, ey = self._distort(x, y)
            ex, ey = xd - ex, yd - ey
            if max(np.abs(ex).max(initial=0), np.abs(ey).max(initial=0)) < _UNDISTORT_TOLERANCE:
                break
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            growth = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
            xx = radial + growth * x * x + 2 * p1 * y + 6 * p2 * x
            yy = radial + growth * y * y + 6 * p1 * y + 2 * p2 * x
            xy = growth * x * y + 2 * p1 * x + 2 * p2 * y
            determinant = xx * yy - xy * xy
            x = x + (yy * ex - xy * ey) / determinant
            y = y + (xx * ey - xy * ex) / determinant
        return x, y

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """Refuse what no camera is, before its numbers overflow in what is computed from them."""
        side = max(self.width, self.height)
        least, most = (side * factor for factor in _FOCAL_PER_SIDE)
        for name, focal in (("fx", self.fx), ("fy", self.fy)):
            if not least <= focal <= most:
                raise ValueError(f"{name} is {focal:.6g} pixels, expected {least:g} to {most:g} of "
                                 f"a camera of {self.width}x{self.height}")
        if not 1 / _MAX_ASPECT <= self.fx / self.fy <= _MAX_ASPECT:
            raise ValueError(f"fx is {self.fx:.6g} and fy {self.fy:.6g}: no pixel is "
                             f"{_MAX_ASPECT:g} times as long as wide")
        for name, center in (("cx", self.cx), ("cy", self.cy)):
            if abs(center) > _CENTER_PER_SIDE * side:
                raise ValueError(f"{name} is {center:.6g}, more than {_CENTER_PER_SIDE:g} times "
                                 "as far off as the image is wide or high")
        return self

    @model_validator(mode="after")
    def _invertible(self) -> Self:
        """Refuse a distortion that folds the image over itself: its pixels have no one ray."""
        if _folds(self):
            raise ValueError("distortion cannot be inverted over the whole image")
        return self


def _rows_above(width: int, height: int) -> float:
    """Give how many rows of the 4:3 image of that width lie above an image of it."""
    if not _WIDEST <= height / width <= _HIGHEST:
        raise ValueError(f"{width}x{height} is no known cut of a sensor's image")
    return max(0.75 * width - height, 0) / 2


@lru_cache(maxsize=32)  # every frame that is read brings equal cameras
def _folds(camera: CameraModel) -> bool:
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, 9), np.linspace(0, camera.height - 1, 9))
    pixels = np.stack([u, v], axis=-1)
    with np.errstate(all="ignore"):
        off = np.abs(camera.project(camera.back_project(pixels, 1.0)) - pixels)
    return not (off < _INVERTIBLE_PX).all()


class _RayMaps:
    """The maps of rays of the last cameras, as many as `max_bytes` hold; for any thread."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._maps: OrderedDict[CameraModel, _Array] = OrderedDict()
        self._lock = Lock()

    def of(self, camera: CameraModel) -> _Array:
        with self._lock:
            if camera in self._maps:
                self._maps.move_to_end(camera)
                return self._maps[camera]
        rays = _rays(camera)
        if rays.nbytes <= self._max_bytes:
            with self._lock:
                self._maps[camera] = rays
                while self.nbytes > self._max_bytes:
                    self._maps.popitem(last=False)
        return rays

    @property
    def nbytes(self) -> int:
        return sum(rays.nbytes for rays in self._maps.values())


_RAY_MAPS = _RayMaps(_RAYS_BYTES)


def _rays(camera: CameraModel) -> _Array:
    rays = np.empty((camera.height, camera.width, 2))
    every = max(1, _RAYS_AT_ONCE // camera.width)
    for top in range(0, camera.height, every):
        v, u = np.mgrid[top:min(top + every, camera.height), :camera.width]
        rays[top:top + every] = camera.back_project(np.stack([u, v], axis=-1), 1.0)[..., :2]
    rays.setflags(write=False)
    return rays


class DepthToColor(_Model):
    """The rigid transform X_color = rotation @ X_depth + translation."""

    rotation: tuple[_Row, _Row, _Row] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    translation_mm: Annotated[tuple[_Shift, _Shift, _Shift], FLATTENED] = (0, 0, 0)

    @field_validator("rotation")
    @classmethod
    def _proper(cls, rows: tuple[_Row, _Row, _Row]) -> tuple[_Row, _Row, _Row]:
        R = np.array(rows)
        if np.abs(R @ R.T - np.eye(3)).max() > _ROTATION_TOLERANCE or np.linalg.det(R) < 0:
            raise ValueError("must be a proper rotation (orthonormal rows, determinant +1)")
        return rows

    def apply(self, points: NDArray[np.floating]) -> _Array:
        """Take (..., 3) points, mm, from the depth camera's frame to the colour camera's."""
        moved: _Array = points @ np.array(self.rotation).T + self.translation_mm
        return moved


class Calibration(_Model):
    """Both cameras of a sensor and where they stand to each other."""

    depth: CameraModel
    color: CameraModel
    """The depth camera again where a sensor has no other."""
    depth_to_color: DepthToColor = DepthToColor()

    def __repr__(self) -> str:
        return short_repr(self, *(
            f"{name} {camera.width}x{camera.height} of focal length {camera.fx:.1f}"
            for name, camera in (("depth", self.depth), ("color", self.color))),
            f"{math.hypot(*self.depth_to_color.translation_mm):.1f} mm apart")

    __str__ = __repr__

    @model_validator(mode="before")
    @classmethod
    def _depth_alone(cls, given: Any) -> Any:
        """Take a calibration without a colour camera for that of a sensor that has none."""
        if isinstance(given, dict) and "depth" in given and not given.keys() & {
                "color", "depth_to_color"}:
            return given | {"color": given["depth"]}
        return given

    @classmethod
    def from_json(cls, text: str | bytes, *, name: str = "calibration") -> Self:
        """Read the JSON of the frame format.

        Raises
        ------
        CalibrationError
            One line that names `name`, the field, and what is wrong with it.
        """
        if isinstance(text, bytes):
            text = text.removeprefix(b"\xef\xbb\xbf")  # the mark that some editors put before UTF-8
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            hint = "" if "{" in str(text) else ": load_calibration(path) reads a file"
            raise CalibrationError(f"{name}: {first_line(error, 'JSON')}{hint}") from error

    def to_json(self) -> str:
        """Write the JSON of the frame format."""
        return self.model_dump_json()

    def for_images(
        self, depth: tuple[int, int], color: tuple[int, int] | None, registered: bool
    ) -> tuple[Self, bool]:
        """Fit the cameras to images of these sizes, (width, height) pixels.

        Gives the calibration, and whether the depth is in the colour image's pixels. A depth that
        was registered at another resolution than the colour's is not: it is what the colour camera
        sees in fewer or more pixels, so its camera stands in the same place.

        Raises
        ------
        CalibrationError
            An image has another shape than its camera's, in words that begin with its name.
        """
        def fitted(name: str, camera: CameraModel, size: tuple[int, int]) -> CameraModel:
            try:
                return camera.for_size(*size)
            except ValueError as error:
                raise CalibrationError(f"the {name} camera's calibration {error}") from error

        if color is None:
            camera = fitted("depth", self.depth, depth)
            return self.model_copy(update={"depth": camera, "color": camera}), False
        of_color = fitted("color", self.color, color)
        if registered and depth == color:
            return self.model_copy(update={"color": of_color}), True
        if registered:
            return type(self)(depth=fitted("color", self.color, depth), color=of_color,
                              depth_to_color=DepthToColor()), False
        return self.model_copy(
            update={"depth": fitted("depth", self.depth, depth), "color": of_color}), False


class ChosenCalibration(NamedTuple):
    """A calibration that wins over what the source says of itself, and where it came from."""

    calibration: Calibration
    origin: str
    notes: tuple[str, ...] = ()
    """What was assumed when it was read."""
    registered: bool | None = None
    """Whether the depth is already in the colour camera's pixels, whatever the source says; None
    where this is not said."""
